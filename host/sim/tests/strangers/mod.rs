//! Who does not belong on a bus or on a host link.

use crate::four_motors::Rig;
use host_protocol::{CanFrame, RawFrame};
use mgw_sim::{Station, Wire, Wiring};

fn status_2() -> CanFrame {
    CanFrame::standard(0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap()
}

/// Asks a motor while a foreign station babbles; how often it was asked and how many frames the
/// babbler sent within 10 ms.
fn asked_under(babble: u16) -> (usize, usize) {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.client.raw_open(0).unwrap();
    rig.world.borrow_mut().trace();
    rig.world.borrow_mut().babble(0, CanFrame::standard(babble, &[0x55; 8]));
    rig.client.raw_send(0, RawFrame::Can(status_2())).unwrap();
    rig.silence(10);
    let trace = rig.world.borrow_mut().trace();
    let count = |station| trace.iter().filter(|entry| entry.from == station).count();
    (count(Station::Gateway), count(Station::Stranger))
}

/// A frame with id 0x7FF lets everybody go first, one with id 1 nobody. It takes about 120 bits at
/// 1 Mbit/s.
#[test]
fn a_babbling_node_takes_the_bus_from_those_with_higher_ids() {
    let (asked, babbled) = asked_under(0x7FF);
    assert_eq!(asked, 1);
    assert!((75..95).contains(&babbled), "{babbled}");
    let (asked, babbled) = asked_under(0x001);
    assert_eq!(asked, 0);
    assert!((75..95).contains(&babbled), "{babbled}");
}

#[test]
fn a_stranger_speaks_once_or_until_it_is_told_to_stop() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.client.raw_open(2).unwrap();
    rig.world.borrow_mut().trace();
    rig.world.borrow_mut().send_foreign(0, Wire::Can(status_2()));
    rig.world.borrow_mut().send_foreign(2, Wire::Serial(vec![0x3E, 0x01]));
    rig.silence(10);
    let lines: Vec<_> =
        rig.world.borrow_mut().trace().iter().map(|entry| entry.wire.to_string()).collect();
    // The motor answers every station.
    assert_eq!(lines, ["141#9C00000000000000", "3E01", "241#9C19000000000000"]);
    rig.world.borrow_mut().babble(0, CanFrame::standard(0x7FF, &[]));
    rig.silence(1);
    rig.world.borrow_mut().babble(0, None);
    rig.silence(1);
    let babbled = rig.world.borrow_mut().trace().len();
    assert!(babbled > 5);
    rig.silence(10);
    assert_eq!(rig.world.borrow_mut().trace().len(), 0);
}

#[test]
fn a_host_that_does_not_read_gets_it_later() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.world.borrow_mut().set_host_reads(0, false);
    assert!(rig.client.ping().is_err());
    rig.world.borrow_mut().set_host_reads(0, true);
    assert!(rig.client.ping().is_ok());
}
