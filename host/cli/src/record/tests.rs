use std::io;
use std::path::Path;
use std::sync::Mutex;

use host_protocol::requests as ask;
use host_protocol::{
    AxisState, BootReason, Bytes, CanFrame, CycleEvent, CycleMessage, CycleResult, CycleState,
    Deframer, Error, Event, EventMessage, FaultReading, FixedU32, MAX_FRAME, Overruns, RawFrame,
    Reading, ReceivedFrame, Reply, Request, Setpoint, SlowState, Trip, TripReason, replies,
};
use mgw_serve::{SERVER, Seen};
use serde_json::Value;

use super::file::Sink;
use super::read::Recorded;
use super::*;

const AT: Duration = Duration::from_millis(1_500);

fn sample(time_us: u64) -> EventMessage {
    let reading = |value| Some(Reading { value, age_us: 200 });
    let event = Event::Sample {
        axis: 3,
        state: AxisState::Active,
        position_rad: reading(1.25),
        velocity_rad_s: reading(f32::NAN),
        current_a: None,
        voltage_v: reading(48.5),
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: Some(FaultReading { word: 2, warnings: 0, age_us: 900 }),
    };
    EventMessage { dropped: 1, time_us, event }
}

fn tripped() -> EventMessage {
    let trip = Trip {
        reason: TripReason::HostSilent,
        time_us: 7_000_000,
        velocity_rad_s: Some(2.0),
        position_rad: None,
        current_a: None,
        unreachable: false,
    };
    EventMessage { dropped: 0, time_us: 7_000_001, event: Event::Tripped { axis: 0, trip } }
}

fn cycle() -> CycleMessage {
    let mut event = CycleEvent {
        period: 300,
        due_us: FixedU32(2_999_000),
        late_us: 12,
        jitter_us: 15,
        took_us: 740,
        overruns: Overruns::default(),
        fields: CycleEvent::FAST,
        axes: 0,
        states: Bytes::new(),
        slow: Some(SlowState {
            axis: 3,
            voltage_v: Some(Reading { value: 48.5, age_us: 90_000 }),
            motor_temperature_c: None,
            driver_temperature_c: None,
            faults: Some(FaultReading { word: 2, warnings: 0, age_us: 80_000 }),
        }),
    };
    event.push(CycleState {
        axis: 3,
        state: AxisState::Active,
        result: CycleResult::Answered,
        age_us: 120,
        position_rad: Some(1.5),
        velocity_rad_s: Some(-2.0),
        current_a: None,
        voltage_v: None,
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: None,
    });
    CycleMessage { dropped: 0, time_us: 3_000_000, event }
}

/// A frame of the cable as a server sees it.
fn seen(program: Option<u64>, encode: impl Fn(&mut [u8]) -> usize) -> Seen {
    let mut out = [0; MAX_FRAME];
    let length = encode(&mut out);
    let mut deframer = Deframer::new();
    let frame = deframer.take(&mut &out[..length]).unwrap().unwrap();
    let (kind, sequence, number) = (frame.kind, frame.sequence, frame.number);
    Seen { program, kind, sequence, number, body: frame.body.to_vec() }
}

fn request(program: u64, sequence: u16, request: impl Into<Request>) -> Seen {
    let request = request.into();
    seen(Some(program), |out| request.encode_frame(sequence, out).unwrap())
}

fn reply(sequence: u16, reply: &Reply) -> Seen {
    seen(Some(2), |out| reply.encode_frame(sequence, out).unwrap())
}

fn hello() -> replies::HelloReply {
    replies::HelloReply {
        protocol_major: 1,
        protocol_minor: 0,
        firmware: Default::default(),
        build_id: Default::default(),
        board: Default::default(),
        boot: BootReason::PowerOn,
        has_crash_report: false,
        trips_recorded: 0,
        max_axes: 8,
        max_message: 512,
        buses: Default::default(),
        time_us: 9_000_000,
    }
}

fn event(sequence: u16, message: &EventMessage) -> Seen {
    let EventMessage { dropped, time_us, event } = message;
    seen(None, |out| event.encode_frame(sequence, *dropped, *time_us, out).unwrap())
}

fn take(encoder: &mut Encoder, what: What) -> Vec<Message> {
    encoder.take(Item { at: AT, what })
}

/// Asserts that every value has the one type that its schema says, and no other name.
fn fits(schema: &Value, value: &Value, at: &str) {
    let of = schema["type"].as_str().unwrap_or_else(|| panic!("{at}: no single type"));
    let is_right = match of {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        other => panic!("{at}: {other}"),
    };
    assert!(is_right, "{at}: {value} is no {of}");
    let properties = &schema["properties"];
    for (name, field) in value.as_object().into_iter().flatten() {
        if name == "body" {
            continue;
        }
        assert!(!properties[name].is_null(), "{at}: {name} is not in the schema");
        fits(&properties[name], field, &format!("{at}.{name}"));
    }
    for item in value.as_array().into_iter().flatten() {
        fits(&schema["items"], item, &format!("{at}[]"));
    }
}

fn all_messages() -> Vec<Message> {
    let mut encoder = Encoder::new(Protocols::default());
    let frame = RawFrame::Can(CanFrame::standard(0x141, &[0x9A, 0]).unwrap());
    let received = ReceivedFrame { time_us: 5_000_000, frame: frame.clone() };
    let refused = Error::NotInCommand { holder: 1 };
    let refused = seen(Some(2), |out| refused.encode_frame(9, out).unwrap());
    let mut frames = replies::RawFrames { frames: Default::default(), dropped: 0 };
    frames.frames.push(received.clone()).unwrap();
    let motion = Setpoint::Velocity { velocity_rad_s: 2.0 };
    let mut messages: Vec<Message> = [
        What::Event(sample(6_000_000)),
        What::Event(tripped()),
        What::Cycle(cycle()),
        What::Frame { bus: 1, frame: received },
        What::Seen(request(2, 7, ask::Stop { target: host_protocol::StopTarget::All })),
        What::Seen(request(
            2,
            8,
            ask::Setpoint { axis: 0, epoch: 1, expires_at_us: 9_000_000, setpoint: motion },
        )),
        What::Seen(refused),
        What::Seen(reply(11, &Reply::Ping(replies::Pong { time_us: 8_000_000 }))),
        What::Seen(request(0, 12, ask::RawReceive { bus: 2 })),
        What::Seen(reply(12, &Reply::RawReceive(frames))),
        What::Seen(request(3, 13, ask::RawSend { bus: 2, frame })),
        What::Seen(event(0, &tripped())),
        What::Lost { on_the_way: 4 },
    ]
    .into_iter()
    .flat_map(|what| take(&mut encoder, what))
    .collect();
    messages.extend(encoder.losses(AT, 2));
    messages
}

#[test]
fn every_message_is_as_the_schema_of_its_topic_says() {
    let messages = all_messages();
    let topics: Vec<&str> = messages.iter().map(|message| message.topic.as_str()).collect();
    assert_eq!(
        topics.join(" "),
        "/axis/3/sample /event /cycle /frame/1 /request /request /reply /reply /request /reply \
         /frame/2 /request /frame/2 /event /recording"
    );
    for message in &messages {
        fits(&message.schema.json(), &message.value, &message.topic);
    }
    let text = |at: usize| messages[at].value.to_string();
    assert_eq!(
        text(4),
        concat!(
            r#"{"body":{"target":"all"},"by_server":false,"event":"request","program":2,"#,
            r#""request":"stop","sequence":7,"time_us":3000000,"watches":false}"#
        )
    );
    assert_eq!(messages[5].value["body"]["setpoint"]["velocity"]["velocity_rad_s"], 2.0);
    assert_eq!(messages[6].value["error"], "not_in_command");
    assert_eq!(messages[12].value["direction"], "sent");
    assert_eq!(
        text(14),
        concat!(
            r#"{"event":"lost","lost_by_gateway":1,"lost_on_the_way":4,"lost_unwritten":2,"#,
            r#""time_us":7000001}"#
        )
    );
}

#[test]
fn schemas_have_one_type_for_each_field_and_nothing_elsewhere() {
    fn check(schema: &Value, at: &str) {
        assert!(schema["type"].is_string(), "{at}: {schema}");
        assert!(schema.get("$ref").is_none() && schema.get("anyOf").is_none(), "{at}");
        if schema["type"] == "object" {
            for (name, field) in schema["properties"].as_object().expect(at) {
                check(field, &format!("{at}.{name}"));
            }
        }
        if schema["type"] == "array" {
            check(&schema["items"], at);
        }
    }
    for schema in [
        Schema::Sample,
        Schema::Event,
        Schema::Cycle,
        Schema::Request,
        Schema::Reply,
        Schema::Frame,
        Schema::Recording,
    ] {
        check(&schema.json(), schema.name());
        assert!(schema.json()["properties"].as_object().unwrap().len() > 4, "{}", schema.name());
    }
}

/// What is asked has no time of the gateway's own: it is reckoned from the last one told.
#[test]
fn a_request_has_the_gateways_time_as_far_as_it_is_known() {
    let mut encoder = Encoder::new(Protocols::default());
    let ping = || What::Seen(request(1, 5, ask::Ping {}));
    assert_eq!(take(&mut encoder, ping())[0].gateway_us, None);
    take(&mut encoder, What::Seen(reply(5, &Reply::Ping(replies::Pong { time_us: 8_000_000 }))));
    let later = Item { at: AT + Duration::from_millis(20), what: ping() };
    assert_eq!(encoder.take(later)[0].gateway_us, Some(8_020_000));
}

#[test]
fn numbers_that_are_missing_on_the_cable_are_counted() {
    let mut encoder = Encoder::new(Protocols::default());
    for sequence in [65_534, 65_535, 0, 3, 4] {
        take(&mut encoder, What::Seen(event(sequence, &tripped())));
    }
    assert_eq!(encoder.lost(), Losses { on_the_way: 2, ..Losses::default() });
    // A program says hello, which opens no session of the cable; then the server does.
    let hello = |program| Seen { program: Some(program), ..reply(9, &Reply::Hello(hello())) };
    take(&mut encoder, What::Seen(hello(2)));
    take(&mut encoder, What::Seen(event(5, &tripped())));
    assert_eq!(encoder.lost().on_the_way, 2);
    take(&mut encoder, What::Seen(hello(SERVER)));
    take(&mut encoder, What::Seen(event(1, &tripped())));
    assert_eq!(encoder.lost().on_the_way, 3);
    assert!(encoder.losses(AT, 0).is_some());
    assert!(encoder.losses(AT, 0).is_none(), "told once");
}

/// The files of a test, by path.
type Disk = Arc<Mutex<Vec<(PathBuf, Vec<u8>)>>>;

/// A file on such a disk, which is full after so many bytes.
struct OnDisk {
    disk: Disk,
    file: usize,
    room: usize,
}

impl io::Write for OnDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut disk = self.disk.lock().unwrap();
        if disk[self.file].1.len() + bytes.len() > self.room {
            return Err(io::ErrorKind::StorageFull.into());
        }
        disk[self.file].1.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn files(longest: u64, room: usize) -> (Disk, Result<Files, Failure>) {
    let disk = Disk::default();
    let limits = Limits { longest, since_epoch: Duration::from_secs(1_000) };
    let on = disk.clone();
    let open = move |path: &Path| -> io::Result<Sink> {
        let mut files = on.lock().unwrap();
        files.push((path.to_owned(), Vec::new()));
        Ok(Box::new(OnDisk { disk: on.clone(), file: files.len() - 1, room }))
    };
    (disk, Files::create(PathBuf::from("run.mcap"), limits, Box::new(open)))
}

fn read(bytes: &[u8], name: &str) -> (Vec<Recorded>, bool) {
    let path = std::env::temp_dir().join(format!("mgw-record-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let mut messages = Vec::new();
    let is_whole = read::file(&path, |message| {
        messages.push(message);
        Ok(())
    });
    std::fs::remove_file(&path).unwrap();
    (messages, is_whole.unwrap())
}

/// The writer has not had its turn yet: what the queue has no place for is counted, and told in the
/// file.
#[test]
fn what_a_slow_disk_has_no_time_for_is_counted_in_the_file() {
    let (queue, items) = sync_channel(2);
    let unwritten = Arc::new(Unwritten::default());
    let tap = Tap { queue, unwritten: unwritten.clone(), start: Instant::now() };
    (0..5).for_each(|at| tap.put(What::Event(sample(at))));
    drop(tap);
    let (disk, files) = files(u64::MAX, usize::MAX);
    let encoder = Encoder::new(Protocols::default());
    let summary = write_down(&items, &unwritten, encoder, files.unwrap()).unwrap();
    assert_eq!(summary.losses, Losses { by_gateway: 2, on_the_way: 0, unwritten: 3 });
    assert_eq!(summary.messages, 3);
    let (messages, is_whole) = read(&disk.lock().unwrap()[0].1, "slow.mcap");
    assert!(is_whole);
    let topics: Vec<&str> = messages.iter().map(|message| message.topic.as_str()).collect();
    assert_eq!(topics, ["/axis/3/sample", "/axis/3/sample", "/recording"]);
    assert_eq!(messages[2].value["lost_unwritten"], 3);
}

/// What had no place in the queue is missing in the numbers of the cable, too: it counts once.
#[test]
fn events_of_a_cable_that_a_slow_disk_has_no_time_for_count_once() {
    let (queue, items) = sync_channel(2);
    let unwritten = Arc::new(Unwritten::default());
    let tap = Tap { queue, unwritten: unwritten.clone(), start: Instant::now() };
    let put = |sequences: &[u16]| {
        let events = sequences.iter().map(|sequence| event(*sequence, &tripped()));
        events.for_each(|seen| tap.put(What::Seen(seen)));
    };
    let mut encoder = Encoder::new(Protocols::default());
    let mut write = |count: usize| {
        for _ in 0..count {
            let Ok(Put::Item(item)) = items.try_recv() else { panic!("too few") };
            encoder.not_queued(unwritten.events.swap(0, Ordering::Relaxed));
            encoder.take(*item);
        }
        encoder.lost().on_the_way
    };
    put(&[0, 1, 2, 3]);
    assert_eq!(write(2), 0);
    // 2 and 3 had no place, and 4 was lost on the way.
    put(&[5]);
    assert_eq!(write(1), 1);
    assert_eq!(unwritten.all.load(Ordering::Relaxed), 2);
}

#[test]
fn a_file_that_has_grown_long_is_followed_by_another() {
    let (disk, files) = files(2_000, usize::MAX);
    let mut files = files.unwrap();
    let messages = all_messages();
    (0..5).for_each(|_| messages.iter().for_each(|message| files.write(message).unwrap()));
    let summary = files.finish(Losses::default()).unwrap();
    let disk = disk.lock().unwrap();
    assert!(disk.len() > 3, "{}", disk.len());
    assert_eq!(disk[2].0, PathBuf::from("run.3.mcap"));
    assert_eq!(summary.files.len(), disk.len());
    let read: Vec<_> = disk.iter().map(|(_, bytes)| read(bytes, "long.mcap")).collect();
    assert!(read.iter().all(|(_, is_whole)| *is_whole));
    let values = read.iter().flat_map(|(messages, _)| messages).map(|message| &message.value);
    let written = (0..5).flat_map(|_| &messages).map(|message| &message.value);
    assert!(values.eq(written));
    assert_eq!(read[0].0[0].log_ns, 1_001_500_000_000);
}

#[test]
fn a_recording_that_was_cut_off_is_read_up_to_the_cut() {
    let (disk, files) = files(u64::MAX, usize::MAX);
    let mut files = files.unwrap();
    let messages = all_messages();
    messages.iter().for_each(|message| files.write(message).unwrap());
    files.flush().unwrap();
    let flushed = disk.lock().unwrap()[0].1.clone();
    let (whole, is_whole) = read(&flushed, "cut.mcap");
    assert!(!is_whole);
    assert_eq!(whole.len(), messages.len());
    // In the middle of the second chunk: the first, as the checksum of the other has not come.
    messages.iter().for_each(|message| files.write(message).unwrap());
    files.flush().unwrap();
    let twice = disk.lock().unwrap()[0].1.clone();
    let (some, is_whole) = read(&twice[..usize::midpoint(flushed.len(), twice.len())], "cut.mcap");
    assert!(!is_whole);
    assert_eq!(some.len(), messages.len());
    assert!(some.iter().zip(&messages).all(|(read, written)| read.value == written.value));
}

#[test]
fn of_a_damaged_chunk_nothing_is_told() {
    let (disk, files) = files(u64::MAX, usize::MAX);
    let mut files = files.unwrap();
    all_messages().iter().for_each(|message| files.write(message).unwrap());
    files.finish(Losses::default()).unwrap();
    let mut bytes = disk.lock().unwrap()[0].1.clone();
    let name = b"\"time_us\"";
    let key = bytes.windows(name.len()).position(|window| window == name).unwrap();
    bytes[key + 1] ^= 1;
    let path = std::env::temp_dir().join(format!("mgw-record-{}-bad.mcap", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let mut told = 0;
    let refused = read::file(&path, |_| {
        told += 1;
        Ok(())
    });
    std::fs::remove_file(&path).unwrap();
    assert!(refused.unwrap_err().to_string().contains("CRC"));
    assert_eq!(told, 0);
}

/// Threads take the time before they have a place in the queue, and what is lost is told between.
#[test]
fn times_never_step_back_within_a_recording() {
    let (queue, items) = sync_channel(9);
    let unwritten = Arc::new(Unwritten::default());
    for at in [5, 3, 4, 9] {
        let item = Item { at: Duration::from_secs(at), what: What::Event(sample(at)) };
        queue.send(Put::Item(Box::new(item))).unwrap();
    }
    unwritten.all.store(1, Ordering::Relaxed);
    queue.send(Put::End).unwrap();
    let (disk, files) = files(u64::MAX, usize::MAX);
    let encoder = Encoder::new(Protocols::default());
    write_down(&items, &unwritten, encoder, files.unwrap()).unwrap();
    let (messages, _) = read(&disk.lock().unwrap()[0].1, "times.mcap");
    let times: Vec<u64> = messages.iter().map(|one| one.log_ns / 1_000_000_000 - 1_000).collect();
    assert_eq!(times, [5, 5, 5, 9, 9]);
}

#[test]
fn a_full_disk_is_told_and_ends_the_recording_alone() {
    let (_, files) = files(u64::MAX, 4_000);
    let mut files = files.unwrap();
    let messages = all_messages();
    let full = (0..100).find_map(|_| {
        let written = messages.iter().try_for_each(|message| files.write(message));
        written.and_then(|()| files.flush()).err()
    });
    let text = full.expect("the disk is full").to_string();
    assert!(text.starts_with("cannot write run.mcap (") && text.contains("storage"), "{text}");
}

/// Eight axes in one period of a free-running cycle.
fn eight_axes(period: u32) -> CycleMessage {
    let CycleMessage { event: one, .. } = cycle();
    let mut event = CycleEvent { period, axes: 0, states: Bytes::new(), ..one.clone() };
    for axis in 0..8 {
        for state in one.states() {
            event.push(CycleState { axis, current_a: Some(0.5), ..state });
        }
    }
    CycleMessage { dropped: 0, time_us: u64::from(period) * 1_000, event }
}

/// A period as a server sees it: the request, its answer, and the event.
fn period(number: u32) -> [Seen; 3] {
    let sequence = u16::try_from(number % 65_536).unwrap();
    let message = eight_axes(number);
    let CycleMessage { dropped, time_us, event } = &message;
    let told = seen(None, |out| event.encode_frame(sequence, *dropped, *time_us, out).unwrap());
    let motion = Setpoint::Velocity { velocity_rad_s: 2.0 };
    let asked = ask::Setpoint { axis: 0, epoch: 1, expires_at_us: number, setpoint: motion };
    let answer = reply(sequence, &Reply::Setpoint(replies::Done {}));
    [request(2, sequence, asked), answer, told]
}

/// By hand, in real time, on this machine's disk:
/// `cargo test --release -p mgw --lib -- --ignored --nocapture minute`
#[test]
#[ignore = "takes a minute, and 150 MB of the disk"]
fn eight_axes_at_1_khz_for_a_minute_lose_nothing() {
    const PERIODS: u32 = 60_000;
    let path = std::env::temp_dir().join(format!("mgw-minute-{}.mcap", std::process::id()));
    let place = Place { path, longest: u64::MAX, force: true };
    let recording = Recording::start(place.clone(), Protocols::default()).unwrap();
    let (tap, start) = (recording.tap(), Instant::now());
    for number in 0..PERIODS {
        let due = Duration::from_millis(number.into());
        thread::sleep(due.saturating_sub(start.elapsed()));
        period(number).into_iter().for_each(|seen| tap.put(What::Seen(seen)));
    }
    let summary = recording.finish().unwrap();
    println!("{summary:?}");
    assert_eq!(summary.losses, Losses::default());
    assert_eq!(summary.messages, 3 * u64::from(PERIODS));
    let mut read = 0;
    assert!(
        read::file(&place.path, |_| {
            read += 1;
            Ok(())
        })
        .unwrap()
    );
    assert_eq!(read, summary.messages);
    std::fs::remove_file(&place.path).unwrap();
}

/// By hand, in virtual time, into files that keep nothing:
/// `cargo test --release -p mgw --lib -- --ignored --nocapture day`
#[test]
#[ignore = "takes minutes"]
#[cfg(target_os = "linux")]
fn a_day_of_eight_axes_at_100_hz_takes_no_more_memory_than_an_hour() {
    const HOUR: u32 = 3_600 * 100;
    let pages = || -> u64 {
        let text = std::fs::read_to_string("/proc/self/statm").unwrap();
        text.split(' ').nth(1).unwrap().parse().unwrap()
    };
    let limits = Limits { longest: 1 << 30, since_epoch: Duration::from_secs(1_000) };
    let open = |_: &Path| -> io::Result<Sink> { Ok(Box::new(io::sink())) };
    let mut files = Files::create(PathBuf::from("day.mcap"), limits, Box::new(open)).unwrap();
    let mut encoder = Encoder::new(Protocols::default());
    let mut after_an_hour = 0;
    for number in 0..24 * HOUR {
        let at = Duration::from_millis(10) * number;
        for message in encoder.take(Item { at, what: What::Cycle(eight_axes(number)) }) {
            files.write(&message).unwrap();
        }
        if number % 100 == 0 {
            files.flush().unwrap();
        }
        if number == HOUR {
            after_an_hour = pages();
        }
    }
    let growth = pages().saturating_sub(after_an_hour) * 4;
    let summary = files.finish(encoder.lost()).unwrap();
    println!("{growth} KiB more than after an hour; {} files", summary.files.len());
    assert_eq!(summary.messages, 24 * u64::from(HOUR));
    assert!(growth < 16 * 1024, "{growth} KiB");
}
