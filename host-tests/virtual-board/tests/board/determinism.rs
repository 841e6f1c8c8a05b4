//! Two runs with the same seed and the same orders are the same run.

use std::time::Duration;

use mgw_sim::LogEntry;
use virtual_board::host_uart::Received;
use virtual_board::machine::CanPort;
use virtual_board::rs485_line::SentByte;
use virtual_stm32::fdcan::{FrameRecord, Wiring};

use crate::lab::{AXES, BUS_RMD_AND_THRUSTER, Lab, SEED, trips};

/// Everything that came out of a run, with its virtual times.
#[derive(Debug, PartialEq)]
struct Record {
    can: [Vec<FrameRecord>; 2],
    rs485: Vec<SentByte>,
    host_1: Vec<Received>,
    motors: Vec<Vec<LogEntry>>,
    log: Vec<u8>,
    accesses: u64,
    instructions: u64,
    now: Duration,
}

/// From power-on through motion, a fault and a stop.
fn life(seed: u64) -> Record {
    let mut lab = Lab::power_on(seed);
    lab.configure();
    let holds = lab.moving(&AXES);
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
    lab.keep(&holds, Duration::from_millis(30));
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Connected);
    let host = lab.outside.hosts[1];
    lab.machine.borrow_mut().line(host).send(b"\0noise\0");
    lab.stay(Duration::from_millis(300));
    assert_eq!(trips(&lab.events()).len(), AXES.len(), "the fault struck");
    let motors =
        AXES.map(|axis| lab.motor(axis, |motor| motor.log().entries().copied().collect())).to_vec();
    let mut machine = lab.machine.borrow_mut();
    Record {
        can: [CanPort::Bus0, CanPort::Bus1].map(|port| machine.can(port).log().to_vec()),
        rs485: machine.line(lab.outside.rs485).sent().to_vec(),
        host_1: machine.line(host).take_timed(),
        motors,
        log: machine.take_rtt(),
        accesses: machine.access_digest(),
        instructions: machine.instructions(),
        now: machine.now(),
    }
}

#[test]
fn two_runs_with_one_seed_are_equal_and_another_seed_makes_another_run() {
    let first = life(SEED);
    let sizes = (first.can[0].len(), first.can[1].len(), first.rs485.len());
    assert!(sizes.0 > 100 && sizes.1 > 100 && sizes.2 > 500, "{sizes:?}");
    assert!(first == life(SEED), "the same seed");
    let other = life(SEED + 1);
    let frames = |record: &Record| record.can[usize::from(BUS_RMD_AND_THRUSTER)].clone();
    assert!(frames(&first) != frames(&other), "another seed: other reply times");
    assert!(first.accesses != other.accesses);
}
