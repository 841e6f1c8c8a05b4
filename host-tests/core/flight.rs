//! Hosts that read what the flight recorder has kept: the port answers, the core passes it on.

use crate::bench;
use crate::rig::Rig;
use gateway::{Duration, Event, FlightPage, FlightRead, FlightReadError};
use host_protocol::{
    Bytes, Error, MAX_FRAME, Reply, Request,
    replies::{FlightRecordPage, MAX_FLIGHT_RECORD_BYTES},
    requests,
};

fn read(part: u16, offset: u32) -> Request {
    requests::ReadFlightRecord { part, offset }.into()
}

/// What is kept: two parts of 1000 bytes.
fn page(bytes: &[u8]) -> FlightPage<'_> {
    FlightPage { id: 7, parts: 2, length: 1_000, bytes }
}

/// The port takes what was asked for and answers so.
fn answers(rig: &mut Rig, result: Result<FlightPage<'_>, FlightReadError>) -> FlightRead {
    assert!(rig.gateway.take_changes().flight_read);
    let read = rig.gateway.take_flight_read().expect("something is asked for");
    assert_eq!(rig.gateway.take_flight_read(), None, "once");
    assert!(!rig.gateway.take_changes().flight_read);
    rig.handle(Event::FlightRecord { result });
    read
}

fn outcome(
    rig: &mut Rig,
    request: &Request,
    result: Result<FlightPage<'_>, FlightReadError>,
) -> Result<Reply, Error> {
    let sequence = rig.send(request);
    rig.run(1_000);
    assert_eq!(rig.answer(sequence), None, "not before the port has it");
    answers(rig, result);
    rig.answer(sequence).expect("it is answered")
}

fn told(bytes: &[u8]) -> Result<Reply, Error> {
    let bytes = Bytes::from_slice(bytes).unwrap();
    let page = FlightRecordPage { id: 7, parts: 2, length: 1_000, bytes };
    Ok(Reply::ReadFlightRecord(page))
}

#[test]
fn what_the_port_has_is_the_answer() {
    let mut rig = bench::rmd_axes(1);
    let sequence = rig.send(&read(1, 480));
    assert_eq!(answers(&mut rig, Ok(page(&[1, 2, 3]))), FlightRead { part: 1, offset: 480 });
    assert_eq!(rig.answer(sequence), Some(told(&[1, 2, 3])));
    // More than a message holds is asked for by the next one.
    let many = [5; MAX_FLIGHT_RECORD_BYTES + 1];
    let most = &many[..MAX_FLIGHT_RECORD_BYTES];
    assert_eq!(outcome(&mut rig, &read(0, 0), Ok(page(&many))), told(most));

    let nothing = FlightPage { id: 0, parts: 0, length: 0, bytes: &[] };
    let Ok(Reply::ReadFlightRecord(page)) = outcome(&mut rig, &read(0, 0), Ok(nothing)) else {
        panic!("that nothing is kept is no error")
    };
    assert_eq!((page.parts, page.bytes.len()), (0, 0));
}

#[test]
fn what_cannot_be_read_is_refused() {
    let mut rig = bench::rmd_axes(1);
    let beyond = Error::BeyondFlightRecord { parts: 2, length: 1_000 };
    for (result, error) in [
        (Ok(page(&[])), beyond),
        (Err(FlightReadError::NoRecorder), Error::NoFlightRecorder {}),
        (Err(FlightReadError::Recording), Error::FlightRecording {}),
    ] {
        assert_eq!(outcome(&mut rig, &read(2, 0), result), Err(error));
    }
}

#[test]
fn another_host_waits_for_its_turn_and_needs_no_authority() {
    let mut rig = bench::rmd_axes(1);
    let sequence = rig.send(&read(0, 0));
    let refused = Err(Error::FlightRecorderBusy {});
    assert_eq!(rig.ask_as(1, &read(0, 0)), refused, "before the port has taken it");
    assert!(rig.gateway.take_flight_read().is_some());
    assert_eq!(rig.ask_as(1, &read(0, 0)), refused, "and while it reads");
    assert_eq!(rig.ask(read(1, 0)), refused, "the same host, too");
    rig.handle(Event::FlightRecord { result: Ok(page(&[1])) });
    assert_eq!(rig.answer(sequence), Some(told(&[1])));

    // Host 0 is in command, and host 1 may read.
    let mut out = [0; MAX_FRAME];
    let length = read(0, 9).encode_frame(900, &mut out).unwrap();
    rig.handle(Event::HostBytes { link: 1, bytes: &out[..length] });
    assert_eq!(answers(&mut rig, Ok(page(&[1]))), FlightRead { part: 0, offset: 9 });
}

#[test]
fn a_port_that_does_not_answer_is_given_up_after_1_s() {
    let mut rig = bench::rmd_axes(1);
    for takes in [false, true] {
        let sequence = rig.send(&read(0, 0));
        assert!(!takes || rig.gateway.take_flight_read().is_some());
        rig.run(999_999);
        assert_eq!(rig.answer(sequence), None);
        rig.run(1);
        assert_eq!(rig.answer(sequence), Some(Err(Error::FlightRecorderBusy {})));
        assert!(!rig.gateway.take_changes().flight_read, "nobody waits for it any more");
    }
    // It answers late, and that is the answer to no other request: the next one may ask.
    rig.handle(Event::FlightRecord { result: Ok(page(&[1])) });
    let sequence = rig.send(&read(0, 0));
    rig.handle(Event::FlightRecord { result: Ok(page(&[1])) });
    assert_eq!(rig.answer(sequence), None);
    answers(&mut rig, Ok(page(&[2])));
    assert_eq!(rig.answer(sequence), Some(told(&[2])));
}

#[test]
fn the_time_of_a_reading_is_a_deadline_of_the_core() {
    let mut rig = bench::rmd_axes(1);
    rig.run(100_000);
    let asked = rig.now();
    rig.send(&read(0, 0));
    let ends = asked + Duration::from_millis(1_000);
    assert!(rig.gateway.next_deadline().is_some_and(|deadline| deadline <= ends));
    rig.run_without_ticks(1_000_000);
    assert!(rig.gateway.take_changes().flight_read);
    rig.handle(Event::Tick);
    assert!(!rig.gateway.take_changes().flight_read);
}

#[test]
fn a_request_that_comes_again_is_read_once() {
    let mut rig = bench::rmd_axes(1);
    let mut out = [0; MAX_FRAME];
    let length = read(0, 0).encode_frame(900, &mut out).unwrap();
    let frame = &out[..length];
    rig.bytes(frame);
    rig.bytes(frame);
    answers(&mut rig, Ok(page(&[1])));
    rig.said.clear();
    rig.bytes(frame);
    assert!(!rig.gateway.take_changes().flight_read);
    assert_eq!(rig.answer(900), Some(told(&[1])));
}

#[test]
fn a_new_session_is_told_nothing_of_what_the_one_before_had_asked() {
    let mut rig = bench::rmd_axes(1);
    let sequence = rig.send(&read(0, 0));
    assert!(rig.gateway.take_flight_read().is_some());
    bench::hello_again(&mut rig);
    rig.handle(Event::FlightRecord { result: Ok(page(&[1])) });
    assert_eq!(rig.answer(sequence), None);
    assert!(outcome(&mut rig, &read(0, 0), Ok(page(&[1]))).is_ok());
}
