//! Random requests, replies, noise, faults of buses and cables, and times. What must hold whatever
//! happens is checked at each step: motion only of an active axis, its stop before anything else,
//! one answer to every request, no slot handed out twice, no deadline that has passed. And once
//! everything works again, every stop is confirmed.

mod dice;
mod host;
mod plant;
mod port;

use crate::rig::BOARD;
use dice::Dice;
use gateway::{Event, Gateway, Instant, Outgoing};
use host::{Host, Knowledge, Seen};
use host_protocol::{BusState, CanFrame, MAX_FRAME, Request, requests};
use plant::{BUSES, MOTORS, ToMotor};
use port::Port;

/// Steps of one run: 5 s to 10 s of gateway time.
const STEPS: u32 = 20_000;
/// Frames that a host link may have for its host at one moment.
const MAX_OUTPUT: usize = 200;
/// Longest silence of the hosts: more than the gateway bears.
const SILENCE_US: u64 = 300_000;

struct Run {
    seed: u64,
    step: u32,
    now_us: u64,
    dice: Dice,
    gateway: Gateway,
    port: Port,
    hosts: [Host; 2],
    knowledge: Knowledge,
    /// Requests that come before any random one.
    configuration: std::vec::IntoIter<(u8, Request)>,
    silent_until_us: u64,
    /// Frames given back.
    cancelled: u32,
}

impl Run {
    fn new(seed: u64, now_us: u64) -> Self {
        let hellos = [(0, host::hello(1)), (1, host::hello(2))];
        let configuration = host::configuration().into_iter().map(|request| (0, request));
        let mut gateway = Gateway::new(&BOARD, Some(0));
        gateway.handle(
            Instant::from_micros(now_us),
            Event::EStopInput { open: false },
            &mut |_, _| {},
        );
        Self {
            seed,
            step: 0,
            now_us,
            dice: Dice::new(seed),
            gateway,
            port: Port::default(),
            hosts: [Host::new(), Host::new()],
            knowledge: Knowledge::default(),
            configuration: hellos.into_iter().chain(configuration).collect::<Vec<_>>().into_iter(),
            silent_until_us: 0,
            cancelled: 0,
        }
    }

    fn step(&mut self) {
        self.act();
        self.go_on();
    }

    /// Nothing fails any more, and an e-stop finds every axis.
    fn settle(&mut self) {
        const WITHIN_US: u64 = 10_000_000;
        self.port.mend();
        self.ask(1, Request::EStop(requests::EStop {}));
        let end_us = self.now_us + WITHIN_US;
        while !self.knowledge.all_at_rest() {
            assert!(self.now_us < end_us, "not at rest: {:?}", self.knowledge);
            self.go_on();
        }
    }

    fn go_on(&mut self) {
        self.step += 1;
        self.transmit();
        self.advance();
        if !self.deliver() {
            self.feed(Event::Tick);
        }
        for host in &self.hosts {
            assert_eq!(host.unanswered(self.now_us), None, "not answered");
        }
    }

    fn feed(&mut self, event: Event<'_>) {
        self.gateway.handle(Instant::from_micros(self.now_us), event, &mut |_, _| {});
        self.listen();
        for (bus, index) in (0..).zip(0..BUSES) {
            let generation = self.gateway.bus_setup(bus).map(|setup| setup.generation);
            if self.port.generations[index] != generation {
                self.port.generations[index] = generation;
                self.port.drop_frames(bus);
                self.bus_state(bus, BusState::Active);
            }
        }
    }

    fn bus_state(&mut self, bus: u8, state: BusState) {
        self.feed(Event::BusState { bus, state, transmit_errors: 0, receive_errors: 0 });
    }

    /// The hosts read all there is.
    fn listen(&mut self) {
        let mut out = [0; MAX_FRAME];
        for (link, host) in (0..).zip(&mut self.hosts) {
            let mut frames = 0;
            while let Some(length) = self.gateway.poll_host(link, &mut out, &mut |_, _| {}) {
                frames += 1;
                assert!(frames <= MAX_OUTPUT, "link {link} does not stop talking");
                host.hear(&out[..length], &mut self.knowledge, link == 0);
            }
        }
    }

    fn ask(&mut self, link: u8, request: Request) {
        let bytes = self.hosts[usize::from(link)].ask(self.now_us, request);
        self.feed(Event::HostBytes { link, bytes: &bytes });
    }

    /// Something happens, or nothing.
    fn act(&mut self) {
        if let Some((link, request)) = self.configuration.next() {
            return self.ask(link, request);
        }
        match self.dice.below(100) {
            0..35 => {
                let link = u8::from(self.dice.one_in(500));
                if self.now_us > self.silent_until_us && self.hosts[usize::from(link)].may_ask() {
                    let request = host::any_request(&mut self.dice, self.now_us, &self.knowledge);
                    self.ask(link, request);
                }
            }
            35 => self.fail(),
            36 => {
                let axis = self.dice.index(MOTORS.len());
                let mute = self.dice.percent(4);
                self.port.set_mute(axis, mute);
            }
            37 => self.stray_frame(),
            38 => {
                let noise = self.dice.bytes(20);
                self.feed(Event::SerialReceived { bus: 2, bytes: &noise });
            }
            39 => {
                let slot = self.dice.byte().max(2); // one that no frame was taken with
                let bus = self.dice.pick(&[0, 1, 2, 3, 4]);
                self.feed(Event::Transmitted { bus, slot });
            }
            40 => {
                let past =
                    Instant::from_micros(self.now_us.saturating_sub(self.dice.below(100_000)));
                self.gateway.handle(past, Event::Tick, &mut |_, _| {});
                self.listen();
            }
            _ => {}
        }
    }

    /// The hosts fall silent, a bus goes off, or a cable is cut.
    fn fail(&mut self) {
        let bus = self.dice.pick(&[0, 1]);
        match self.dice.below(200) {
            0..4 => self.silent_until_us = self.now_us + SILENCE_US,
            4..6 => {
                self.port.drop_frames(bus);
                self.bus_state(bus, BusState::BusOff);
            }
            6..10 => {
                let longest_us = self.dice.pick(&[30_000, 1_000_000, 6_000_000]);
                let for_us = self.dice.below(longest_us);
                self.port.cut(self.now_us, bus, for_us);
            }
            _ => {}
        }
    }

    /// A frame nobody asked for, mostly with a motor's id, often looking like a reply.
    fn stray_frame(&mut self) {
        let id = self.dice.pick(&[0x241, 0x242, 0x28E, 0x28F, 0x26, 0x301, 0x500]);
        let mut data = self.dice.bytes(9);
        if let Some(first) = data.first_mut().filter(|_| self.dice.percent(50)) {
            *first = self.dice.pick(&[0x80, 0x81, 0x9A, 0x9C, 0x5D]);
        }
        let bus = self.dice.pick(&[0, 1]);
        self.feed(Event::CanReceived { bus, frame: CanFrame::standard(id, &data).unwrap() });
    }

    fn transmit(&mut self) {
        for bus in (0..).take(BUSES) {
            while let Some(slot) = self.gateway.poll_cancel(Instant::from_micros(self.now_us), bus)
            {
                if self.port.give_back(self.now_us, bus, slot) {
                    self.cancelled += 1;
                    self.feed(Event::Cancelled { bus, slot });
                }
            }
            let mut frames = 0;
            while let Some(transmit) =
                self.gateway.poll_transmit(Instant::from_micros(self.now_us), bus)
            {
                frames += 1;
                assert!(
                    frames <= gateway::port::TRANSMIT_SLOTS,
                    "bus {bus} is handed more than it can hold"
                );
                self.listen();
                if let Some(request) = ToMotor::read(bus, &transmit.frame) {
                    self.knowledge.judge(request.axis, request.purpose());
                }
                self.port.take(self.now_us, bus, transmit, &mut self.dice);
            }
        }
    }

    /// On to the next event, or a little further or less far.
    fn advance(&mut self) {
        const LONGEST_US: u64 = 20_000;
        let deadline = self.gateway.next_deadline().map(Instant::as_micros);
        assert!(
            deadline.is_none_or(|at| at > self.now_us),
            "deadline {deadline:?} at {}",
            self.now_us
        );
        let next = [deadline, self.port.next_us()].into_iter().flatten().min();
        let anywhere = self.now_us + self.dice.below(300);
        self.now_us = match next {
            Some(next) if self.dice.percent(60) => {
                next.clamp(self.now_us, self.now_us + LONGEST_US)
            }
            _ => anywhere,
        };
    }

    /// Delivers what has arrived; says whether anything has.
    fn deliver(&mut self) -> bool {
        let mut delivered = false;
        while let Some(held) = self.port.left(self.now_us, &mut self.dice) {
            delivered = true;
            if let Outgoing::Serial(bytes) = &held.frame {
                self.echo(held.bus, bytes.to_vec());
            }
            self.feed(Event::Transmitted { bus: held.bus, slot: held.slot });
        }
        while let Some(reply) = self.port.arrived(self.now_us) {
            delivered = true;
            let bus = reply.bus();
            match reply.id() {
                Some(id) => {
                    let frame = CanFrame::standard(id, &reply.data).unwrap();
                    self.feed(Event::CanReceived { bus, frame });
                }
                None => self.feed(Event::SerialReceived { bus, bytes: &reply.serial() }),
            }
        }
        delivered
    }

    /// Our own bytes come back, in two parts, now and then with a wrong bit or not at all.
    fn echo(&mut self, bus: u8, mut bytes: Vec<u8>) {
        if self.dice.percent(3) && !bytes.is_empty() {
            let index = self.dice.index(bytes.len());
            bytes[index] ^= self.dice.pick(&[1, 2, 4, 8, 16, 32, 64, 128]);
        }
        if self.dice.percent(2) {
            bytes.clear();
        }
        let (first, second) = bytes.split_at(self.dice.index(bytes.len() + 1));
        self.feed(Event::SerialReceived { bus, bytes: first });
        self.feed(Event::SerialReceived { bus, bytes: second });
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("seed {}, step {}, {} µs", self.seed, self.step, self.now_us);
        }
    }
}

/// Runs every seed from a time on, and sees to it that they reached what they are to check.
fn run_all(seeds: impl IntoIterator<Item = u64>, start_us: u64) {
    let mut total = Seen::default();
    let mut cancelled = 0;
    for seed in seeds {
        let mut run = Run::new(seed, start_us);
        for _ in 0..STEPS {
            run.step();
        }
        run.settle();
        cancelled += run.cancelled;
        let Seen { motion, trips, confirmed, unreachable } = run.knowledge.seen;
        total.motion += motion;
        total.trips += trips;
        total.confirmed += confirmed;
        total.unreachable += unreachable;
    }
    let Seen { motion, trips, confirmed, unreachable } = total;
    assert!(motion > 1_000 && trips > 100 && confirmed > 100 && unreachable > 0, "{total:?}");
    assert!(cancelled > 3, "{cancelled} frames given back");
}

#[test]
fn whatever_happens_only_active_axes_move_and_every_stop_goes_first() {
    run_all([1, 3, 5, 7, 3030], 1_000);
}

#[test]
fn it_makes_no_difference_that_the_32_bit_time_wraps_around() {
    run_all([2, 4, 6, 8], (1 << 32) - 1_000_000);
}
