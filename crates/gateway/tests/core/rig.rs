//! A gateway on a bench without motors: the test plays the host with typed requests and the motors with literal bytes.

use gateway::{Board, BusPort, BusPortKind, Event, Gateway, Instant, Outgoing, Transmit};
use host_protocol::{
    BootReason, CanFrame, Deframer, Error, Event as HostEvent, EventMessage, Kind, MAX_FRAME, Reply, Request,
};

const BITRATES: &[u32] = &[1_000_000, 500_000, 210_526];
const BAUDS: &[u32] = &[115_200, 2_000_000];

/// Buses 0 and 1 are CAN, bus 2 is RS485 with echo.
pub static BOARD: Board = Board {
    name: "rig",
    firmware: "0.1.0",
    build_id: "test",
    boot: BootReason::Simulated,
    buses: &[
        BusPort { kind: BusPortKind::Can, bitrates: BITRATES },
        BusPort { kind: BusPortKind::Can, bitrates: BITRATES },
        BusPort { kind: BusPortKind::Rs485 { local_echo: true }, bitrates: BAUDS },
    ],
    links: 2,
};

/// What a gateway said to its host.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    Reply(u16, Box<Reply>),
    Error(u16, Error),
    Event(HostEvent),
}

/// A motor's part: the bytes it answers to a request on a bus, as `ID#HEX` on CAN and as hex on RS485.
pub type Motor = Box<dyn FnMut(u64, u8, &str) -> Option<String>>;

pub struct Rig {
    pub gateway: Gateway,
    pub now_us: u64,
    /// Every frame sent: time, bus, text.
    pub wire: Vec<(u64, u8, String)>,
    pub said: Vec<Said>,
    pub motor: Motor,
    /// Frames on a bus that are acknowledged; `false` plays a cut cable.
    pub acknowledge: bool,
    deframer: Deframer,
    sequence: u16,
    /// Things on their way: due time, what.
    due: Vec<(u64, Due)>,
}

enum Due {
    Left(u8, u8, String),
    Reply(u8, String),
}

/// Time a frame takes here, and the pause of a motor before its reply; round numbers, easy to reason with.
const FRAME_US: u64 = 130;
const MOTOR_US: u64 = 100;

impl Rig {
    pub fn new() -> Self {
        let mut rig = Self {
            gateway: Gateway::new(&BOARD),
            now_us: 1_000,
            wire: Vec::new(),
            said: Vec::new(),
            motor: Box::new(|_, _, _| None),
            acknowledge: true,
            deframer: Deframer::new(),
            sequence: 0,
            due: Vec::new(),
        };
        rig.handle(Event::Tick);
        rig
    }

    pub fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    /// Sends a request and returns what it is answered within 100 ms.
    pub fn ask(&mut self, request: Request) -> Result<Reply, Error> {
        let sequence = self.send(&request);
        for _ in 0..1_000 {
            let answer = self.said.iter().find_map(|said| match said {
                Said::Reply(number, reply) if *number == sequence => Some(Ok((**reply).clone())),
                Said::Error(number, error) if *number == sequence => Some(Err(*error)),
                _ => None,
            });
            if let Some(answer) = answer {
                return answer;
            }
            self.run(100);
        }
        panic!("no answer to {request:?}; said {:?}", self.said);
    }

    /// Sends a request without waiting.
    pub fn send(&mut self, request: &Request) -> u16 {
        self.sequence += 1;
        let mut frame = [0; MAX_FRAME];
        let length = request.encode_frame(self.sequence, &mut frame).unwrap();
        self.bytes(&frame[..length]);
        self.sequence
    }

    /// Bytes from the host.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.handle(Event::HostBytes { link: 0, bytes });
    }

    pub fn handle(&mut self, event: Event<'_>) {
        self.gateway.handle(self.now(), event);
        self.drain();
    }

    /// A frame from a motor, now.
    pub fn receive(&mut self, bus: u8, text: &str) {
        match text.split_once('#') {
            Some((id, data)) => {
                let id = u16::from_str_radix(id, 16).unwrap();
                let frame = CanFrame::standard(id, &unhex(data)).unwrap();
                self.handle(Event::CanReceived { bus, frame });
            }
            None => self.handle(Event::SerialReceived { bus, bytes: &unhex(text) }),
        }
    }

    /// Lets time pass.
    pub fn run(&mut self, us: u64) {
        let end = self.now_us + us;
        loop {
            let wire = self.due.iter().map(|(at, _)| *at).min();
            let core = self.gateway.next_deadline().map(Instant::as_micros);
            let next = [wire, core].into_iter().flatten().filter(|at| *at <= end).min();
            let Some(next) = next else { break };
            self.now_us = self.now_us.max(next);
            let mut due: Vec<Due> = Vec::new();
            let now_us = self.now_us;
            let mut later = Vec::new();
            for (at, what) in self.due.drain(..) {
                if at <= now_us { due.push(what) } else { later.push((at, what)) }
            }
            self.due = later;
            if due.is_empty() {
                self.handle(Event::Tick);
            }
            for what in due {
                match what {
                    Due::Left(bus, slot, text) => self.left(bus, slot, &text),
                    Due::Reply(bus, text) => self.receive(bus, &text),
                }
            }
        }
        self.now_us = end;
        self.handle(Event::Tick);
    }

    fn left(&mut self, bus: u8, slot: u8, text: &str) {
        if !text.contains('#') {
            self.receive(bus, text);
        }
        self.handle(Event::Transmitted { bus, slot });
        if let Some(reply) = (self.motor)(self.now_us, bus, text) {
            self.due.push((self.now_us + MOTOR_US + FRAME_US, Due::Reply(bus, reply)));
        }
    }

    fn drain(&mut self) {
        for bus in 0..3 {
            while let Some(Transmit { slot, frame }) = self.gateway.poll_transmit(self.now(), bus) {
                let text = match frame {
                    Outgoing::Can(frame) => can_text(&frame),
                    Outgoing::Serial(bytes) => hex(&bytes),
                };
                self.wire.push((self.now_us, bus, text.clone()));
                if self.acknowledge {
                    self.due.push((self.now_us + FRAME_US, Due::Left(bus, slot, text)));
                }
            }
        }
        let mut out = [0; MAX_FRAME];
        while let Some(length) = self.gateway.poll_host(0, &mut out) {
            for byte in &out[..length] {
                let Some(Ok(frame)) = self.deframer.push(*byte) else { continue };
                self.said.push(match frame.kind {
                    Kind::Reply => Said::Reply(
                        frame.sequence,
                        Box::new(Reply::decode(frame.number, frame.body).unwrap()),
                    ),
                    Kind::Error => {
                        Said::Error(frame.sequence, Error::decode(frame.number, frame.body).unwrap())
                    }
                    Kind::Event => Said::Event(EventMessage::decode(frame.number, frame.body).unwrap().event),
                    Kind::Request => panic!("a gateway sends no requests"),
                });
            }
        }
    }

    /// Texts sent on a bus at or after a time.
    pub fn sent_since(&self, bus: u8, since_us: u64) -> Vec<&str> {
        let frames = self.wire.iter().filter(|(at, on, _)| *at >= since_us && *on == bus);
        frames.map(|(_, _, text)| text.as_str()).collect()
    }

    pub fn events(&self) -> Vec<&HostEvent> {
        let events = self.said.iter().filter_map(|said| match said {
            Said::Event(event) => Some(event),
            _ => None,
        });
        events.collect()
    }
}

pub fn can_text(frame: &CanFrame) -> String {
    use embedded_can::Id;
    let id = match frame.id() {
        Id::Standard(id) => format!("{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{:08X}", id.as_raw()),
    };
    format!("{id}#{}", hex(frame.data()))
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

pub fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}
