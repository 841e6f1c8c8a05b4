//! The clock of the board, from the ST-LINK or a crystal: missing at the start, late, and lost
//! while motors turn.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{AxisState, BootReason, BusLimit, TripReason};
use mgw_client::Client;
use rigless::device::Level;
use virtual_board::board::Board;
use virtual_board::host_uart::HostUart;
use virtual_board::machine::{Machine, UartPort};
use virtual_board::transport::BoardTransport;

use crate::lab::{AXES, D5, Lab, RMD, RMD_RS485, SEED, THRUSTER, bus_rs485, wired};
use crate::log;

/// What the log begins with where CAN is off, by board.
fn no_clock() -> &'static str {
    match Board::chosen() {
        Board::NucleoH743zi => "ERROR CAN is off: the ST-LINK gives no clock",
        Board::NucleoG474re => "ERROR CAN is off: the crystal does not swing",
    }
}

const ON_CAN: [u8; 3] = [RMD, THRUSTER, D5];

/// How many buses the board offers, whether the last one, which is RS485, is among them, and why
/// not all.
fn offered(client: &mut Client<BoardTransport>) -> (usize, bool, Option<BusLimit>) {
    let offered: Vec<bool> =
        client.hello().buses.iter().map(|bus| !bus.bitrates.is_empty()).collect();
    let limit = client.gateway_status().expect("a status").bus_limit;
    (offered.iter().filter(|offered| **offered).count(), offered.last() == Some(&true), limit)
}

/// RS485 alone.
const WITHOUT_CAN: (usize, bool, Option<BusLimit>) = (1, true, Some(BusLimit::NoClock));

#[test]
fn without_the_boards_clock_rs485_runs_and_can_is_off() {
    let (board, outside, probes) = wired(SEED);
    let mut lab = Lab::around(board.without_hse().power_on(), outside, probes);
    assert_eq!(offered(&mut lab.client), WITHOUT_CAN);
    let lines = log::take(&mut lab.machine.borrow_mut());
    assert!(lines.iter().any(|line| line.starts_with(no_clock())), "{lines:?}");
    lab.configure_bus(bus_rs485());
    lab.configure_axis(RMD_RS485);
    lab.moving(&[RMD_RS485]);
    let resets = lab.machine.borrow_mut().reports().resets;
    assert!(resets.is_empty(), "{resets:?}");
}

/// The ST-LINK needs its time, too, when both get their power.
#[test]
fn a_clock_that_comes_late_after_the_power_is_waited_for() {
    let mut builder = Machine::builder().without_hse();
    let host = builder.line(UartPort::Host0, HostUart::new());
    let machine = Rc::new(RefCell::new(builder.power_on()));
    machine.borrow_mut().run_for(Duration::from_millis(70));
    machine.borrow_mut().restore_hse();
    let mut client = Client::connect_as(BoardTransport::new(&machine, host), 1, 1).expect("hello");
    let buses = client.hello().buses.len();
    assert_eq!(offered(&mut client), (buses, true, None));
    assert!(machine.borrow_mut().reports().resets.is_empty());
}

#[test]
fn a_clock_that_stops_while_motors_turn_ends_in_stops_or_without_their_power() {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    let before = lab.now();
    lab.machine.borrow_mut().lose_hse();
    let reset = lab.now();
    assert_eq!(
        lab.machine.borrow_mut().probe(Board::chosen().enable).driven(),
        None,
        "the pin's resistor switches off"
    );
    lab.run_for(Duration::from_millis(60));
    let stop = lab.first_stop(RMD_RS485, reset);
    // It waits 20 ms for the clock.
    assert!(stop.first_bit - reset < Duration::from_millis(30), "{:?}", stop.first_bit - reset);
    assert_eq!(lab.machine.borrow_mut().probe(Board::chosen().enable).driven(), Some(Level::Low));
    lab.run_for(Duration::from_millis(300));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.hello().boot, BootReason::Software);
    assert_eq!(offered(&mut lab.client), WITHOUT_CAN);
    assert_eq!(lab.client.crash_report().expect("a text"), "the board's clock has stopped");
    assert_eq!(lab.trip(RMD_RS485), Some((TripReason::Reset, true)));
    lab.assert_stopped_by_gateway(RMD_RS485, before);
    for axis in ON_CAN {
        assert_eq!(lab.report(axis).state, AxisState::Tripped { confirmed: false }, "axis {axis}");
        assert!(lab.report(axis).trip.expect("tripped").unreachable, "axis {axis}");
    }
    // The clock is there again, and the board is started by hand.
    lab.machine.borrow_mut().restore_hse();
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(600));
    lab.client.reconnect().expect("hello");
    for axis in AXES {
        assert_eq!(lab.report(axis).state, AxisState::Tripped { confirmed: true }, "axis {axis}");
    }
    assert_eq!(lab.machine.borrow_mut().probe(Board::chosen().enable).driven(), Some(Level::High));
}
