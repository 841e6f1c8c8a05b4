//! The simulator's four motors on the image.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::Protocol;
use mgw_client::{Client, Hold};
use mgw_sim::{MotorEvent, MotorWiring};

use super::*;
use crate::machine::CanPort;
use crate::transport::BoardTransport;
use crate::usual::{self, REPLY_WINDOW};
use virtual_stm32::fdcan::FrameEnd;

const TTL: Duration = Duration::from_millis(100);
struct Rig {
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    client: Client<BoardTransport>,
}

impl Rig {
    /// The board with these motors, its buses configured at their usual rates.
    fn new(motors: &[MotorWiring]) -> Self {
        let mut builder = Machine::builder();
        let outside = Outside::connect(&mut builder, motors, 1).unwrap();
        let machine = Rc::new(RefCell::new(builder.power_on()));
        let transport = BoardTransport::new(&machine, outside.hosts[0]);
        let mut client = Client::connect_as(transport, 7, 1).unwrap();
        for (bus, bitrate, protocols) in usual::buses() {
            client.configure_bus(bus, bitrate, protocols, false, REPLY_WINDOW).unwrap();
        }
        Self { machine, outside, client }
    }

    fn configure(&mut self, axis: u8) {
        usual::axes()[usize::from(axis)].configure(&mut self.client, axis).unwrap();
    }

    /// Asks the motor of a configured axis for something; whether it answered.
    fn motor_answers(&mut self, axis: u8) -> bool {
        if usual::axes()[usize::from(axis)].has_motor_timeout() {
            self.client.provision_motor_timeout(axis, 1_000).is_ok()
        } else {
            self.client.arm(axis).is_ok()
        }
    }

    fn arm(&mut self, axis: u8) -> Hold {
        self.configure(axis);
        let usual = usual::axes()[usize::from(axis)];
        if usual.has_motor_timeout() {
            assert!(self.motor_answers(axis));
        }
        let setpoint = usual::turning(usual.protocol);
        Hold { axis, epoch: self.client.arm(axis).unwrap().epoch, setpoint, ttl: TTL }
    }

    fn speeds(&self) -> Vec<f64> {
        let mut machine = self.machine.borrow_mut();
        (0..self.outside.motors())
            .map(|at| self.outside.motor(&mut machine, at).speed_rad_s())
            .collect()
    }

    fn commands(&self, motor: usize) -> Vec<String> {
        let mut machine = self.machine.borrow_mut();
        self.outside
            .motor(&mut machine, motor)
            .log()
            .entries()
            .map(|entry| entry.what.to_string())
            .collect()
    }
}

#[test]
fn four_motors_turn_and_stop_when_the_host_falls_silent() {
    let mut rig = Rig::new(&Wiring::four_motors().motors);
    let holds: Vec<Hold> = (0..4).map(|axis| rig.arm(axis)).collect();
    rig.client
        .hold_setpoints(&holds, Duration::from_secs(1), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    let speeds = rig.speeds();
    assert!(speeds.iter().all(|speed| *speed > 1.9), "{speeds:?}");

    rig.machine.borrow_mut().run_for(Duration::from_secs(2));
    assert_eq!(rig.speeds(), [0.0; 4]);
    for motor in 0..4 {
        let mut machine = rig.machine.borrow_mut();
        let log = rig.outside.motor(&mut machine, motor).log();
        let own = log.entries().any(|entry| matches!(entry.what, MotorEvent::Timeout { .. }));
        assert!(!own, "motor {motor} was stopped by the gateway, not by its own timeout");
    }
}

/// From a snapshot in mid-motion on, run in one piece and run with a look every 137 µs: the same
/// accesses of the core, the same frames at the same times, the same shafts to the last bit, as in
/// the original.
#[test]
fn boards_resumed_from_one_snapshot_live_alike_however_they_are_looked_at() {
    let mut rig = Rig::new(&Wiring::four_motors().motors);
    let holds: Vec<Hold> = (0..4).map(|axis| rig.arm(axis)).collect();
    rig.client
        .hold_setpoints(&holds, Duration::from_millis(200), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    let life = |machine: &mut Machine, outside: &Outside, piece: Duration| {
        const SPAN: Duration = Duration::from_millis(600);
        let end = machine.now() + SPAN;
        while machine.now() + piece < end {
            machine.run_for(piece);
        }
        machine.run_to(crate::nodes::instant(end));
        let motors: Vec<_> = (0..outside.motors())
            .map(|at| {
                let motor = outside.motor(machine, at);
                let log: Vec<_> = motor.log().entries().copied().collect();
                (motor.position_rad().to_bits(), motor.current_a().to_bits(), log)
            })
            .collect();
        let frames = [CanPort::Bus0, CanPort::Bus1].map(|port| machine.can(port).log().to_vec());
        let line = machine.line(outside.rs485).sent().to_vec();
        let host = machine.line(outside.hosts[0]).take_timed();
        (motors, frames, line, host, machine.access_digest(), machine.instructions())
    };
    let snapshot = rig.machine.borrow_mut().snapshot();
    let whole = Duration::from_secs(1);
    let original = life(&mut rig.machine.borrow_mut(), &rig.outside, whole);
    assert!(original.0.iter().all(|(_, _, log)| log.len() > 2), "all of them were stopped");
    for piece in [whole, Duration::from_micros(137)] {
        let mut builder = Machine::builder();
        let outside = Outside::four_motors(&mut builder, 1);
        assert!(life(&mut builder.resume(&snapshot), &outside, piece) == original, "{piece:?}");
    }
}

#[test]
fn injections_reach_motors_on_every_bus() {
    let mut rig = Rig::new(&Wiring::four_motors().motors);
    for (axis, motor) in (0..4).zip(0..) {
        rig.configure(axis);
        rig.outside.inject(&mut rig.machine.borrow_mut(), motor, Injection::Mute(true));
        assert!(!rig.motor_answers(axis), "axis {axis}");
        rig.outside.inject(&mut rig.machine.borrow_mut(), motor, Injection::Mute(false));
        rig.outside.power_cycle(&mut rig.machine.borrow_mut(), motor);
        assert!(rig.motor_answers(axis), "axis {axis}");
        rig.outside.inject(&mut rig.machine.borrow_mut(), motor, Injection::FaultBits(0x0004));
        let faults = rig.outside.motor(&mut rig.machine.borrow_mut(), motor).fault_word();
        assert_eq!(faults & 0x0004, 0x0004);
    }
}

#[test]
fn a_motor_that_is_unplugged_and_alone_leaves_the_bus_without_acknowledgement() {
    let mut rig = Rig::new(&Wiring::four_motors().motors[2..3]);
    rig.configure(2);
    rig.outside.inject(&mut rig.machine.borrow_mut(), 0, Injection::Unplugged(true));
    assert!(!rig.motor_answers(2));
    assert_eq!(rig.commands(0), [""; 0]);
    let status = rig.client.bus_status(1).unwrap();
    assert_eq!(status.state, host_protocol::BusState::Passive);
}

/// Half the rate of the bus: it destroys the gateway's frames until it is error passive, and
/// acknowledges none.
#[test]
fn a_motor_at_another_rate_answers_nothing_and_breaks_frames() {
    let motor = MotorWiring { bitrate: 500_000, ..Wiring::four_motors().motors[0] };
    let mut rig = Rig::new(&[motor]);
    rig.configure(0);
    assert!(!rig.motor_answers(0));
    assert_eq!(rig.commands(0), [""; 0]);
    let status = rig.client.bus_status(0).unwrap();
    assert_ne!(status.state, host_protocol::BusState::Active, "{status:?}");
    let log = rig.machine.borrow_mut().can_mut(CanPort::Bus0).take_log();
    let ended = |outcome| log.iter().filter(|frame| frame.outcome == outcome).count();
    assert!(ended(FrameEnd::Destroyed) > 0, "{log:?}");
    assert_eq!(ended(FrameEnd::Acknowledged), 0, "{log:?}");
}

#[test]
fn a_wiring_that_cannot_be_is_refused() {
    let mut builder = Machine::builder();
    let motor = usual::rmd(3, 1, 1_000_000);
    let refused = Outside::connect(&mut builder, &[motor], 1).err();
    assert_eq!(refused, Some(WiringError::Bus { bus: 3, buses: 3 }));
    let motor = MotorWiring { protocol: Protocol::Thruster, ..usual::rmd(2, 11, 115_200) };
    let refused = Outside::connect(&mut builder, &[motor], 1).err();
    assert_eq!(refused, Some(WiringError::NotOnSerial { protocol: Protocol::Thruster }));
}
