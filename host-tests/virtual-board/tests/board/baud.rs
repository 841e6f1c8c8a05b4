//! The rate of a host link on a UART (PROTOCOL.md, the rate of a UART): the image's own divider
//! against an adapter that hears nothing at another rate.

use std::time::Duration;

use host_protocol::requests::SetBaud;
use host_protocol::{DEFAULT_BAUD, Error, MAX_BITRATES, StopTarget, TripReason};
use mgw_client::{Client, StopRequest, Transport, stop_before_hello};
use virtual_board::machine::UartPort;

use crate::lab::{AXES, Lab, RMD, refused};

const BAUDS: [u32; 5] = [921_600, 1_000_000, 1_500_000, 2_000_000, 3_000_000];
/// After this silence the board is back.
const SILENCE: Duration = Duration::from_secs(5);

fn real(lab: &Lab) -> u64 {
    lab.machine.borrow_mut().line(lab.outside.hosts[0]).settings().bits_per_second()
}

/// What the board runs at, beside its clock's divider.
#[track_caller]
fn assert_runs_at(lab: &Lab, baud: u32) {
    let real = real(lab);
    assert!(real.abs_diff(baud.into()) * 100 < u64::from(baud) * 2, "{real}, not {baud}");
}

#[test]
fn every_rate_that_is_offered_carries_setpoints() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    for baud in BAUDS.into_iter().rev().chain(BAUDS) {
        lab.client.set_baud(baud).unwrap_or_else(|error| panic!("{baud}: {error}"));
        assert_eq!(lab.client.baud(), baud);
        assert_runs_at(&lab, baud);
        lab.keep(&holds, Duration::from_millis(40));
        AXES.iter().for_each(|axis| lab.assert_turning(*axis));
    }
    let mut offered = [0; MAX_BITRATES];
    offered[..BAUDS.len()].copy_from_slice(&BAUDS);
    let error = refused(lab.client.set_baud(115_200));
    assert_eq!(error, Error::BaudNotOffered { baud: 115_200, offered });
    lab.client.stop(StopTarget::All).expect("stopped");
}

/// A host that has lost the rate stops by what it repeats at the default: the board changes back at
/// the third frame that it cannot read.
#[test]
fn a_stop_reaches_a_board_that_runs_at_another_rate() {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    lab.client.set_baud(2_000_000).expect("changed");
    let at = lab.now();
    let host = lab.outside.hosts[0];
    lab.machine.borrow_mut().line(host).set_baud(DEFAULT_BAUD);
    let mut transport = lab.client.transport().clone();
    let stopped = stop_before_hello(&mut transport, StopRequest::Stop(StopTarget::All));
    stopped.expect("stopped");
    assert_runs_at(&lab, DEFAULT_BAUD);
    let took = lab.now() - at;
    assert!(took < Duration::from_millis(200), "{took:?}");
    lab.first_stop(RMD, at);
}

/// Its reply is lost: the board has changed, the host has not, and both are back at the default.
#[test]
fn a_lost_reply_leads_back_to_the_default() {
    let mut lab = Lab::configured();
    lab.moving(&[RMD]);
    let at = lab.now();
    lab.machine.borrow_mut().silence_line(UartPort::Host0, true);
    let lost = lab.client.set_baud(3_000_000);
    assert!(lost.is_err());
    lab.machine.borrow_mut().silence_line(UartPort::Host0, false);
    assert_eq!(lab.client.baud(), DEFAULT_BAUD);
    lab.client.reconnect().expect("hello");
    assert_runs_at(&lab, DEFAULT_BAUD);
    // Meanwhile its setpoint had expired.
    lab.assert_stopped_by_gateway(RMD, at);
    assert_eq!(lab.trip(RMD), Some((TripReason::SetpointExpired, true)));
}

#[test]
fn silence_and_a_reset_lead_back_to_the_default() {
    let mut lab = Lab::configured();
    lab.client.set_baud(1_500_000).expect("changed");
    lab.run_for(SILENCE - Duration::from_millis(200));
    assert_runs_at(&lab, 1_500_000);
    lab.run_for(Duration::from_millis(400));
    assert_runs_at(&lab, DEFAULT_BAUD);
    lab.client.reconnect().expect("hello");
    lab.client.set_baud(3_000_000).expect("changed");
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(100));
    assert_runs_at(&lab, DEFAULT_BAUD);
    lab.client.reconnect().expect("hello");
    lab.report(RMD);
}

/// The adapter cannot keep up: it hears nothing at the new rate, and the host says so.
#[test]
fn a_rate_that_the_adapter_does_not_bear_fails_and_leaves_the_link_whole() {
    /// Says that it changes, and does not.
    #[derive(Clone)]
    struct Stubborn<T>(T);
    impl<T: Transport> Transport for Stubborn<T> {
        fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
            self.0.send(bytes)
        }
        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
            self.0.receive(buffer, timeout)
        }
        fn now(&self) -> Duration {
            self.0.now()
        }
        fn sleep(&mut self, duration: Duration) {
            self.0.sleep(duration);
        }
        fn reconnect(&mut self) -> std::io::Result<()> {
            self.0.reconnect()
        }
        fn set_baud(&mut self, _: u32) -> std::io::Result<()> {
            Ok(())
        }
    }
    let mut lab = Lab::configured();
    let transport = Stubborn(lab.client.transport().clone());
    let mut stubborn = Client::connect_as(transport, 7, 1).expect("hello");
    let failed = stubborn.set_baud(2_000_000);
    assert!(failed.is_err(), "{failed:?}");
    lab.run_for(SILENCE + Duration::from_millis(100));
    stubborn.ping().expect("the link is whole");
    lab.client.reconnect().expect("hello");
    assert_runs_at(&lab, DEFAULT_BAUD);
    let asked = lab.client.request(&SetBaud { baud: DEFAULT_BAUD });
    asked.expect("the rate that it has");
}
