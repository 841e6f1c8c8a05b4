//! Whether the simulated motors play a command: it is answered by more than its own bytes, or
//! afterwards the motor is not what it would be without it.

use host_protocol::Protocol;
use mgw_sim::{Injection, Motor, MotorWiring, Wire};
use std::collections::BTreeSet;
use std::time::Duration;

use crate::codecs;
use crate::lab;
use crate::page::wire;

/// What is done with a motor.
#[derive(Clone, Copy)]
enum Step {
    /// It hears a frame, and 2 ms pass.
    Hear(&'static str),
    Wait(u64),
    Inject(Injection),
    PowerOffAndOn,
}

use Step::{Hear, Inject, PowerOffAndOn, Wait};

/// States in which a command may show what it does; each begins with a motor that has just been
/// switched on.
fn preparations(protocol: Protocol) -> &'static [&'static [Step]] {
    const FAULT: [Step; 3] =
        [Inject(Injection::FaultBits(0x0040)), Wait(20), Inject(Injection::FaultBits(0))];
    const BRAKE: Step = Inject(Injection::Brake(true));
    match protocol {
        Protocol::Rmd => &[
            &[],
            // Brake locked.
            &[BRAKE],
            // Brake open, at rest.
            &[BRAKE, Hear("141#7700000000000000"), Wait(300)],
            // Gains of its own, and deaf to what goes to all.
            &[Hear("141#3200010203040506"), Hear("141#2002000001000000")],
            // Turning, more than once around.
            &[Hear("141#7700000000000000"), Wait(300), Hear("141#A200000050C30000"), Wait(2_000)],
            // The motor's own timeout has struck.
            &[Hear("141#B3000000E8030000"), Hear("141#7700000000000000"), Wait(2_500)],
            // A zero point of its own.
            &[Hear("141#6300000010270000"), Hear("141#7600000000000000"), Wait(3_000)],
        ],
        Protocol::Thruster => &[
            &[Hear("30B#5443000000000000")],
            &[Hear("30B#5443000000000000"), Hear("30B#5443000000000032"), Wait(500)],
            // With an encoder, at zero and elsewhere.
            &[Inject(Injection::Encoder(true))],
            &[Inject(Injection::Encoder(true)), Hear("30B#4C41012C00000384"), Wait(2_000)],
            // It sends current and speed unasked, or all three frames.
            &[Hear("30B#4D4D0000")],
            &[Hear("30B#5352000000070064")],
            // It returns three frames for TC and VC.
            &[Hear("30B#5443000000000000"), Hear("30B#564D000000000007")],
            &[Hear("30B#5443000000000000"), FAULT[0], FAULT[1], FAULT[2]],
            &[Hear("30B#53504D0101020304")],
        ],
        Protocol::D5 => &[
            &[],
            &[Hear("00B#D50B05032058028D"), Wait(500)],
            &[Hear("00B#D50B0504200B0443")],
            &[Hear("00B#D50B040305220039")],
            &[Inject(Injection::BrakeOn(true))],
            &[FAULT[0], FAULT[1], FAULT[2]],
        ],
    }
}

/// A question that changes nothing: what a motor hears in the place of the command.
fn harmless(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Rmd => "141#9A00000000000000",
        Protocol::Thruster => "30B#51560000",
        Protocol::D5 => "00B#D50B040202000013",
    }
}

/// What is asked and done afterwards.
fn afterwards(protocol: Protocol) -> Vec<Step> {
    const RMD: &[&str] = &[
        "141#3000000000000000",
        "141#4200000000000000",
        "141#6000000000000000",
        "141#6100000000000000",
        "141#6200000000000000",
        "141#9200000000000000",
        "141#9A00000000000000",
        "141#9C00000000000000",
        "141#7000000000000000",
        "141#B100000000000000",
        "280#9A00000000000000",
    ];
    const THRUSTER: &[&str] = &[
        "30B#51560000",
        "30B#51410000",
        "30B#51520000",
        "30B#52504C41",
        "30B#52504D01",
        "30B#45460000",
        "30B#46520000",
        "30B#5443000000000005",
        "30B#5643000000000064",
    ];
    const D5: &[&str] = &[
        "00B#D50B040205000016",
        "00B#D50B040210000021",
        "00B#D50B040211000022",
        "00B#D50B040212000023",
        "00B#D50B040215000026",
        "00B#D50B040216000027",
        "00B#D50B050220000032",
        "00B#D50B05022800003A",
        "00B#D50B04022C00003D",
    ];
    let questions: Vec<Step> = match protocol {
        Protocol::Rmd => RMD,
        Protocol::Thruster => THRUSTER,
        Protocol::D5 => D5,
    }
    .iter()
    .map(|text| Hear(text))
    .collect();
    let mut steps = vec![Wait(50)];
    steps.extend(&questions);
    // What is sent without being asked, every 100 ms or every second, and with a fault.
    steps.extend([
        Wait(2_500),
        Inject(Injection::FaultBits(0x0008)),
        Wait(300),
        Inject(Injection::FaultBits(0)),
    ]);
    steps.extend([PowerOffAndOn, Wait(3_000)]);
    steps.extend(&questions);
    steps
}

/// A motor alone.
struct Lone {
    motor: Motor,
    protocol: Protocol,
    serial: bool,
    now: Duration,
}

impl Lone {
    fn new(protocol: Protocol, serial: bool) -> Self {
        let bitrate = match (serial, protocol) {
            (true, _) => 115_200,
            (false, Protocol::D5) => 210_526,
            (false, _) => 1_000_000,
        };
        let wiring =
            MotorWiring { bus: 0, protocol, node: lab::node(protocol), bitrate, can_id: None };
        let motor = if serial { Motor::on_rs485(wiring, 1) } else { Motor::on_can(wiring, 1) };
        Self { motor: motor.unwrap(), protocol, serial, now: Duration::ZERO }
    }

    /// Does a step; what the motor sent meanwhile.
    fn take(&mut self, step: Step) -> Vec<Wire> {
        match step {
            Hear(text) => self.hear(&wire(text)),
            Wait(ms) => self.pass(ms),
            Inject(injection) => {
                self.motor.inject(self.now, injection);
                Vec::new()
            }
            PowerOffAndOn => {
                self.motor.power_cycle(self.now);
                Vec::new()
            }
        }
    }

    fn hear(&mut self, frame: &Wire) -> Vec<Wire> {
        match (frame, self.serial) {
            (Wire::Can(frame), false) => self.motor.hear_frame(self.now, frame),
            (Wire::Serial(bytes), true) => self.hear_bytes(bytes),
            (Wire::Can(frame), true) => {
                let (_, request) = rmd::can::decode_request(frame).unwrap();
                let node = rmd::Node::new(lab::node(self.protocol)).unwrap();
                self.hear_bytes(&rmd::rs485::request(node, &request).unwrap());
            }
            (Wire::Serial(_), false) => panic!("{frame}: this motor is on CAN"),
        }
        self.pass(2)
    }

    fn hear_bytes(&mut self, bytes: &[u8]) {
        const BYTE: Duration = Duration::from_micros(87);
        for byte in bytes {
            self.now += BYTE;
            self.motor.hear_byte(self.now, *byte);
        }
    }

    fn pass(&mut self, ms: u64) -> Vec<Wire> {
        let until = self.now + Duration::from_millis(ms);
        let mut sent = Vec::new();
        while let Some(at) = self.motor.next_event().filter(|at| *at <= until) {
            self.now = at.max(self.now);
            self.motor.advance(self.now);
            sent.extend(std::iter::from_fn(|| self.motor.take_ready(self.now)).map(|out| out.wire));
        }
        self.now = until;
        self.motor.advance(until);
        sent
    }

    /// All that can be seen of it from outside, but its answer to the last question.
    fn shaft(&self) -> String {
        let motor = &self.motor;
        let (speed, position) = (motor.speed_rad_s(), motor.position_rad());
        format!(
            "{speed:.3} rad/s, {position:.3} rad, faults {:04X}, {} bit/s",
            motor.fault_word(),
            motor.bitrate()
        )
    }
}

/// One life of a motor in which it hears `frame` after a preparation: its answer, and what was seen
/// afterwards.
fn life(
    protocol: Protocol,
    serial: bool,
    preparation: &[Step],
    frame: &Wire,
) -> (Vec<Wire>, Vec<String>, Vec<Wire>) {
    let mut motor = Lone::new(protocol, serial);
    let mut sent: Vec<Wire> = preparation.iter().flat_map(|step| motor.take(*step)).collect();
    let mut answer = motor.hear(frame);
    // A brake takes up to 150 ms to open.
    answer.extend(motor.pass(200));
    sent.extend(answer.iter().cloned());
    let mut seen = Vec::new();
    for step in afterwards(protocol) {
        // To all there is a broadcast on CAN only.
        if serial && matches!(step, Hear(text) if text.starts_with("280")) {
            continue;
        }
        let said = motor.take(step);
        seen.push(
            said.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
                + "; "
                + &motor.shaft(),
        );
        sent.extend(said);
    }
    (answer, seen, sent)
}

/// Whether a command does anything in one of the preparations.
pub fn has_effect(protocol: Protocol, frame: &Wire) -> bool {
    let serial = matches!(frame, Wire::Serial(_));
    preparations(protocol).iter().any(|preparation| {
        let (answer, with, _) = life(protocol, serial, preparation, frame);
        let (_, without, _) = life(protocol, serial, preparation, &wire(harmless(protocol)));
        with != without || answer.iter().any(|answer| tells(protocol, frame, answer))
    })
}

/// Whether an answer holds more than the bytes of its question: neither an echo, nor zeros, nor a
/// refusal.
fn tells(protocol: Protocol, question: &Wire, answer: &Wire) -> bool {
    const D5_VALUE: usize = 5;
    let (asked, said) = (data(question), data(answer));
    match protocol {
        Protocol::Rmd => said != asked && said.iter().skip(1).any(|byte| *byte != 0),
        Protocol::Thruster => {
            let value = said.get(4..).unwrap_or_default();
            asked.len() < said.len() && value.iter().any(|byte| *byte != 0)
        }
        Protocol::D5 => {
            let value = |data: &[u8]| data.get(D5_VALUE..7).map(<[u8]>::to_vec).unwrap_or_default();
            value(&asked) != value(&said) && value(&said).iter().any(|byte| *byte != 0)
        }
    }
}

fn data(frame: &Wire) -> Vec<u8> {
    match frame {
        Wire::Can(frame) => frame.data().to_vec(),
        Wire::Serial(bytes) => bytes[3..bytes.len() - 2].to_vec(),
    }
}

/// The replies and events, by command, that motors send in the lives of all their commands.
pub fn sent_unasked(protocol: Protocol) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (_, frame) in
        crate::TABLES.iter().filter(|(_, of)| *of == protocol).flat_map(|(heading, _)| {
            crate::page::Page::read()
                .commands(heading)
                .into_iter()
                .map(|row| (row.command, row.frame))
        })
    {
        if codecs::request(protocol, &frame).is_none() {
            continue;
        }
        for preparation in preparations(protocol) {
            let (_, _, sent) =
                life(protocol, matches!(frame, Wire::Serial(_)), preparation, &frame);
            for meaning in sent.iter().filter_map(|sent| codecs::reply(protocol, sent)) {
                names.extend(meaning.names().iter().cloned());
            }
        }
    }
    names
}
