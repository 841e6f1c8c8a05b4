//! `mgw record`

use std::time::Duration;

use host_protocol::ReceivedFrame;
use mgw_client::ClientError;
use serde_json::json;

use crate::args::RecordArgs;
use crate::failure::Failure;
use crate::record::{Recording, What};
use crate::scan::fetch;
use crate::session::{EVENTS_AT_ONCE, Session};
use crate::states;

/// Between two looks at what has come: so much later a period of a cycle is at most.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// Between two fetches of raw frames.
const FETCH_EVERY: Duration = Duration::from_millis(10);

/// Records samples, events and periods of cycles until Ctrl-C.
pub fn run(session: &mut Session, arguments: &RecordArgs) -> Result<(), Failure> {
    let axes = session.axes_or_all(&arguments.axes)?;
    session.refuse_unconfigured(&axes, "there is nothing to record of it")?;
    let bus = arguments.frames.as_ref().map(|bus| session.bus(bus)).transpose()?;
    let fields = states::or_all(&arguments.fields);
    let place = arguments.written.place(arguments.file.clone());
    Recording::refuse_existing(&place)?;
    if let Some(bus) = bus {
        session.client.raw_open(bus)?;
    }
    let period = Duration::from_millis(arguments.period);
    let subscribed = session.client.subscribe(&axes, fields, period).map_err(Failure::from);
    // A file that is there is written over for a recording that can begin.
    let begun = subscribed.and_then(|()| Recording::start(place, session.out.motors));
    let recording = begun.inspect_err(|_| {
        let closed = bus.map_or(Ok(()), |bus| session.client.raw_close(bus));
        let _ = session.client.unsubscribe().and(closed);
    })?;
    let followed = {
        let file = arguments.file.display().to_string();
        session.out.progress(
            "recording",
            format!("recording into {file}; Ctrl-C ends it"),
            json!({ "file": file }),
        );
        follow(session, &recording, bus, arguments.seconds)
    };
    let (followed, interrupted) = match followed {
        // Ctrl-C is how it ends.
        Err(Failure::Client(ClientError::Interrupted { .. })) => (Ok(()), true),
        followed => (followed, false),
    };
    // What was recorded is worth more than a farewell.
    let summary = recording.finish();
    if followed.is_ok() || interrupted {
        let closed = bus.map_or(Ok(()), |bus| session.client.raw_close(bus));
        let _ = session.client.unsubscribe().and(closed);
    }
    let summary = summary?;
    let told = session.out.event("recording_ended", summary.text(), summary.fields());
    Failure::first([followed, told])
}

fn follow(
    session: &mut Session,
    recording: &Recording,
    bus: Option<u8>,
    seconds: Option<Duration>,
) -> Result<(), Failure> {
    let tap = recording.tap();
    let client = &mut session.client;
    let end = seconds.map(|seconds| client.now() + seconds);
    let (mut lost, mut unfetched, mut fetch_at) = (0, 0, client.now());
    while !recording.has_failed() && end.is_none_or(|end| client.now() < end) {
        client.keep_subscription()?;
        let mut wait = LOOK_EVERY;
        // If they come without end, what else is to be done has its turn all the same.
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = client.poll_event(wait)? else { break };
            tap.put(What::Event(message));
            wait = Duration::ZERO;
        }
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = client.poll_cycle(Duration::ZERO)? else { break };
            tap.put(What::Cycle(message));
        }
        if let Some(bus) = bus
            && client.now() >= fetch_at
        {
            fetch_at = client.now() + FETCH_EVERY;
            let hear = |frame: &ReceivedFrame| tap.put(What::Frame { bus, frame: frame.clone() });
            unfetched += u64::from(fetch(client, bus, hear)?);
        }
        let on_the_way = client.losses().events() + unfetched;
        if on_the_way != lost {
            lost = on_the_way;
            tap.put(What::Lost { on_the_way });
        }
    }
    Ok(())
}
