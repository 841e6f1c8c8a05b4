//! What the firmware does to its flash, and what a loss of power leaves of it.

use std::time::Duration;

use rigless::emulator::{Access, AccessKind, Host};
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::{Machine, nanos};
use crate::board::Board;
use crate::nodes::{instant, since_start};

/// How long the supply is away.
pub(super) const OFF: Duration = Duration::from_millis(100);

/// An erasure at most.
const ERASURE: Duration = Duration::from_secs(4);

/// Something that the flash was told to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlashOperation {
    /// When it began, since the board was switched on.
    pub at: Duration,
    /// Its first address.
    pub address: u64,
    /// What is written there; nothing: the page is erased.
    pub word: Option<Vec<u8>>,
}

/// All of them, as the core's accesses tell.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct FlashLog {
    board: Board,
    pub(super) operations: Vec<FlashOperation>,
}

impl FlashLog {
    pub(super) fn new(board: Board) -> Self {
        Self { board, operations: Vec::new() }
    }

    /// When the operation of that number, from 0 on, is half over; nothing where it has not begun.
    pub(super) fn midst_of(&self, number: usize) -> Option<VirtualNanos> {
        let operation = self.operations.get(number)?;
        let half = self.board.flash.times[usize::from(operation.word.is_some())] / 2;
        Some(instant(operation.at + half))
    }

    /// An access of the core.
    pub(super) fn access(&mut self, access: &Access) {
        let AccessKind::Write = access.kind else { return };
        let flash = self.board.flash;
        let at = since_start(access.virtual_time);
        let bank = flash.banks.iter().find(|(_, control)| *control == access.address);
        if let Some((bank, _)) = bank {
            if access.value & flash.erase != 0 {
                let (shift, bits) = flash.page_field;
                let page = access.value >> shift & bits;
                let address = bank + page * flash.page as u64;
                self.operations.push(FlashOperation { at, address, word: None });
            }
        } else if flash.holds(access.address) {
            let bytes = access.value.to_le_bytes();
            let bytes = &bytes[..access.width.bytes() as usize];
            match self.operations.last_mut() {
                Some(FlashOperation { word: Some(word), .. }) if word.len() < flash.word => {
                    word.extend(bytes);
                }
                _ => self.operations.push(FlashOperation {
                    at,
                    address: access.address,
                    word: Some(bytes.to_vec()),
                }),
            }
        }
    }
}

impl FlashOperation {
    /// What is left of it in the middle. An erasure sets bits, each in its own time, a word clears
    /// them. Every second seed leaves words of which the error-correcting code can make nothing: the
    /// firmware reads them as zeros, which the emulator, whose reads no model sees, has there
    /// instead.
    pub(super) fn tear(&self, page: usize, word: usize, seed: u64, host: &mut dyn Host) {
        let mut random = fastrand::Rng::with_seed(seed);
        let hidden = seed.is_multiple_of(2);
        let length = self.word.as_ref().map_or(page, Vec::len);
        let mut is_hidden = false;
        for (offset, at) in (self.address..).take(length).enumerate() {
            let old = host.read(at, Width::W8).expect("flash").to_le_bytes()[0];
            if offset % word == 0 {
                let mut bytes = (at..).take(word).map(|at| host.read(at, Width::W8));
                let is_erased = bytes.all(|byte| byte.is_ok_and(|byte| byte == 0xFF));
                is_hidden = hidden && (self.word.is_some() || (!is_erased && random.bool()));
            }
            let torn = match &self.word {
                _ if is_hidden => 0,
                Some(word) => old & (word[offset] | random.u8(..)),
                None => old | random.u8(..),
            };
            host.program(at, Width::W8, torn.into()).expect("flash");
        }
    }
}

impl Machine {
    /// What the flash was told to do since the board was switched on first.
    pub fn flash_operations(&mut self) -> Vec<FlashOperation> {
        self.core.order(|_, _, _, recorder| recorder.flash().operations.clone())
    }

    /// Runs until the flash has been told so many things; false where it is not in that time.
    pub fn run_until_flash_operation(&mut self, count: usize, limit: Duration) -> bool {
        let end = self.now() + limit;
        loop {
            let (done, erases) = self.core.order(|_, _, _, recorder| {
                let operations = &recorder.flash().operations;
                (operations.len(), operations.last().is_some_and(|last| last.word.is_none()))
            });
            if done >= count || self.now() >= end {
                return done >= count;
            }
            // Less than half of what a word takes; of many, less than all but the last.
            let before = u32::try_from(count - done - 1).unwrap_or(u32::MAX);
            let least = Duration::from_micros(if erases && before > 0 { 200 } else { 20 });
            let all_but_one = self.board().flash.times[1] * before.saturating_sub(1) * 3 / 4;
            self.run_for(all_but_one.max(least).min(end - self.now()));
        }
    }

    /// Runs into the midst of the flash's operation of that number, of those since the board was
    /// switched on first; which it is. Nothing where it does not begin in that time.
    /// Panics if it is over.
    pub fn run_into_flash_operation(
        &mut self,
        number: usize,
        limit: Duration,
    ) -> Option<FlashOperation> {
        let end = VirtualNanos(self.reached.0.saturating_add(nanos(limit)));
        self.core.run_into_flash_operation(number, end);
        self.reached = self.reached.max(self.core.stop().at);
        let (operation, midst, count) = self.core.order(move |_, _, _, recorder| {
            let log = recorder.flash();
            (log.operations.get(number).cloned(), log.midst_of(number), log.operations.len())
        });
        let half = self.board().flash.times[usize::from(operation.as_ref()?.word.is_some())] / 2;
        let is_under_way = count == number + 1 && self.now() < since_start(midst?) + half;
        assert!(is_under_way, "the operation is over");
        operation
    }

    /// Lets half of the time of the flash's last operation pass, cuts the board's supply in the
    /// middle of it, and gives it back after a while. The seed says what is left of the operation.
    /// Panics if that is over.
    pub fn cut_power_in_flash_operation(&mut self, seed: u64) {
        let number = self.flash_operations().len() - 1;
        let operation = self.run_into_flash_operation(number, ERASURE).expect("it has begun");
        let flash = self.board().flash;
        let at = instant(self.now());
        self.part_mut().supply(at, false);
        self.run_for(OFF);
        self.core.order(move |_, host, _, recorder| {
            operation.tear(flash.page, flash.word, seed, host);
            recorder.power_up(host);
        });
        let at = instant(self.now());
        self.part_mut().supply(at, true);
    }
}
