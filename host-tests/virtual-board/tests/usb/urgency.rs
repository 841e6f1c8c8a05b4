//! What traffic on USB costs the stops of others.

use std::time::Duration;

use host_protocol::{Request, requests};
use virtual_board::board::Board;

use crate::rig::{Rig, frame, pings};

on_each_board!(
    an_e_stop_on_another_link_keeps_its_bound,
    an_expiry_keeps_its_bound,
    an_e_stop_among_pings_waits_for_few_of_them
);

/// SAFETY.md, Reaction times: 100 µs + F (2k − 1) for the only axis of a bus; F is 135 bits at 1
/// Mbit/s.
const BOUND: Duration = Duration::from_micros(100 + 135);
/// The firmware's share of it.
const SOFTWARE: Duration = Duration::from_micros(100);
/// For a packet that waits behind another on its own link.
const BACKLOG: Duration = Duration::from_millis(2);
/// A byte at 921600 baud, as near as the board's clock comes (100 MHz / 109).
const BYTE: Duration = Duration::from_nanos(10_900);
const PHASES: u32 = 3;
/// Between phases: not a multiple of what the bus does.
const STEP: Duration = Duration::from_micros(1_013);

/// Packets full of pings, for as long as it takes, in both directions.
fn flood(rig: &Rig) {
    let (transfer, _) = pings(64 * 3000, 0);
    rig.machine.borrow_mut().usb().send(&transfer);
}

fn e_stop(sequence: u16) -> Vec<u8> {
    frame(&Request::EStop(requests::EStop {}), sequence)
}

fn an_e_stop_on_another_link_keeps_its_bound(board: Board) {
    let mut worst = Duration::ZERO;
    for phase in 0..PHASES {
        let rig = Rig::connected(board);
        flood(&rig);
        rig.run_for(Duration::from_millis(5) + STEP * phase);
        let stop = e_stop(1);
        let sent = rig.now() + BYTE * u32::try_from(stop.len()).expect("short");
        let host = rig.outside.hosts[1];
        rig.machine.borrow_mut().line(host).send(&stop);
        rig.run_for(Duration::from_millis(5));
        let first = rig.first_stop(rig.now() - Duration::from_millis(5)).expect("a stop");
        assert!(rig.machine.borrow_mut().usb().unsent() > 0, "the flood lasts");
        worst = worst.max(first.saturating_sub(sent));
    }
    assert!(worst <= BOUND, "{worst:?}");
}

/// The e-stop is behind a packet of five pings, each of which is a turn, and is answered.
fn an_e_stop_among_pings_waits_for_few_of_them(board: Board) {
    let mut worst = Duration::ZERO;
    for phase in 0..PHASES {
        let rig = Rig::connected(board);
        flood(&rig);
        rig.run_for(Duration::from_millis(5) + STEP * phase);
        let mut machine = rig.machine.borrow_mut();
        machine.usb().clear();
        machine.usb().send_packet(&e_stop(0x7000));
        machine.usb().send(&pings(64 * 1000, 0x7001).0);
        let waiting = machine.usb().unsent();
        let begin = machine.now();
        assert!(
            machine.run_until(Duration::from_millis(5), |machine| machine.usb().unsent() < waiting)
        );
        let taken = machine.now();
        machine.run_for(Duration::from_millis(5));
        drop(machine);
        let first = rig.first_stop(begin).expect("a stop");
        worst = worst.max(first.saturating_sub(taken));
    }
    assert!(worst <= BACKLOG, "{worst:?}");
}

/// Beside a run without the flood, whose stop leaves when the setpoint expires.
fn an_expiry_keeps_its_bound(board: Board) {
    let mut worst = Duration::ZERO;
    for phase in 0..PHASES / 3 {
        let [quiet, flooded] = [false, true].map(|floods| {
            let rig = Rig::connected(board);
            let mut client = rig.uart();
            client.take_authority().expect("authority");
            Rig::turn(&mut client);
            let set = rig.now();
            rig.run_for(STEP * phase);
            if floods {
                flood(&rig);
            }
            rig.run_for(Duration::from_millis(130));
            assert_eq!(rig.machine.borrow_mut().usb().unsent() > 0, floods, "the flood lasts");
            rig.first_stop(set).expect("a stop")
        });
        worst = worst.max(flooded.saturating_sub(quiet));
    }
    assert!(worst <= SOFTWARE, "{worst:?}");
}
