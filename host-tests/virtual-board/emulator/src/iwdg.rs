//! A model of the independent watchdog of the STM32H743: it resets the part unless it is fed.
//!
//! Sources: the registers in the emulator's table of the SVD file and in stm32-metapac 21
//! (`iwdg_v2`), the keys and their order in embassy-stm32 0.6.0 (`wdg`); the crossing of five
//! cycles after the emulator's model of the same watchdog in the STM32F427, which cites its manual.
//! The clock is the LSI, which starting the watchdog switches on.
//!
//! | Register | Behaviour |
//! |---|---|
//! | KR | 0xCCCC starts it, for good; 0xAAAA loads the counter; 0x5555 opens PR, RLR and WINR, anything else closes them |
//! | PR, RLR, WINR | reach the counter five LSI cycles after they were written; SR says so; until then they read as before |
//! | counter | 0xFFF at the start; at 0 the part is reset; fed above the window too |
//!
//! Not modelled: the option bytes that start it by hardware or stop it in standby, and the debug
//! freeze bits.

#[cfg(test)]
mod tests;

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::time::{EventId, NANOS_PER_SECOND, VirtualNanos};
use serde::{Deserialize, Serialize};

/// The request with which it switches the LSI on; `rcc::IWDG_STARTED` of the emulator.
const STARTED: usize = 0;
/// Keys of KR.
const OPEN: u64 = 0x5555;
const FEED: u64 = 0xAAAA;
const START: u64 = 0xCCCC;
/// RLR and WINR after a reset: 12 bits of ones. As a window it is none.
const FULL: u64 = 0xFFF;
/// LSI cycles after which a written value has reached the counter.
const CROSSING_CYCLES: u64 = 5;
/// Bits of SR.
const PVU: u64 = 1 << 0;
const RVU: u64 = 1 << 1;
const WVU: u64 = 1 << 2;

/// A value on its way to the counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Setting {
    /// What the counter uses.
    active: u64,
    /// What was written.
    written: u64,
    /// On its way; with a clock it arrives at that instant.
    crossing: Option<Option<VirtualNanos>>,
}

impl Setting {
    const fn at_reset(value: u64) -> Self {
        Self { active: value, written: value, crossing: None }
    }

    /// Written; one that is on its way already stays as it is.
    fn write(&mut self, value: u64, arrives: Option<VirtualNanos>) {
        if self.crossing.is_none() {
            self.written = value;
            self.crossing = Some(arrives);
        }
    }

    /// Whether it arrives now.
    fn arrive(&mut self, now: VirtualNanos) -> bool {
        let arrives = self.crossing.flatten().is_some_and(|instant| instant <= now);
        if arrives {
            self.active = self.written;
            self.crossing = None;
        }
        arrives
    }
}

/// The watchdog.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Iwdg {
    open: bool,
    started: bool,
    prescaler: Setting,
    reload: Setting,
    window: Setting,
    /// The counter stood at `count` at `since`.
    count: u64,
    since: VirtualNanos,
    /// The LSI, 0 while it does not run.
    hz: u64,
}

store!(Iwdg);

impl Default for Iwdg {
    fn default() -> Self {
        Self {
            open: false,
            started: false,
            prescaler: Setting::at_reset(0),
            reload: Setting::at_reset(FULL),
            window: Setting::at_reset(FULL),
            count: FULL,
            since: VirtualNanos(0),
            hz: 0,
        }
    }
}

impl Iwdg {
    /// Whether it has been started.
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.started
    }

    /// LSI cycles of one count: 4 to 256.
    fn divider(&self) -> u64 {
        4 << self.prescaler.active.min(6)
    }

    fn after_cycles(&self, start: VirtualNanos, cycles: u64) -> Option<VirtualNanos> {
        let nanos = u128::from(cycles) * u128::from(NANOS_PER_SECOND) / u128::from(self.hz.max(1));
        (self.hz > 0)
            .then(|| VirtualNanos(start.0.saturating_add(u64::try_from(nanos).unwrap_or(u64::MAX))))
    }

    /// The counter at an instant.
    fn count_at(&self, now: VirtualNanos) -> u64 {
        let nanos = u128::from(now.0.saturating_sub(self.since.0));
        let cycles = nanos * u128::from(self.hz) / u128::from(NANOS_PER_SECOND);
        let counts = u64::try_from(cycles / u128::from(self.divider())).unwrap_or(u64::MAX);
        if self.started { self.count.saturating_sub(counts) } else { self.count }
    }

    /// When the part is reset: the count after 0.
    fn expiry(&self) -> Option<VirtualNanos> {
        self.started
            .then(|| self.after_cycles(self.since, (self.count + 1) * self.divider()))
            .flatten()
    }

    fn load(&mut self, now: VirtualNanos) {
        self.count = self.reload.active;
        self.since = now;
    }

    fn write_key(&mut self, key: u64, context: &mut DeviceContext<'_>) {
        let now = context.now();
        self.open = key == OPEN;
        match key {
            START if !self.started => {
                self.started = true;
                self.since = now;
                context.request(STARTED, Level::High);
            }
            FEED if self.count_at(now) > self.window.active => context.request_reset(),
            FEED => self.load(now),
            _ => {}
        }
    }

    fn status(&self) -> u64 {
        let on_its_way = |setting: &Setting, bit| if setting.crossing.is_some() { bit } else { 0 };
        on_its_way(&self.prescaler, PVU)
            | on_its_way(&self.reload, RVU)
            | on_its_way(&self.window, WVU)
    }

    /// Carries out what is due, and schedules what comes.
    fn advance(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now();
        let count = self.count_at(now);
        if self.prescaler.arrive(now) {
            // What has been counted of the next step is lost: a fraction of a count.
            self.count = count;
            self.since = now;
        }
        self.reload.arrive(now);
        if self.window.arrive(now) {
            self.load(now);
        }
        if self.expiry().is_some_and(|expiry| expiry <= now) {
            context.request_reset();
            return;
        }
        let crossings =
            [self.prescaler, self.reload, self.window].map(|setting| setting.crossing.flatten());
        for instant in crossings.into_iter().chain([self.expiry()]).flatten() {
            context.schedule(instant);
        }
    }
}

impl Device for Iwdg {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.peek(register, registers, context.now())
    }

    fn peek(&self, register: Register, _: &RegisterFile, _: VirtualNanos) -> Option<u64> {
        Some(match register {
            Register::Kr => 0,
            Register::Pr => self.prescaler.active,
            Register::Rlr => self.reload.active,
            Register::Sr => self.status(),
            Register::Winr => self.window.active,
        })
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        _: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let arrives = self.after_cycles(context.now(), CROSSING_CYCLES);
        match register {
            Register::Kr => self.write_key(value & 0xFFFF, context),
            Register::Sr => {}
            _ if !self.open => context.tell("KR", "PR, RLR or WINR written without the key 0x5555"),
            Register::Pr => self.prescaler.write(value & 0x7, arrives),
            Register::Rlr => self.reload.write(value & FULL, arrives),
            Register::Winr => self.window.write(value & FULL, arrives),
        }
        self.advance(context);
    }

    fn on_event(&mut self, _: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
    }

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let now = context.now();
        self.count = self.count_at(now);
        self.since = now;
        self.hz = hz;
        let arrives = self.after_cycles(now, CROSSING_CYCLES);
        for setting in [&mut self.prescaler, &mut self.reload, &mut self.window] {
            if setting.crossing.is_some() {
                setting.crossing = Some(arrives);
            }
        }
        self.advance(context);
    }

    /// Every reset of the part stops it.
    fn reset(&mut self) {
        *self = Self::default();
    }
}
