//! One bus: the controller that holds our frames, the wire, and who else sends on it.

use crate::motor::Answer;
use crate::plant::{BUS_SETUP, KINDS, Wired};
use embedded_can::Id;
use gateway::{Outgoing, Transmit};
use host_protocol::CanFrame;
use promise_model::{BusKind, EXTENDED, is_extended, rank};

/// Idle time before a frame on a serial line, bits.
const PAUSE_BITS: usize = 20;

/// A frame on the wire.
#[derive(Debug, Clone, PartialEq)]
pub enum OnWire {
    /// Ours, in this slot.
    Ours { slot: u8, frame: Outgoing, garbled: bool },
    /// Somebody else's.
    Can { id: u32, data: Vec<u8> },
    /// Bytes of a motor.
    Serial(Vec<u8>),
}

/// What will be sent by others, from when on.
#[derive(Debug, Clone)]
struct Coming {
    at_us: u64,
    what: OnWire,
}

/// Another node that loads the bus.
#[derive(Debug, Clone)]
struct Foreign {
    id: u32,
    length: usize,
    pause_us: u64,
    next_us: u64,
    until_us: u64,
}

/// The id of a frame as the model knows it.
pub fn arbitration(frame: &CanFrame) -> u32 {
    match frame.id() {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw() | EXTENDED,
    }
}

/// The frame with such an id; `None` where there is none.
pub fn can_frame(id: u32, data: &[u8]) -> Option<CanFrame> {
    if is_extended(id) {
        return CanFrame::extended(id & !EXTENDED, data);
    }
    CanFrame::standard(u16::try_from(id).ok()?, data)
}

/// Who wins the arbitration: with one id, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Sender {
    Load(usize),
    Motor(usize),
    Ours(usize),
}

/// One bus.
#[derive(Debug, Clone)]
pub struct Bus {
    is_can: bool,
    bitrate: u64,
    held: Vec<Transmit>,
    /// Bytes of our latest frame, and what the gateway has heard since it began.
    line: (usize, usize),
    /// When the frame begins whose reply has come.
    begins_us: Option<u64>,
    sending: Option<(u64, OnWire)>,
    coming: Vec<Coming>,
    foreign: Vec<Foreign>,
    cut_until: u64,
    pub short_until: u64,
    /// Its controller went off and was not started since.
    pub is_off: bool,
    pub stubborn_until: u64,
    pub generation: Option<u32>,
}

impl Bus {
    pub fn new(index: usize) -> Self {
        Self {
            is_can: KINDS[index] == BusKind::Can,
            bitrate: BUS_SETUP[index].0.into(),
            held: Vec::new(),
            line: (0, 0),
            begins_us: None,
            sending: None,
            coming: Vec::new(),
            foreign: Vec::new(),
            cut_until: 0,
            short_until: 0,
            is_off: false,
            stubborn_until: 0,
            generation: None,
        }
    }

    fn bits_us(&self, bits: usize) -> u64 {
        (u64::try_from(bits).unwrap_or(0) * 1_000_000).div_ceil(self.bitrate)
    }

    /// How long a frame is on the wire: on CAN with all the stuff bits that there can be.
    fn length_us(&self, what: &OnWire) -> u64 {
        let (id, bytes) = match what {
            OnWire::Ours { frame: Outgoing::Can(frame), .. } => {
                (arbitration(frame), frame.data().len())
            }
            OnWire::Ours { frame: Outgoing::Serial(bytes), .. } => (0, bytes.len()),
            OnWire::Can { id, data } => (*id, data.len()),
            OnWire::Serial(bytes) => (0, bytes.len()),
        };
        let header = if is_extended(id) { 80 } else { 55 };
        self.bits_us(if self.is_can { header + 10 * bytes } else { 10 * bytes })
    }

    /// Slots of the frames that the controller holds.
    pub fn slots(&self) -> Vec<u8> {
        self.held.iter().map(|held| held.slot).collect()
    }

    /// The controller takes a frame.
    pub fn take(&mut self, transmit: Transmit) {
        self.held.push(transmit);
    }

    /// Whether the controller gives a frame back: not one that is on the wire.
    pub fn give_back(&mut self, now: u64, slot: u8) -> bool {
        let is_sent =
            matches!(&self.sending, Some((_, OnWire::Ours { slot: sent, .. })) if *sent == slot);
        if is_sent || now < self.stubborn_until || self.begins_us.is_some() {
            return false;
        }
        let before = self.held.len();
        self.held.retain(|held| held.slot != slot);
        self.held.len() < before
    }

    /// The controller starts anew: it forgets what it held.
    pub fn forget(&mut self) {
        self.held.clear();
        self.begins_us = None;
        self.sending = self.sending.take().filter(|(_, what)| !matches!(what, OnWire::Ours { .. }));
    }

    /// The gateway hears so many bytes. Returns the frame that waits for them, if they end the reply:
    /// it begins behind the pause.
    pub fn hears(&mut self, now: u64, bytes: usize) -> Option<Outgoing> {
        self.line.1 += bytes;
        let (own, heard) = self.line;
        let held = self.held.first_mut().filter(|held| held.behind_reply)?;
        let Outgoing::Serial(next) = &held.frame else { return None };
        if heard != own + next.len() {
            return None;
        }
        held.behind_reply = false;
        let frame = held.frame.clone();
        self.begins_us = Some(now + self.bits_us(PAUSE_BITS));
        Some(frame)
    }

    /// Who answers now is not heard: the gateway starts.
    pub fn is_not_heard(&mut self) {
        self.coming.clear();
    }

    /// Nobody acknowledges and nothing arrives until then.
    pub fn cut(&mut self, until: u64) {
        self.cut_until = until;
        self.sending = None;
        self.coming.clear();
    }

    /// Cable and controller are whole, and nobody else sends.
    pub fn mend(&mut self) {
        (self.cut_until, self.short_until, self.stubborn_until) = (0, 0, 0);
        self.foreign.clear();
    }

    pub fn load(&mut self, now: u64, id: u32, length: u8, (pause_us, for_us): (u64, u64)) {
        let length = usize::from(length).min(8);
        self.foreign.push(Foreign { id, length, pause_us, next_us: now, until_us: now + for_us });
    }

    /// Somebody sends something, as soon as the bus lets it.
    pub fn stray(&mut self, now: u64, what: OnWire) {
        self.coming.push(Coming { at_us: now, what });
    }

    /// A motor answers. `own_id`: of the frames of a D5.
    pub fn answer(&mut self, now: u64, motor: Wired, own_id: u32, answer: Answer) {
        let Wired { node, protocol, .. } = motor;
        let what = if self.is_can {
            let id = match protocol {
                host_protocol::Protocol::Rmd if answer.motion_mode => 0x500 + u32::from(node),
                host_protocol::Protocol::Rmd => 0x240 + u32::from(node),
                host_protocol::Protocol::Thruster => 0x280 + u32::from(node),
                host_protocol::Protocol::D5 => own_id,
            };
            OnWire::Can { id, data: answer.data }
        } else {
            let mut bytes = vec![0x3E, node, 8];
            bytes.extend(answer.data);
            bytes.extend(crc16(&bytes).to_le_bytes());
            OnWire::Serial(bytes)
        };
        self.coming.push(Coming { at_us: now + answer.after_us, what });
    }

    /// Begins what can begin now.
    pub fn begin(&mut self, now: u64) {
        self.foreign.retain(|foreign| now < foreign.until_us);
        if now < self.cut_until || now < self.short_until {
            // Who answers into a cut cable is not heard.
            self.coming.retain(|coming| coming.at_us > now);
            return;
        }
        if !self.is_can {
            return self.begin_serial(now);
        }
        if self.sending.is_some() {
            return;
        }
        let ours = self.held.iter().enumerate().filter_map(|(index, held)| match &held.frame {
            Outgoing::Can(frame) => Some((arbitration(frame), index)),
            Outgoing::Serial(_) => None,
        });
        let others =
            self.coming.iter().enumerate().filter_map(|(index, coming)| match &coming.what {
                OnWire::Can { id, .. } if coming.at_us <= now => Some((*id, index)),
                _ => None,
            });
        let ready = self.foreign.iter().enumerate().filter(|(_, foreign)| foreign.next_us <= now);
        let loads = ready.map(|(index, foreign)| (foreign.id, Sender::Load(index)));
        let ours = ours.map(|(id, index)| (id, Sender::Ours(index)));
        let others = others.map(|(id, index)| (id, Sender::Motor(index)));
        let Some((_, sender)) =
            ours.chain(others).chain(loads).min_by_key(|(id, sender)| (rank(*id), *sender))
        else {
            return;
        };
        let what = match sender {
            Sender::Ours(index) => {
                let Transmit { slot, frame, .. } = self.held[index].clone();
                OnWire::Ours { slot, frame, garbled: false }
            }
            Sender::Motor(index) => self.coming.remove(index).what,
            Sender::Load(index) => {
                let Foreign { id, length, .. } = self.foreign[index];
                let what = OnWire::Can { id, data: vec![0x55; length] };
                self.foreign[index].next_us =
                    now + self.length_us(&what) + self.foreign[index].pause_us;
                what
            }
        };
        self.sending = Some((now + self.length_us(&what), what));
    }

    fn begin_serial(&mut self, now: u64) {
        let ready = self.coming.iter().position(|coming| coming.at_us <= now);
        if let Some(index) = ready {
            match &mut self.sending {
                // Who answers into our frame spoils both.
                Some((_, OnWire::Ours { garbled, .. })) => {
                    *garbled = true;
                    self.coming.remove(index);
                }
                Some(_) => {}
                None => {
                    let what = self.coming.remove(index).what;
                    self.sending = Some((now + self.length_us(&what), what));
                }
            }
        }
        let waits =
            |held: &&Transmit| held.behind_reply || self.begins_us.is_some_and(|at| now < at);
        let held = self.held.first().filter(|held| !waits(held)).cloned();
        if let Some(Transmit { slot, frame, .. }) = held {
            let garbled = match &self.sending {
                Some((_, OnWire::Ours { .. })) => return,
                Some(_) => true,
                None => false,
            };
            let what = OnWire::Ours { slot, frame, garbled };
            self.begins_us = None;
            if let OnWire::Ours { frame: Outgoing::Serial(bytes), .. } = &what {
                self.line = (bytes.len(), 0);
            }
            self.sending = Some((now + self.length_us(&what), what));
        }
    }

    /// What has come to its end.
    pub fn ended(&mut self, now: u64) -> Option<OnWire> {
        let (_, what) = self.sending.take_if(|(ends_us, _)| *ends_us <= now)?;
        if let OnWire::Ours { slot, .. } = what {
            self.held.retain(|held| held.slot != slot);
        }
        Some(what)
    }

    /// When something begins or ends next, after `now`.
    pub fn next_us(&self, now: u64) -> Option<u64> {
        let ends = self.sending.as_ref().map(|(ends_us, _)| *ends_us);
        let begins = self.coming.iter().map(|coming| coming.at_us).filter(|at| *at > now).min();
        let foreign =
            self.foreign.iter().map(|foreign| foreign.next_us).filter(|at| *at > now).min();
        let mended = [self.cut_until, self.short_until].into_iter().filter(|at| *at > now).min();
        let ours = self.begins_us.filter(|at| *at > now);
        [ends, begins, foreign, mended, ours].into_iter().flatten().min()
    }
}

/// CRC-16/MODBUS.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte), |sum, _| {
            if sum & 1 == 1 { (sum >> 1) ^ 0xA001 } else { sum >> 1 }
        })
    })
}
