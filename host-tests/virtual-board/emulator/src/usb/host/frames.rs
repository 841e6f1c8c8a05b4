//! What goes over the bus within a frame, transaction by transaction.

use std::time::Duration;

use rigless::time::VirtualNanos;

use super::control::Ended;
use super::pipe::{self, Packet, Retry};
use super::{FRAME, Host, Transaction, after};
use crate::usb::function::{Handshake, Input, Toggle, UsbFunction};

/// Bits of a frame at 12 Mbit/s.
const BITS_PER_FRAME: u64 = 12_000;
/// Bits of a token or a frame's start, of a data packet without its data, of a handshake, and
/// between packets.
const TOKEN: u64 = 35;
const DATA: u64 = 35;
const HANDSHAKE: u64 = 19;
const BETWEEN: u64 = 7;
/// How long a host waits for an answer that does not come.
const NO_ANSWER: u64 = 18;
/// What the last bits of a frame are kept free for.
const END_OF_FRAME: u64 = 42;
const fn bits(count: u64) -> u64 {
    (count * FRAME).div_ceil(BITS_PER_FRAME)
}

impl Host {
    /// Goes on until nothing more is due. Returns when something is.
    pub(super) fn run_frames(
        &mut self,
        now: VirtualNanos,
        function: &mut dyn UsbFunction,
    ) -> Option<VirtualNanos> {
        loop {
            if let Some((until, _)) = self.transaction {
                if now < until {
                    return Some(until);
                }
                let (at, transaction) = self.transaction.take()?;
                self.go_on_with(at, transaction, function);
            } else if self.next_frame <= now {
                function.start_of_frame(self.frame);
                self.frame = (self.frame + 1) % 2048;
                self.frames += 1;
                let begun = std::mem::replace(&mut self.next_frame, after(now, FRAME));
                self.transaction = Some((after(begun, bits(TOKEN + BETWEEN)), Transaction::Ending));
            } else if !self.begin(now) {
                let retry =
                    [self.out.retry, self.input.retry, self.control.as_ref().and_then(|c| c.retry)];
                let soonest = retry.into_iter().flatten().filter(|at| *at > now).min();
                return Some(soonest.map_or(self.next_frame, |at| at.min(self.next_frame)));
            }
        }
    }

    /// Begins the next transaction, if there is one and it ends within the frame.
    fn begin(&mut self, now: VirtualNanos) -> bool {
        if now < self.quiet_until {
            return false;
        }
        let Some(next) = self.choose(now) else { return false };
        let (decided, most) = match &next {
            Transaction::Setup(_) => (TOKEN + BETWEEN + DATA + 64, TOKEN + DATA + 64),
            Transaction::Out { data, .. } => {
                let length = 8 * data.len() as u64;
                (TOKEN + BETWEEN + DATA + length, TOKEN + DATA + length)
            }
            _ => (TOKEN, TOKEN + DATA + 8 * u64::from(pipe::PACKET)),
        };
        let whole = bits(most + HANDSHAKE + 3 * BETWEEN + END_OF_FRAME);
        if after(now, whole) > self.next_frame {
            return false;
        }
        self.transaction = Some((after(now, bits(decided)), next));
        true
    }

    fn choose(&mut self, now: VirtualNanos) -> Option<Transaction> {
        if let Some(progress) = self.control.as_ref().filter(|progress| progress.retry.due(now)) {
            return Some(progress.next());
        }
        let out = !self.out.queue.is_empty() && self.out.is_due(now);
        let input = self.reads && self.input.is_due(now);
        self.turn_of_out = out && (!input || self.turn_of_out);
        if self.turn_of_out {
            self.turn_of_out = false;
            let data = self.out.queue.front()?.clone();
            return Some(Transaction::Out { control: false, toggle: self.out.toggle, data });
        }
        self.turn_of_out = true;
        input.then_some(Transaction::In { control: false })
    }

    /// The middle of a transaction, where the function decides, or its end.
    fn go_on_with(
        &mut self,
        at: VirtualNanos,
        transaction: Transaction,
        function: &mut dyn UsbFunction,
    ) {
        let address = self.address;
        match transaction {
            Transaction::Ending => {}
            Transaction::Setup(request) => {
                let answer = function.setup(address, 0, request);
                self.handshake(at, true, answer);
            }
            Transaction::Out { control, toggle, data } => {
                let endpoint = if control { 0 } else { self.out.endpoint };
                let answer = function.out(address, endpoint, toggle, &data);
                self.handshake(at, control, answer);
            }
            Transaction::In { control } => {
                let endpoint = if control { 0 } else { self.input.endpoint };
                match function.input(address, endpoint) {
                    Input::Data(toggle, data) => {
                        let length = BETWEEN + DATA + 8 * data.len() as u64 + BETWEEN + HANDSHAKE;
                        let arriving = Transaction::Arriving { control, toggle, data };
                        self.transaction = Some((after(at, bits(length)), arriving));
                    }
                    answer => self.not_given(at, control, &answer),
                }
            }
            Transaction::Arriving { control, toggle, data } => {
                let endpoint = if control { 0 } else { self.input.endpoint };
                function.input_acknowledged(address, endpoint);
                self.arrived(at, control, toggle, data);
                self.transaction = Some((after(at, bits(BETWEEN)), Transaction::Ending));
            }
        }
    }

    /// The answer to what was sent to the device.
    fn handshake(&mut self, at: VirtualNanos, control: bool, answer: Handshake) {
        let end = self.end_by(at, control, answer);
        if !control {
            self.out.answered(end, answer);
        }
    }

    /// Ends a transaction by an answer, and tells the control transfer where it is one of its.
    /// Returns when it has ended.
    fn end_by(&mut self, at: VirtualNanos, control: bool, answer: Handshake) -> VirtualNanos {
        let rest =
            if answer == Handshake::NoResponse { NO_ANSWER } else { 2 * BETWEEN + HANDSHAKE };
        let end = after(at, bits(rest));
        self.transaction = Some((end, Transaction::Ending));
        self.errors.no_response += u32::from(answer == Handshake::NoResponse);
        if control {
            let ended = self.control.as_mut().and_then(|progress| progress.answered(end, answer));
            self.end_control(ended);
        }
        end
    }

    fn not_given(&mut self, at: VirtualNanos, control: bool, answer: &Input) {
        let answer = match answer {
            Input::Stall => Handshake::Stall,
            Input::NoResponse => Handshake::NoResponse,
            Input::Nak | Input::Data(..) => Handshake::Nak,
        };
        let end = self.end_by(at, control, answer);
        if !control {
            self.input.answered(end, answer);
        }
    }

    fn arrived(&mut self, at: VirtualNanos, control: bool, toggle: Toggle, data: Vec<u8>) {
        self.errors.babble += u32::from(data.len() > usize::from(pipe::PACKET));
        if control {
            let Some(progress) = &mut self.control else { return };
            let ended = progress.arrived(toggle, data);
            self.errors.toggles += u32::from(progress.takes_for_repeated());
            self.end_control(ended);
            return;
        }
        self.input.errors = 0;
        if toggle == self.input.toggle {
            self.input.toggle = toggle.next();
            self.received.push(Packet { at: Duration::from_nanos(at.0), data });
        } else {
            self.errors.toggles += 1;
        }
    }

    fn end_control(&mut self, ended: Option<Ended>) {
        if let Some(ended) = ended {
            self.control = None;
            self.ended.push_back(ended);
        }
    }
}
