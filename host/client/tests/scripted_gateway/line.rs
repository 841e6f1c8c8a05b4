//! A gateway that is nothing but a script, behind a line in virtual time.

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::io;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::replies::{Armed, Done, HelloReply, MoveTarget, NativeReply, Pong};
use host_protocol::{
    BootReason, Deframer, Error, Event, Kind, MAX_FRAME, MotorTimeout, PROTOCOL_MAJOR,
    PROTOCOL_MINOR, Reply, Request,
};
use mgw_client::Transport;

/// From either end of the line to the other.
pub const LATENCY: Duration = Duration::from_micros(200);
/// Gateway time when the line's time is 0, µs.
pub const GATEWAY_START_US: u64 = 5_000_000;

/// A request as the script hears it.
pub struct Heard {
    pub sequence: u16,
    pub request: Request,
    /// Gateway time of its arrival, µs.
    pub time_us: u64,
    /// How often exactly these bytes have come, this time included.
    pub times: usize,
}

/// Bytes from the gateway, after a delay.
pub type Said = (Duration, Vec<u8>);

type Script = Box<dyn FnMut(&Heard) -> Vec<Said>>;

pub struct Line {
    pub now: Duration,
    /// Every frame the client sent, and when.
    pub sent: Vec<(Duration, Vec<u8>)>,
    /// How often the line was opened again.
    pub reopened: usize,
    pub closed: bool,
    /// How often each frame was sent.
    times: HashMap<Vec<u8>, usize>,
    arriving: VecDeque<Said>,
    script: Script,
}

/// The client's end of the line.
#[derive(Clone)]
pub struct Scripted(pub Rc<RefCell<Line>>);

impl Scripted {
    pub fn new(script: impl FnMut(&Heard) -> Vec<Said> + 'static) -> Self {
        Self(Rc::new(RefCell::new(Line {
            now: Duration::ZERO,
            sent: Vec::new(),
            reopened: 0,
            closed: false,
            times: HashMap::new(),
            arriving: VecDeque::new(),
            script: Box::new(script),
        })))
    }

    /// What was sent after the hello and the pings that open a session.
    pub fn sent_after_opening(&self) -> Vec<(Duration, Vec<u8>)> {
        self.0.borrow().sent.iter().skip(4).cloned().collect()
    }

    /// Something the gateway says by itself, after a delay from now.
    pub fn say(&self, delay: Duration, bytes: Vec<u8>) {
        self.0.borrow_mut().schedule(delay, bytes);
    }
}

impl Line {
    fn schedule(&mut self, delay: Duration, bytes: Vec<u8>) {
        let at = self.now + delay;
        let place = self.arriving.partition_point(|(time, _)| *time <= at);
        self.arriving.insert(place, (at, bytes));
    }
}

impl Transport for Scripted {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut line = self.0.borrow_mut();
        if line.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let now = line.now;
        line.sent.push((now, bytes.to_vec()));
        let times = line.times.entry(bytes.to_vec()).or_default();
        *times += 1;
        let times = *times;
        let mut deframer = Deframer::new();
        let mut said = Vec::new();
        for byte in bytes {
            let Some(frame) = deframer.push(*byte) else { continue };
            let frame = frame.expect("the client sends whole frames");
            assert_eq!(frame.kind, Kind::Request);
            let request =
                Request::decode(frame.number, frame.body).expect("the client sends known requests");
            let time_us = gateway_time_us(now + LATENCY);
            said = (line.script)(&Heard { sequence: frame.sequence, request, time_us, times });
        }
        for (delay, bytes) in said {
            line.schedule(delay, bytes);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut line = self.0.borrow_mut();
        if line.closed {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let end = line.now + timeout;
        match line.arriving.front() {
            Some((at, _)) if *at <= end => {}
            _ => {
                line.now = end;
                return Ok(0);
            }
        }
        let (at, mut bytes) = line.arriving.pop_front().unwrap();
        line.now = line.now.max(at);
        let count = bytes.len().min(buffer.len());
        buffer[..count].copy_from_slice(&bytes[..count]);
        if count < bytes.len() {
            line.arriving.push_front((at, bytes.split_off(count)));
        }
        Ok(count)
    }

    fn now(&self) -> Duration {
        self.0.borrow().now
    }

    fn sleep(&mut self, duration: Duration) {
        self.0.borrow_mut().now += duration;
    }

    fn reconnect(&mut self) -> io::Result<()> {
        let mut line = self.0.borrow_mut();
        line.reopened += 1;
        line.closed = false;
        line.arriving.clear();
        Ok(())
    }
}

pub fn gateway_time_us(now: Duration) -> u64 {
    GATEWAY_START_US + u64::try_from(now.as_micros()).unwrap()
}

/// What a healthy gateway says: the hello, the time, and `Done` to everything else, one round trip
/// later.
pub fn healthy(heard: &Heard) -> Vec<Said> {
    let reply = match &heard.request {
        Request::Hello(_) => Reply::Hello(hello(PROTOCOL_MAJOR)),
        Request::Ping(_) => Reply::Ping(Pong { time_us: heard.time_us }),
        Request::Arm(_) => Reply::Arm(Armed { epoch: 9, motor_timeout: MotorTimeout::Unknown }),
        Request::Setpoint(_) => Reply::Setpoint(Done {}),
        Request::Stop(_) => Reply::Stop(Done {}),
        Request::Subscribe(_) => Reply::Subscribe(Done {}),
        Request::MoveRelative(_) => {
            Reply::MoveRelative(MoveTarget { start_rad: 0.5, target_rad: 2.0 })
        }
        Request::Native(request) => Reply::Native(NativeReply { data: request.data.clone() }),
        other => panic!("the script does not know {other:?}"),
    };
    vec![(2 * LATENCY, reply_bytes(heard.sequence, &reply))]
}

pub fn hello(protocol_major: u16) -> HelloReply {
    HelloReply {
        protocol_major,
        protocol_minor: PROTOCOL_MINOR,
        firmware: "0.1.0".try_into().unwrap(),
        build_id: "script".try_into().unwrap(),
        board: "scripted".try_into().unwrap(),
        boot: BootReason::Simulated,
        has_crash_report: false,
        trips_recorded: 0,
        max_axes: 32,
        max_message: 512,
        buses: host_protocol::Vec::new(),
        time_us: GATEWAY_START_US,
    }
}

pub fn reply_bytes(sequence: u16, reply: &Reply) -> Vec<u8> {
    written(|out| reply.encode_frame(sequence, out).unwrap())
}

pub fn error_bytes(sequence: u16, error: &Error) -> Vec<u8> {
    written(|out| error.encode_frame(sequence, out).unwrap())
}

pub fn event_bytes(sequence: u16, time_us: u64, event: &Event) -> Vec<u8> {
    written(|out| event.encode_frame(sequence, 0, time_us, out).unwrap())
}

fn written(write: impl FnOnce(&mut [u8]) -> usize) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = write(&mut out);
    out[..length].to_vec()
}
