//! What an emulated chip hides unless it is asked for: starts by the ROM, rings that lock, frames
//! without a pause, faults at every start.

use std::time::Duration;

use host_protocol::{AxisParameter, BusState, Bytes, TripReason, Value};
use rigless::device::Level;
use rigless::mcu::Operate;
use rigless::soc::Width;
use virtual_board::board::Board;
use virtual_board::machine::{CanPort, Fault, Machine, Place};
use virtual_board::nodes::instant;
use virtual_board::usual;
use virtual_stm32::fdcan::Wiring;

use crate::bench::{Bench, data_frame};
use crate::lab::{AXES, BUS_RMD_AND_THRUSTER, D5, Lab, RMD, RMD_RS485, THRUSTER, trips};

/// More than the start takes, USB included.
pub const START: Duration = Duration::from_millis(60);
/// What the clock counts, at a microsecond each.
const HALF_OF_THE_TIMER: Duration = Duration::from_micros(1 << 15);

#[test]
fn a_start_by_the_rom_bootloader_runs_with_its_own_vector_table() {
    let bench = Bench::of(Machine::builder().started_by_rom());
    bench.machine.borrow_mut().run_for(START);
    let resets = bench.machine.borrow_mut().reports().resets;
    assert!(resets.is_empty(), "{resets:?}");
}

#[test]
fn a_start_counts_no_half_of_the_timer_that_has_not_passed() {
    let mut machine = Machine::builder().power_on();
    machine.run_for(START);
    // In both halves of the timer's range.
    for half in 1..=4 {
        assert_eq!(machine.clock_agrees(), (half, true));
        machine.run_for(HALF_OF_THE_TIMER);
    }
}

/// The control registers of DMA1 that take what host link 1 and the RS485 line hear: streams 2 and
/// 4 of the STM32H743, channels 3 and 5 of the STM32G474. Bit 0 enables each.
fn host_1_stream() -> u64 {
    match Board::chosen() {
        Board::NucleoH743zi => 0x4002_0040,
        Board::NucleoG474re => 0x4002_0030,
    }
}

fn rs485_stream() -> u64 {
    match Board::chosen() {
        Board::NucleoH743zi => 0x4002_0070,
        Board::NucleoG474re => 0x4002_0058,
    }
}

/// Whether a DMA stream is enabled.
fn runs(machine: &mut Machine, stream: u64) -> bool {
    let at = instant(machine.now());
    machine.part_mut().read(at, stream, Width::W32).expect("a register") & 1 == 1
}

/// Has a DMA stream take nothing any more, as one of revision Y can lock (ES0392, "DMA stream
/// locked…").
fn lock(machine: &mut Machine, stream: u64) {
    let at = instant(machine.now());
    let part = machine.part_mut();
    let control = part.read(at, stream, Width::W32).expect("a register");
    assert_eq!(control & 1, 1, "it runs");
    part.write(at, stream, Width::W32, control & !1).expect("a register");
}

/// Asks the motor on RS485 for its speed.
fn ask_motor(lab: &mut Lab) -> bool {
    let read: Bytes<8> = [0x9C, 0, 0, 0, 0, 0, 0, 0].into_iter().collect();
    lab.client.native(RMD_RS485, 0, read, Duration::from_millis(100)).is_ok()
}

#[test]
fn a_receive_ring_of_a_host_link_that_locks_starts_again() {
    let mut lab = Lab::configured();
    let mut second = lab.second_client();
    lock(&mut lab.machine.borrow_mut(), host_1_stream());
    let host = lab.outside.hosts[1];
    // More than the receiver's FIFO holds.
    lab.machine.borrow_mut().line(host).send(&[1; 40]);
    lab.run_for(Duration::from_millis(50));
    second.gateway_status().expect("heard again");
    assert!(runs(&mut lab.machine.borrow_mut(), host_1_stream()));
    assert_eq!(lab.report(RMD).trip, None);
}

#[test]
fn a_receive_ring_of_rs485_that_locks_starts_again() {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("free");
    assert!(ask_motor(&mut lab));
    lock(&mut lab.machine.borrow_mut(), rs485_stream());
    // The frame that is not heard back is sent again, and by then the ring is a new one.
    let answered = (0..3).filter(|_| ask_motor(&mut lab)).count();
    assert!(answered >= 2, "{answered} of 3");
    assert!(runs(&mut lab.machine.borrow_mut(), rs485_stream()));
}

#[test]
fn frames_that_come_back_to_back_are_all_taken() {
    // An interrupt takes longer than a frame: it must take what came meanwhile.
    let builder = Machine::builder().instructions_per_second(10_000_000);
    let mut bench = Bench::of(builder).opened();
    for burst in 0..10u8 {
        // As many as its FIFO holds.
        bench.offer((0..3).map(|number| data_frame(0x241, &[burst, number])));
        bench.run_for(Duration::from_millis(20));
    }
    let counters = bench.status().counters;
    assert_eq!((counters.received, counters.receive_overflows), (30, 0));
}

/// Behind bus-off a controller joins again when the line has been recessive for 129 times 11 bits,
/// whether the block was reset with it or not, as while the other bus runs: the pause before the
/// restart is longer at every bitrate.
#[test]
fn a_bus_that_was_off_stays_away_for_129_times_11_bits_whatever_the_other_does() {
    for other_runs in [false, true] {
        let mut bench = Bench::of(Machine::builder());
        let slow = 50_000;
        usual::start_rmd_bus(&mut bench.client, 0, slow).expect("bus 0 runs");
        if other_runs {
            bench.configure(1).expect("bus 1 runs");
        }
        bench.client.raw_open_unsafe(0).expect("open");
        bench.wire(Wiring::Shorted);
        bench.send(0, 0x141, &[1]);
        bench.run_until_on_bus(false, Duration::from_millis(500));
        bench.wire(Wiring::Connected);
        let at = bench.machine.borrow().now();
        bench.run_until_on_bus(true, Duration::from_millis(500));
        let away = bench.machine.borrow().now() - at;
        assert!(away >= Duration::from_secs_f64(129.0 * 11.0 / f64::from(slow)), "{away:?}");
    }
}

/// A controller whose sender could not reach the message RAM in time sends nothing until ASM is
/// cleared. While another one runs, the start of this one resets no block.
#[test]
fn a_controller_in_restricted_operation_is_back_after_the_pause_and_sends_its_stop() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    lab.events();
    let at = lab.now();
    lab.machine.borrow_mut().can_mut(CanPort::Bus0).fail_message_ram();
    lab.keep(&holds, Duration::from_secs(1));
    assert_eq!(trips(&lab.events()), [RMD, THRUSTER].map(|axis| (axis, TripReason::BusOff)));
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    assert_eq!((status.state, status.counters.bus_offs), (BusState::Active, 1));
    for axis in [RMD, THRUSTER] {
        assert_eq!(lab.trip(axis), Some((TripReason::BusOff, true)), "axis {axis}");
        lab.assert_stopped_by_gateway(axis, at);
    }
    lab.assert_turning(D5);
}

/// What looks at the configuration of an axis: at a start only where there is one.
const TAKES_CONFIGURATION: &str = concat!(
    "gateway::gateway::requests::config::",
    "_$LT$impl$u20$gateway..gateway..Gateway$GT$::check_axis",
);
/// Starts that fail before one goes without configuration.
const FAILED_STARTS: usize = 5;

#[test]
fn a_fault_that_comes_back_at_each_start_ends_in_a_run_without_configuration() {
    let mut lab = Lab::configured();
    {
        let mut machine = lab.machine.borrow_mut();
        machine.plant(Place::Function(TAKES_CONFIGURATION), &Fault::HardFault);
        machine.reset_by_pin();
        machine.run_for(Duration::from_millis(500));
        assert_eq!(machine.reports().resets.len(), 1 + FAILED_STARTS);
        assert_eq!(
            machine.enable_output().driven(),
            Some(Level::Low),
            "whoever may turn is not known"
        );
    }
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.list_axes().expect("a list"), []);
    let words = lab.client.crash_report().expect("a text");
    assert!(
        words.starts_with(
            "started without configuration, as start after start has failed: hard fault at"
        ),
        "{words}"
    );
    // A crash of this run, however late, is no way out: nobody would know any more than before.
    lab.run_for(Duration::from_secs(11));
    lab.client.take_authority().expect("authority");
    // Asked again by the client, it crashes once more each time.
    lab.client.configure_axis(0, AxisParameter::Bus, Value::Unsigned(0)).expect_err("a crash");
    {
        let mut machine = lab.machine.borrow_mut();
        machine.run_for(Duration::from_millis(500));
        assert!(machine.reports().resets.len() > 1 + FAILED_STARTS);
        assert_eq!(machine.enable_output().driven(), Some(Level::Low), "as before the crash");
    }
    lab.client.reconnect().expect("hello");
    let words = lab.client.crash_report().expect("a text");
    assert!(words.starts_with("started without configuration"), "{words}");
    // The pin starts the count anew; what was configured is gone.
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(START);
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.crash_report().expect("a text"), "");
    assert_eq!(lab.client.list_axes().expect("a list"), []);
}
