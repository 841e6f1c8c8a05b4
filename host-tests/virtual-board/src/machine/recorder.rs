//! What the emulation's thread keeps for the test: the log, a digest of all accesses, hits, the
//! outputs, and what the retained RAM will hold after a reset.

use rigless::emulator::{Access, AccessKind, Hit, HitKind, Host};
use rigless::snapshot::store;
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::flash::FlashLog;
use super::retention::Retention;
use crate::board::Board;
use crate::pins::OutputLog;
use virtual_stm32::Chip;

/// How often the RTT channel is drained; on an absolute grid, so that no order of the test changes
/// the run.
const DRAIN_PERIOD: u64 = 1_000_000;
/// FNV-1a, 64 bits.
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// SEGGER's RTT control block: the identifier, then the number of channels each way, then the
/// channels.
const RTT_IDENTIFIER: [u8; 16] = *b"SEGGER RTT\0\0\0\0\0\0";
const RTT_UP_CHANNEL: u64 = 24;
/// Offsets in a channel.
const CHANNEL_BUFFER: u64 = 4;
const CHANNEL_SIZE: u64 = 8;
const CHANNEL_WRITE: u64 = 12;
const CHANNEL_READ: u64 = 16;

/// The record of one run.
#[derive(Debug, Serialize, Deserialize)]
pub struct Recorder {
    digest: u64,
    /// Where the image keeps its RTT control block.
    rtt_block: Option<u64>,
    rtt: Vec<u8>,
    outputs: OutputLog,
    retention: Retention,
    flash: FlashLog,
    /// Where faults are planted.
    planted_at: u64,
    strike: Option<VirtualNanos>,
    #[serde(skip)]
    hits: Vec<Hit>,
}

store!(Recorder);

impl Recorder {
    /// Of a board whose image has its RTT control block at that address.
    pub fn new(rtt_block: Option<u64>, board: Board) -> Self {
        Self {
            digest: FNV_OFFSET,
            rtt_block,
            rtt: Vec::new(),
            outputs: OutputLog::default(),
            retention: Retention::new(board.retained_ram),
            flash: FlashLog::new(board),
            planted_at: board.free_flash,
            strike: None,
            hits: Vec::new(),
        }
    }

    /// The next instant of the grid after `now`.
    pub fn next_drain(now: VirtualNanos) -> VirtualNanos {
        VirtualNanos((now.0 / DRAIN_PERIOD + 1) * DRAIN_PERIOD)
    }

    /// An access of the core, which may have changed a pin.
    pub fn access(&mut self, access: &Access, value: u64, part: &Chip) {
        if let (AccessKind::Write, Some(port)) = (access.kind, part.port_at(access.address)) {
            self.outputs.look(part, port, access.virtual_time);
        }
        self.flash.access(access);
        let kind = match access.kind {
            AccessKind::Read => 0,
            AccessKind::Write => 1,
        };
        let width = u64::from(access.width.bits());
        for word in
            [access.instruction_count, access.virtual_time.0, kind, width, access.address, value]
        {
            self.digest = (self.digest ^ word).wrapping_mul(FNV_PRIME);
        }
    }

    /// A hit of a watch. Stores into the retained RAM and planted faults are always watched, and no
    /// test's.
    pub fn hit(&mut self, hit: Hit, host: &mut dyn Host) {
        match hit.kind {
            HitKind::Write if self.retention.holds(hit.address) => {
                self.retention.written(hit.address, host)
            }
            HitKind::Instruction if hit.address == self.planted_at => {
                self.strike.get_or_insert(hit.at);
            }
            HitKind::Write | HitKind::Instruction => self.hits.push(hit),
        }
    }

    /// When a planted fault struck first.
    pub fn strike(&self) -> Option<VirtualNanos> {
        self.strike
    }

    /// Another fault is planted.
    pub fn forget_strike(&mut self) {
        self.strike = None;
    }

    /// The part was reset, or is held in reset.
    pub fn reset(&mut self, part: &Chip, at: VirtualNanos, host: &mut dyn Host) {
        // Start-up code sets the log's memory up anew: take what is in it before the core starts
        // again.
        self.drain(host);
        self.retention.reset(host);
        self.outputs.look_at_all(part, at);
    }

    /// The supply has come.
    pub fn power_up(&mut self, host: &mut dyn Host) {
        self.retention.power_up(host);
    }

    /// What the flash was told to do.
    pub(super) fn flash(&self) -> &FlashLog {
        &self.flash
    }

    /// What the firmware has driven on its outputs.
    pub(super) fn outputs(&self) -> &OutputLog {
        &self.outputs
    }

    /// The hits since the last call.
    pub fn take_hits(&mut self) -> Vec<Hit> {
        std::mem::take(&mut self.hits)
    }

    /// Whether there are any.
    pub(super) fn has_hits(&self) -> bool {
        !self.hits.is_empty()
    }

    /// Of all accesses so far.
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// Hands over what was drained since the last call.
    pub fn take_rtt(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.rtt)
    }

    /// Takes what the firmware has written to up channel 0, as a debug probe does. Nothing before
    /// start-up code has set the control block up.
    pub fn drain(&mut self, host: &mut dyn Host) {
        let Some(block) = self.rtt_block else { return };
        if self.drain_channel(host, block).is_none() {
            self.rtt_block = None;
        }
    }

    fn drain_channel(&mut self, host: &mut dyn Host, block: u64) -> Option<()> {
        let mut word = |address: u64| host.read(address, Width::W32).ok();
        let mut identifier = Vec::with_capacity(RTT_IDENTIFIER.len());
        for offset in (0..16).step_by(4) {
            identifier.extend_from_slice(&u32::try_from(word(block + offset)?).ok()?.to_le_bytes());
        }
        if identifier != RTT_IDENTIFIER {
            return Some(());
        }
        let channel = block + RTT_UP_CHANNEL;
        let buffer = word(channel + CHANNEL_BUFFER)?;
        let size = word(channel + CHANNEL_SIZE)?;
        let write = word(channel + CHANNEL_WRITE)?;
        let mut read = word(channel + CHANNEL_READ)?;
        if read >= size || write >= size || read == write {
            return Some(());
        }
        while read != write {
            let byte = host.read(buffer + read, Width::W8).ok()?;
            self.rtt.push(byte.to_le_bytes()[0]);
            read = (read + 1) % size;
        }
        host.write(channel + CHANNEL_READ, Width::W32, read).ok()
    }
}
