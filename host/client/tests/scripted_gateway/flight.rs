//! Reading what the flight recorder has kept, page by page.

use std::time::Duration;

use crate::line::{LATENCY, Scripted, error_bytes, healthy, reply_bytes};
use host_protocol::replies::FlightRecordPage;
use host_protocol::requests::ReadFlightRecord;
use host_protocol::{Error, Reply, Request};
use mgw_client::{Client, ClientError};

/// Two parts of 700 bytes: the bytes of each count, from its number on.
const PARTS: u16 = 2;
const LENGTH: u32 = 700;

type Answer = Result<FlightRecordPage, Error>;

fn page(id: u32, read: ReadFlightRecord) -> FlightRecordPage {
    let bytes = (read.offset..LENGTH).take(480);
    let bytes = bytes.map(|at| (u32::from(read.part) + at).to_le_bytes()[0]).collect();
    FlightRecordPage { id, parts: PARTS, length: LENGTH, bytes }
}

/// A client of a gateway that answers so; `times` is how often it has been asked.
fn client(mut answer: impl FnMut(usize, ReadFlightRecord) -> Answer + 'static) -> Client<Scripted> {
    let mut times = 0;
    let line = Scripted::new(move |heard| {
        let Request::ReadFlightRecord(read) = heard.request else { return healthy(heard) };
        times += 1;
        let bytes = match answer(times, read) {
            Ok(page) => reply_bytes(heard.sequence, &Reply::ReadFlightRecord(page)),
            Err(error) => error_bytes(heard.sequence, &error),
        };
        vec![(2 * LATENCY, bytes)]
    });
    Client::connect_as(line, 1, 0).unwrap()
}

/// The file of what it keeps: the checksum was computed apart from this code.
fn whole() -> Vec<u8> {
    let parts = (0..u32::from(PARTS)).flat_map(|part| (part..part + LENGTH).map(u32::to_le_bytes));
    let mut file: Vec<u8> = parts.map(|bytes| bytes[0]).collect();
    file.extend(CHECKSUM);
    file
}

const CHECKSUM: [u8; 4] = [0x16, 0xE8, 0xD2, 0x12];

#[test]
fn all_parts_are_read_and_put_together() {
    let mut client = client(|_, read| Ok(page(1, read)));
    assert_eq!(client.flight_record().unwrap(), Some(whole()));
}

#[test]
fn nothing_kept_is_no_error() {
    let nothing = FlightRecordPage { id: 0, parts: 0, length: 0, bytes: [].into_iter().collect() };
    let mut client = client(move |_, _| Ok(nothing.clone()));
    assert_eq!(client.flight_record().unwrap(), None);
}

#[test]
fn what_is_kept_meanwhile_is_read_from_its_beginning() {
    // Another trip comes after two pages, and after the fourth page of that one a shorter record.
    let mut client = client(|times, read| match times {
        ..=2 => Ok(page(1, read)),
        7 => Err(Error::BeyondFlightRecord { parts: 1, length: 9 }),
        _ => Ok(page(2, read)),
    });
    assert_eq!(client.flight_record().unwrap(), Some(whole()));
    assert_eq!(client.transport().0.borrow().sent.len(), 4 + 11);
}

#[test]
fn trips_without_end_are_an_error() {
    let mut client = client(|times, read| Ok(page(u32::try_from(times).unwrap(), read)));
    let error = client.flight_record().unwrap_err();
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecording {})), "{error}");
}

#[test]
fn where_somebody_else_reads_it_is_asked_for_again() {
    let mut client = client(|times, read| match times % 3 {
        0 => Ok(page(1, read)),
        _ => Err(Error::FlightRecorderBusy {}),
    });
    assert_eq!(client.flight_record().unwrap(), Some(whole()));
}

#[test]
fn a_recorder_that_never_has_time_is_told() {
    let mut client = client(|_, _| Err(Error::FlightRecorderBusy {}));
    let start = client.now();
    let error = client.flight_record().unwrap_err();
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecorderBusy {})), "{error}");
    let took = client.now() - start;
    assert!((Duration::from_secs(3)..Duration::from_secs(4)).contains(&took), "{took:?}");
}

#[test]
fn what_does_not_advance_or_never_ends_is_no_answer() {
    let empty = FlightRecordPage { bytes: [].into_iter().collect(), ..page(1, first()) };
    let long = FlightRecordPage { length: 100, ..page(1, first()) };
    let endless = FlightRecordPage { parts: u16::MAX, length: u32::MAX, ..page(1, first()) };
    for wrong in [empty, long, endless] {
        let mut client = client(move |_, _| Ok(wrong.clone()));
        let error = client.flight_record().unwrap_err();
        assert!(matches!(error, ClientError::UnreadableReply { .. }), "{error}");
    }
}

fn first() -> ReadFlightRecord {
    ReadFlightRecord { part: 0, offset: 0 }
}
