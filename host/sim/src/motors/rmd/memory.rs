//! What an RMD motor stores, and what of it a restart or a loss of power makes act or forget.

use std::f64::consts::TAU;

use super::super::counts::to_i32;
use rmd::{Function, Gain, GainValue, PidGains};

/// Pulses of the encoder in a turn of the output shaft (an assumption: the manual gives none).
const PULSES: f64 = 65_536.0;
/// The gains that the manual prints (RMD V3.6 §2.1.4).
const GAINS: [u8; 6] = [0x55, 0x19, 0x55, 0x19, 0x55, 0x19];
/// Every gain of a motor from V4.2 on.
const FINE_GAIN: f32 = 0.5;
/// Accelerations from the factory, dps/s: about 200 rad/s².
const ACCELERATION: u32 = 11_459;

/// RAM and ROM of one motor.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Memory {
    /// 0x31: in force, lost with the power.
    gains: [u8; 6],
    /// 0x32
    gains_rom: [u8; 6],
    /// The same of a motor from V4.2 on, which has seven real numbers.
    fine_gains: [f32; 7],
    fine_gains_rom: [f32; 7],
    /// 0x43, dps/s, by index.
    ramps: [u32; 4],
    /// 0x63, 0x64 and 0x20 index 1, pulses; it acts after a restart.
    offset_rom: i32,
    /// The zero point in force, pulses.
    offset: i32,
    /// Where the encoder began to count its turns, in whole turns of the shaft, rad: without power
    /// it counts none.
    uncounted_rad: f64,
    /// 0xB3, ms; 0 = off.
    pub(super) timeout_ms: u32,
    /// 0x20 index 2
    pub(super) can_id_filter: bool,
    /// 0x20 index 3
    pub(super) reports_errors: bool,
    /// 0x20 index 4
    saves_turns: bool,
    /// 0xB4: the rate that acts when the motor is switched on again (one of two readings of §2.31),
    /// bit/s.
    next_bitrate: Option<u32>,
    /// The rate in force, where one was set.
    pub(super) bitrate: Option<u32>,
}

impl Memory {
    pub(super) fn new() -> Self {
        Self {
            gains: GAINS,
            gains_rom: GAINS,
            fine_gains: [FINE_GAIN; 7],
            fine_gains_rom: [FINE_GAIN; 7],
            ramps: [ACCELERATION; 4],
            ..Self::default()
        }
    }

    /// The firmware starts anew: what only acts after a restart acts (RMD V3.6 §2.9, §2.10, §2.33).
    pub(super) fn restart(&mut self) {
        self.gains = self.gains_rom;
        self.fine_gains = self.fine_gains_rom;
        self.offset = self.offset_rom;
    }

    /// The power was off with the shaft at an angle. Without 0x20 index 4 only the place within one
    /// turn is known then.
    pub(super) fn lose_power(&mut self, shaft_rad: f64) {
        if !self.saves_turns {
            self.uncounted_rad = (shaft_rad / TAU).floor() * TAU;
        }
        self.bitrate = self.next_bitrate;
        self.restart();
    }

    /// A rate for the time after the next loss of power.
    pub(super) fn store_bitrate(&mut self, bitrate: Option<u32>) {
        self.next_bitrate = bitrate.or(self.next_bitrate);
    }

    pub(super) fn gains(&self) -> PidGains {
        let [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki] = self.gains;
        PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki }
    }

    pub(super) fn set_gains(&mut self, gains: &PidGains, stored: bool) {
        let PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki } =
            *gains;
        self.gains = [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki];
        if stored {
            self.gains_rom = self.gains;
        }
    }

    /// 0x30 from V4.2 on; an index without a meaning reads 0.
    pub(super) fn fine_gain(&self, gain: Gain) -> GainValue {
        let value = place(gain).and_then(|place| self.fine_gains.get(place));
        GainValue::new(gain, value.copied().unwrap_or_default())
    }

    /// 0x31 and 0x32 from V4.2 on.
    pub(super) fn set_fine_gain(&mut self, gain: GainValue, stored: bool) {
        let Some(at) = place(gain.gain) else { return };
        for gains in [Some(&mut self.fine_gains), stored.then_some(&mut self.fine_gains_rom)] {
            if let Some(place) = gains.and_then(|gains| gains.get_mut(at)) {
                *place = gain.value();
            }
        }
    }

    /// One of the four accelerations, dps/s.
    pub(super) fn ramp(&self, ramp: rmd::Ramp) -> u32 {
        self.ramps.get(usize::from(ramp.0)).copied().unwrap_or(ACCELERATION)
    }

    pub(super) fn set_ramp(&mut self, ramp: rmd::Ramp, dps_s: u32) {
        if let Some(place) = self.ramps.get_mut(usize::from(ramp.0)) {
            *place = dps_s;
        }
    }

    /// What the encoder counts with the shaft at an angle, pulses (RMD V3.6 §2.7).
    pub(super) fn pulses(&self, shaft_rad: f64) -> i32 {
        to_i32((shaft_rad - self.uncounted_rad) / TAU * PULSES)
    }

    /// The zero point in force, pulses (RMD V3.6 §2.8).
    pub(super) fn offset(&self) -> i32 {
        self.offset
    }

    /// A zero point for the time after the next restart.
    pub(super) fn store_offset(&mut self, pulses: i32) {
        self.offset_rom = pulses;
    }

    /// The shaft's angle where the motor counts 0, rad.
    pub(super) fn zero_rad(&self) -> f64 {
        self.uncounted_rad + f64::from(self.offset) / PULSES * TAU
    }

    /// 0x20 (RMD V3.6 §2.33.4).
    pub(super) fn function(&mut self, function: Function, shaft_rad: f64) {
        match function {
            Function::ClearMultiTurn => self.offset_rom = self.pulses(shaft_rad),
            Function::CanIdFilter { enabled } => self.can_id_filter = enabled,
            Function::ErrorReporting { enabled } => self.reports_errors = enabled,
            Function::MultiTurnSaving { enabled } => self.saves_turns = enabled,
            Function::NextCanId { .. }
            | Function::FaultRecovery { .. }
            | Function::Other { .. } => {}
        }
    }
}

/// Where a gain stands among those that have a meaning.
fn place(gain: Gain) -> Option<usize> {
    Gain::ALL.iter().position(|(of, _)| *of == gain)
}
