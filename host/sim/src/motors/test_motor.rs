//! A motor without a bus, for the tests of the models: frames in, frames out, in µs.

use std::time::Duration;

use host_protocol::{CanFrame, Protocol};

use super::{Injection, Motor};
use crate::wiring::MotorWiring;

pub(super) struct TestMotor {
    pub(super) motor: Motor,
    pub(super) now: Duration,
}

impl TestMotor {
    pub(super) fn new(protocol: Protocol, node: u8, serial: bool) -> Self {
        let wiring = MotorWiring { bus: 0, protocol, node, bitrate: 115_200, can_id: None };
        Self { motor: Motor::new(wiring, serial, 1).unwrap(), now: Duration::ZERO }
    }

    /// Lets time pass; what it sent meanwhile, as text.
    pub(super) fn run_ms(&mut self, ms: u64) -> Vec<String> {
        let until = self.now + Duration::from_millis(ms);
        let mut sent = Vec::new();
        while let Some(at) = self.motor.next_event().filter(|at| *at <= until) {
            assert!(at >= self.now, "an event in the past");
            self.now = at;
            self.motor.advance(at);
            sent.extend(
                std::iter::from_fn(|| self.motor.take_ready(at)).map(|out| out.wire.to_string()),
            );
        }
        self.now = until;
        self.motor.advance(until);
        sent
    }

    /// Sends a frame and waits 1 ms; the answers as text.
    pub(super) fn ask(&mut self, id: u16, data: &[u8]) -> Vec<String> {
        self.motor.hear_frame(self.now, &CanFrame::standard(id, data).unwrap());
        self.run_ms(1)
    }

    /// Sends bytes at 115200 baud and waits 1 ms; the answers as text.
    pub(super) fn ask_serial(&mut self, bytes: &[u8]) -> Vec<String> {
        for byte in bytes {
            self.now += Duration::from_nanos(86_806);
            self.motor.hear_byte(self.now, *byte);
        }
        self.run_ms(1)
    }

    pub(super) fn inject(&mut self, injection: Injection) {
        self.motor.inject(self.now, injection);
    }

    pub(super) fn events(&self) -> Vec<String> {
        self.motor.log().entries().map(|entry| entry.what.to_string()).collect()
    }
}
