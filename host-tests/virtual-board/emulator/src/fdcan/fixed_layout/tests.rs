use rigless::soc::Layout;
use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::*;
use crate::g474::tables;

fn table() -> &'static [RegisterSpec] {
    tables::named("FDCAN1").registers
}

#[test]
fn every_register_of_the_part_means_something() {
    for register in table() {
        assert!(meaning(register.offset).is_some(), "{} at {:#x}", register.name, register.offset);
    }
}

#[test]
fn a_flag_stands_where_the_metadata_has_it_and_is_the_one_of_that_name() {
    let ours = table().iter().find(|register| register.name == "IR").expect("it has one");
    let mut compared = 0;
    for field in ours.fields {
        let theirs = Register::FdcanIr.spec().fields.iter().find(|known| known.name == field.name);
        if let Some(theirs) = theirs {
            assert_eq!(FLAGS[usize::from(field.bit)], u32::from(theirs.bit), "{}", field.name);
            compared += 1;
        }
    }
    // The flags of the receive FIFOs have other names there.
    assert_eq!(compared, 17, "{:?}", ours.fields);
}

#[test]
fn flags_there_and_back_are_the_same() {
    assert_eq!(gathered(scattered(0x00FF_FFFF)), 0x00FF_FFFF);
    assert_eq!(scattered(1 << 7), 1 << 9, "TC");
    assert_eq!(gathered(1 << 25), 1 << 19, "BO");
    assert_eq!(gathered(1 << 1), 0, "a watermark, which this part has not");
}

#[test]
fn the_queues_lie_one_behind_the_other_in_212_words() {
    assert_eq!(EXTENDED_FILTERS, 28);
    assert_eq!(RECEIVE[0], 28 + 8 * 2);
    assert_eq!(RECEIVE[1], RECEIVE[0] + 3 * 18);
    assert_eq!(EVENTS, RECEIVE[1] + 3 * 18);
    assert_eq!(TRANSMIT, EVENTS + 3 * 2);
    assert_eq!(WORDS, TRANSMIT + 3 * 18);
}
