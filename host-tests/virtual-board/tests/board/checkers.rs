//! The checkers can fail: each is shown a planted fault.

use std::time::Duration;

use host_protocol::Setpoint;

use crate::gaps::{self, Kind, Known, gap, known};
use crate::lab::{BUS_RMD_AND_THRUSTER, Lab, RMD};
use crate::reaction::Reaction;
use crate::wire;

#[test]
fn a_wrong_expected_byte_is_noticed() {
    let mut lab = Lab::configured();
    let since = lab.now();
    let hold = lab.arm(&[RMD])[0];
    let setpoint = Setpoint::Current { current_a: 1.0 };
    lab.client.set(RMD, hold.epoch, setpoint, hold.ttl).expect("taken over");
    lab.stay(Duration::from_millis(5));
    let on_wire = lab.wire(BUS_RMD_AND_THRUSTER, since);
    assert!(wire::find(&on_wire, "141#A100000064000000").is_ok());
    for wrong in ["141#A100000065000000", "142#A100000064000000", "141#A1000000640000"] {
        let error = wire::find(&on_wire, wrong).unwrap_err();
        assert!(error.contains(wrong) && error.contains("141#A100000064000000"), "{error}");
    }
}

/// A frame that only others have sent, or that never arrived, is no frame of the gateway.
#[test]
fn a_frame_of_somebody_else_or_without_acknowledgement_does_not_count() {
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.report(RMD);
    let mut on_wire = lab.wire(BUS_RMD_AND_THRUSTER, since);
    let reply = on_wire.iter().find(|message| !message.by_gateway).expect("a reply").text.clone();
    assert!(wire::find(&on_wire, &reply).is_err());
    assert!(wire::find(&on_wire, "141#9C00000000000000").is_ok());
    on_wire.iter_mut().for_each(|message| message.arrived = false);
    assert!(wire::find(&on_wire, "141#9C00000000000000").is_err());
}

#[test]
#[should_panic(expected = "too late")]
fn a_stop_that_is_too_late_is_noticed() {
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.report(RMD);
    let sent = lab.first(BUS_RMD_AND_THRUSTER, since, "141#9C00000000000000");
    let long_before = since - Duration::from_millis(10);
    Reaction::new("a planted cause", RMD, long_before, &sent, Duration::from_millis(5));
}

/// The list without one of its entries: the entry that is then unlisted is met in every run.
#[test]
fn an_unlisted_register_is_noticed() {
    let lab = Lab::configured();
    let met = gaps::met(&mut lab.machine.borrow_mut());
    assert_eq!(gaps::check_known(&met, known()), Ok(()));
    for (at, missing) in known().iter().enumerate() {
        let mut shorter = known().to_vec();
        shorter.remove(at);
        let error = gaps::check_known(&met, &shorter).unwrap_err();
        assert!(error.contains(&format!("{:#010x}", missing.address)), "{error}");
    }
}

#[test]
fn an_entry_that_no_longer_occurs_is_noticed() {
    let lab = Lab::configured();
    let met = gaps::met(&mut lab.machine.borrow_mut());
    let gone = gap(Kind::Unimplemented, 0x4000_0000, "TIM2.CR1", "none");
    let longer = [known(), &[gone]].concat();
    let error = gaps::check_met(&met, &longer).unwrap_err();
    assert!(error.contains("0x40000000 TIM2.CR1"), "{error}");
}

/// The addresses of the list are those of the registers that it names; where it names none there is
/// none.
#[test]
fn the_list_names_registers_at_their_addresses() {
    let lab = Lab::configured();
    let machine = lab.machine.borrow();
    for Known { kind, address, register, .. } in known() {
        let (instance, name) = register.split_once('.').unwrap_or((register, ""));
        let mut peripherals = machine.part().bus().slots().iter().map(|slot| slot.peripheral());
        let peripheral =
            peripherals.find(|peripheral| peripheral.name == instance).expect(instance);
        if *kind == Kind::Undefined {
            let offset = address - peripheral.base;
            let is_one = peripheral.registers.iter().any(|spec| u64::from(spec.offset) == offset);
            assert!(offset < peripheral.size && !is_one, "{instance}");
            continue;
        }
        let register = peripheral.registers.iter().find(|spec| spec.name == name).expect(name);
        assert_eq!(peripheral.base + u64::from(register.offset), *address, "{instance}.{name}");
    }
}
