//! The part starts again in mid-motion, for every reason there is: the stops leave before a host
//! hears anything, the reason is told, and what moved is tripped (GUARANTEES G6, G8).

use std::time::Duration;

use host_protocol::requests::Ping;
use host_protocol::{AxisState, BootReason, Call, Incident, Kind, MAX_FRAME, TripReason, encode};
use mgw_sim::Motor;
use virtual_board::board::Board;
use virtual_board::machine::{Fault, Place};
use virtual_board::nodes::since_start;

use crate::lab::{AXES, Lab, RMD, bus_of, bus_rs485, turning};
use crate::part::part_of;
use crate::reaction::Reaction;

/// From a hang to the first stop (GUARANTEES G6), and so from anything that is over sooner.
pub const HANG: Duration = Duration::from_millis(150);
/// Until whoever will be planted with a fault has the processor next.
const STRIKES: Duration = Duration::from_millis(200);
/// For every motor to come to rest and confirm it.
const AFTERWARDS: Duration = Duration::from_millis(1_500);

/// What starts the part again.
#[derive(Debug, Clone, Copy)]
enum Cause<'a> {
    /// The reset pin.
    Pin,
    /// A fault at a place: what the firmware then says of it begins like that.
    Planted(Place<'a>, &'a Fault, &'a str),
}

/// A task of the firmware.
const fn task(path: &str, index: usize) -> Place<'_> {
    Place::Task(path, index)
}

/// All four motors turn; a host asks all the while. Then that, and everything that must follow.
fn restarts(name: &str, cause: Cause<'_>, boot: BootReason) -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    let before = lab.now();
    let (at, words) = match cause {
        Cause::Pin => {
            lab.machine.borrow_mut().reset_by_pin();
            (lab.now(), "")
        }
        Cause::Planted(place, fault, words) => {
            let mut machine = lab.machine.borrow_mut();
            machine.plant(place, fault);
            // What serves a host has something to do at once.
            for host in lab.outside.hosts {
                machine.line(host).send(&ping());
            }
            let strikes = machine.run_until(STRIKES, |machine| machine.struck().is_some());
            assert!(strikes, "{place:?} never has the processor");
            if matches!(place, Place::Function(_)) {
                machine.run_until(HANG, |machine| !machine.reports().resets.is_empty());
                machine.heal();
            }
            (machine.struck().expect("it struck"), words)
        }
    };
    ask_all_the_while(&lab);
    let reset = lab.machine.borrow_mut().reports().resets.last().map(|reset| since_start(reset.at));
    let reset = reset.unwrap_or_else(|| panic!("{name}: the part was not started again"));
    let first_answer = first_byte_to_a_host(&lab, reset);
    let reactions: Vec<Reaction> = AXES
        .into_iter()
        .map(|axis| {
            let stop = lab.first_stop(axis, at);
            assert!(stop.first_bit > reset, "axis {axis}: the new run stops it");
            assert!(
                stop.first_bit < first_answer,
                "axis {axis}: stopped at {stop:?}, host at {first_answer:?}"
            );
            Reaction::new(name, axis, at, &stop, HANG)
        })
        .collect();
    lab.run_for(AFTERWARDS);
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.hello().boot, boot, "{name}");
    let told = lab.client.crash_report().expect("a text");
    assert!(told.starts_with(words) && told.is_empty() == words.is_empty(), "{name}: {told:?}");
    assert_eq!(lab.client.hello().has_crash_report, !words.is_empty());
    for axis in AXES {
        lab.assert_stopped_by_gateway(axis, before);
        assert_eq!(lab.trip(axis), Some((TripReason::Reset, true)), "{name}, axis {axis}");
    }
    assert_remembered(&mut lab, boot, !words.is_empty());
    assert_resets_are(&lab, 1);
    reactions
}

/// Until well behind the restart and its stops.
fn ask_all_the_while(lab: &Lab) {
    let mut machine = lab.machine.borrow_mut();
    for _ in 0..300 {
        machine.line(lab.outside.hosts[1]).send(&ping());
        machine.run_for(Duration::from_millis(1));
    }
}

/// A request that nobody in the lab has made.
fn ping() -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let length =
        encode(Kind::Request, 0x7000, Ping::NUMBER, &Ping {}, &mut frame).expect("it fits");
    frame[..length].to_vec()
}

/// When the first byte after an instant had arrived at a host.
fn first_byte_to_a_host(lab: &Lab, since: Duration) -> Duration {
    let mut machine = lab.machine.borrow_mut();
    let firsts = lab.outside.hosts.map(|host| {
        let received = machine.line(host).take_timed();
        received.iter().map(|received| received.at).find(|at| *at > since)
    });
    firsts.into_iter().flatten().min().expect("the host that asks is answered at last")
}

/// The history has the trips of all axes, behind this start and the first one.
fn assert_remembered(lab: &mut Lab, boot: BootReason, words: bool) {
    let incidents = lab.client.incidents().expect("the history");
    let started = Incident::Started { start: 2, boot, has_crash_report: words };
    assert!(incidents.contains(&started), "{incidents:?}");
    for axis in AXES {
        let of_axis = |incident: &&Incident| {
            matches!(incident, Incident::Tripped { start: 2, axis: tripped, trip }
                if *tripped == axis && trip.reason == TripReason::Reset)
        };
        assert_eq!(incidents.iter().filter(of_axis).count(), 1, "axis {axis}: {incidents:?}");
    }
}

fn assert_resets_are(lab: &Lab, expected: usize) {
    let resets = lab.machine.borrow_mut().reports().resets;
    assert_eq!(resets.len(), expected, "{resets:?}");
}

pub fn the_reset_pin_in_mid_motion_is_followed_by_stops() -> Vec<Reaction> {
    restarts("reset by pin", Cause::Pin, BootReason::Pin)
}

/// Where a reset by software is planted: a task that is no hurry to anybody.
pub const RESET_AT: Place<'static> = task("motor_gateway::tasks::light::light", 0);

/// The firmware writes SYSRESETREQ to AIRCR itself (ARMv7-M, B3.2.6), without a word.
pub fn reset_by_software() -> Fault {
    // LDR r0, LDR r1, STR r1, [r0]; B .; the words 0xE000ED0C and 0x05FA0004.
    Fault::Code(vec![0x4801, 0x4902, 0x6001, 0xE7FE, 0xED0C, 0xE000, 0x0004, 0x05FA])
}

pub fn a_reset_by_software_in_mid_motion_is_followed_by_stops() -> Vec<Reaction> {
    let cause = Cause::Planted(RESET_AT, &reset_by_software(), "");
    restarts("reset by software", cause, BootReason::Software)
}

/// Each kind of task.
pub fn a_hang_of_any_task_is_followed_by_stops() -> Vec<Reaction> {
    let rs485 = format!("no check-in from bus {}", bus_rs485());
    let hangs = [
        ("a CAN task", "can::can", 0, "no check-in from CAN buses"),
        ("the RS485 task", "rs485::rs485", 0, &rs485),
        ("a host's receiver", "host::receive", 0, "no check-in from host link 0"),
        ("a host's sender", "host::send", 1, "no check-in from host link 1"),
        ("the history task", "history::history", 0, "no check-in from history"),
        ("the e-stop task", "safety::e_stop", 0, "no check-in from e-stop input"),
        ("the USB task", "usb::usb", 0, "no check-in from USB"),
        ("the light's task", "light::light", 0, "no check-in from light"),
        ("the supervisor", "supervisor::supervisor", 0, ""),
    ];
    let hang = |(name, path, index, words)| {
        let (name, path) = (format!("hang of {name}"), format!("motor_gateway::tasks::{path}"));
        let words = format!("watchdog: {words}");
        let cause = Cause::Planted(task(&path, index), &Fault::Hang, &words);
        restarts(&name, cause, BootReason::Watchdog)
    };
    part_of(hangs).flat_map(hang).collect()
}

/// The core itself hangs, in the middle of an event: the executor never has the processor again.
pub fn a_hang_of_the_core_is_followed_by_stops() -> Vec<Reaction> {
    let place = Place::Function("gateway::gateway::Gateway::handle");
    restarts(
        "hang of the core",
        Cause::Planted(place, &Fault::Hang, "watchdog: "),
        BootReason::Watchdog,
    )
}

pub fn a_panic_in_a_task_is_followed_by_stops() -> Vec<Reaction> {
    let words = "panic at planted.rs:11: index out of bounds: the len is 3 but the index is 7";
    let panics = [
        ("panic in a CAN task", task("motor_gateway::tasks::can::can", 0)),
        ("panic in the history task", task("motor_gateway::tasks::history::history", 0)),
        ("panic in a host's receiver", task("motor_gateway::tasks::host::receive", 0)),
        ("panic in the core", Place::Function("gateway::gateway::Gateway::handle")),
    ];
    let panic = |(name, place)| {
        restarts(name, Cause::Planted(place, &Fault::Panic, words), BootReason::Software)
    };
    part_of(panics).flat_map(panic).collect()
}

pub fn a_hard_fault_is_followed_by_stops() -> Vec<Reaction> {
    let words = format!("hard fault at {:#010x}", Board::chosen().free_flash);
    let faults = [
        ("hard fault in a task", task("motor_gateway::tasks::rs485::rs485", 0)),
        ("hard fault in the core", Place::Function("gateway::gateway::Gateway::handle")),
    ];
    let fault = |(name, place)| {
        restarts(name, Cause::Planted(place, &Fault::HardFault, &words), BootReason::Software)
    };
    faults.into_iter().flat_map(fault).collect()
}

/// A recursion without end, and a stack pointer at its end when something else faults.
pub fn a_stack_that_is_full_faults_and_is_followed_by_stops() -> Vec<Reaction> {
    // `NOP`; `PUSH {r0-r7, lr}`, `B` to it.
    let recursion = Fault::Code(vec![0xBF00, 0xB5FF, 0xE7FD]);
    // `LDR r0`, `MOV sp, r0`, `UDF`; the word 0x2000_0080 or 0x1000_0080: the frame of the fault
    // has no room.
    let stack = match Board::chosen() {
        Board::NucleoH743zi => 0x2000,
        Board::NucleoG474re => 0x1000,
    };
    let end = Fault::Code(vec![0x4801, 0x4685, 0xDE00, 0xBF00, 0x0080, stack]);
    let words = "the stack is full: hard fault, forbidden memory on entry to an exception";
    let faults = [
        ("recursion without end", &recursion, "the stack is full: hard fault"),
        ("fault on a full stack", &end, words),
    ];
    let task = task("motor_gateway::tasks::light::light", 0);
    let fault = |(name, fault, words)| {
        restarts(name, Cause::Planted(task, fault, words), BootReason::Software)
    };
    faults.into_iter().flat_map(fault).collect()
}

/// The board loses its supply and the motors do not: nothing is configured any more, so nobody says
/// a word to them, and that is told. Each stops when its own timeout strikes.
pub fn a_power_cycle_leaves_nothing_configured_and_says_so() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    let at = lab.now();
    lab.machine.borrow_mut().power_cycle(Duration::from_millis(50));
    lab.run_for(Duration::from_millis(450));
    AXES.iter().for_each(|axis| lab.assert_turning(*axis));
    lab.run_for(Duration::from_secs(2));
    for axis in AXES {
        lab.assert_standing(axis);
        let said: Vec<_> = lab
            .wire(bus_of(axis), at + Duration::from_millis(1))
            .into_iter()
            .filter(|one| one.by_gateway)
            .collect();
        assert_eq!(said, [], "the gateway said nothing");
    }
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.hello().boot, BootReason::PowerOn);
    assert_eq!(
        lab.client.list_axes().expect("a list"),
        [],
        "nothing is configured, nothing is armed"
    );
    assert_eq!(lab.client.crash_report().expect("a text"), "");
    let history = lab.client.incidents().expect("the history");
    assert_eq!(
        history,
        [Incident::Started { start: 1, boot: BootReason::PowerOn, has_crash_report: false }]
    );
    Vec::new()
}

/// Cleared and armed anew it moves, with the configuration of before.
pub fn after_a_reset_an_axis_is_cleared_and_moves_again() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(AFTERWARDS);
    lab.client.reconnect().expect("hello");
    let list = lab.client.list_axes().expect("a list");
    assert_eq!(list.len(), AXES.len());
    assert!(
        list.iter().all(|axis| axis.state == AxisState::Tripped { confirmed: true }),
        "{list:?}"
    );
    lab.client.clear(host_protocol::ClearTarget::Axis(RMD)).expect("cleared");
    // It keeps its own timeout in its ROM, so that nobody has to tell it again.
    let holds = lab.arm(&[RMD]);
    assert_eq!(holds[0].setpoint, turning(RMD));
    lab.keep(&holds, Duration::from_millis(300));
    lab.assert_turning(RMD);
    assert!(lab.motor(1, Motor::speed_rad_s).abs() < 0.1, "the others stand");
    Vec::new()
}
