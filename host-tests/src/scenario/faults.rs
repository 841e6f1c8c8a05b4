//! What breaks in a scenario: motors, cables, strangers on a bus.

use super::bench::Bench;
use super::words::{duration, hex, parse};
use host_protocol::{BootReason, CanFrame};
use mgw_sim::{Beginning, BusFault, Injection, Turning, Wire};
use std::time::Duration;

impl Bench {
    /// `bus-cut|bus-short|bus-join BUS`
    pub fn disturb(&mut self, words: &[&str], fault: BusFault) -> Result<(), String> {
        self.world.borrow_mut().set_bus_fault(parse(words, 0, "bus")?, fault);
        Ok(())
    }

    /// `inject MOTOR KIND VALUE`
    pub fn inject(&mut self, words: &[&str]) -> Result<(), String> {
        let motor = self.motor(words)?;
        let on = match words.get(2) {
            Some(&"on") => Some(true),
            Some(&"off") => Some(false),
            _ => None,
        };
        let switch = words.get(1).zip(on).and_then(|(name, on)| Injection::switch(name, on));
        if let Some(switch) = switch {
            self.world.borrow_mut().inject(motor, switch);
            return Ok(());
        }
        let injection = match (words.get(1), on) {
            (Some(&"faults"), None) => Injection::FaultBits(parse(words, 2, "fault word")?),
            (Some(&"dialect"), None) => Injection::RmdDialect(parse(words, 2, "dialect")?),
            (Some(&"firmware"), None) => Injection::RmdFirmware(parse(words, 2, "date")?),
            (Some(&"lose-replies"), None) => Injection::LoseReplies(parse(words, 2, "count")?),
            (Some(&"lose-answers-like"), Some(false)) => {
                Injection::LoseAnswersLike(Beginning::default())
            }
            (Some(&"lose-answers-like"), None) => {
                let bytes = hex(words.get(2).ok_or("how do the answers begin?")?)?;
                Injection::LoseAnswersLike(Beginning::new(&bytes).ok_or("at most 8 bytes")?)
            }
            (Some(&"turn"), _) => Injection::Turning(turning(words)?),
            (Some(&"current"), _) => Injection::Current(thousandths(words)?),
            (Some(&"motor-temperature"), _) => Injection::MotorTemperature(celsius(words)?),
            (Some(&"driver-temperature"), _) => Injection::DriverTemperature(celsius(words)?),
            (Some(&"late"), None) => Injection::LateReply(duration(words, 2)?),
            other => return Err(format!("{other:?} is no injection")),
        };
        self.world.borrow_mut().inject(motor, injection);
        Ok(())
    }

    /// `power MOTOR off|on`: without power it forgets what it was told, hears nothing and turns on
    /// as it coasts.
    pub fn power(&mut self, words: &[&str]) -> Result<(), String> {
        let motor = self.motor(words)?;
        let off = match words.get(1) {
            Some(&"off") => true,
            Some(&"on") => false,
            other => return Err(format!("power is on or off, not {other:?}")),
        };
        let mut world = self.world.borrow_mut();
        world.power_cycle(motor);
        world.inject(motor, Injection::Unplugged(off));
        Ok(())
    }

    /// `foreign BUS FRAME [every TIME]`: somebody else sends this once, or now and then from now
    /// on.
    pub fn foreign(&mut self, words: &[&str]) -> Result<(), String> {
        let (bus, text): (u8, String) = (parse(words, 0, "bus")?, parse(words, 1, "frame")?);
        let wire = match can_frame(&text)? {
            Some(frame) => Wire::Can(frame),
            None => Wire::Serial(hex(&text)?),
        };
        match words.get(2) {
            Some(&"every") => {
                self.world.borrow_mut().repeat_foreign(bus, wire, duration(words, 3)?)
            }
            _ => self.world.borrow_mut().send_foreign(bus, wire),
        }
        Ok(())
    }

    /// `babble BUS FRAME…`: somebody else sends these in turn, as fast as the bus takes them.
    pub fn babble(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let mut frames = Vec::new();
        for text in words.get(1..).unwrap_or_default() {
            frames.push(can_frame(text)?.ok_or("only CAN frames can be babbled")?);
        }
        self.world.borrow_mut().babble(bus, frames);
        Ok(())
    }

    /// `hush BUS`: nobody else sends any more.
    pub fn hush(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        self.world.borrow_mut().hush(bus);
        Ok(())
    }

    /// `reset power-on|pin|watchdog|software [LAST WORDS]`: the gateway starts anew.
    pub fn reset(&mut self, words: &[&str]) -> Result<(), String> {
        let boot = match words.first() {
            Some(&"power-on") => BootReason::PowerOn,
            Some(&"pin") => BootReason::Pin,
            Some(&"watchdog") => BootReason::Watchdog,
            Some(&"software") => BootReason::Software,
            other => return Err(format!("{other:?} is no reason to start")),
        };
        let crash_report = words.get(1..).unwrap_or_default().join(" ");
        self.world.borrow_mut().reset(boot, crash_report.leak());
        Ok(())
    }

    /// `e-stop-input open|closed`
    pub fn e_stop_input(&mut self, words: &[&str]) -> Result<(), String> {
        let open = match words.first() {
            Some(&"open") => true,
            Some(&"closed") => false,
            other => return Err(format!("the input is open or closed, not {other:?}")),
        };
        self.world.borrow_mut().set_e_stop_input(open);
        Ok(())
    }

    fn motor(&self, words: &[&str]) -> Result<usize, String> {
        let motor: usize = parse(words, 0, "motor")?;
        let count = self.world.borrow().motors().len();
        if motor < count { Ok(motor) } else { Err(format!("there are {count} motors")) }
    }
}

/// `off`, or a number, in thousandths.
fn thousandths(words: &[&str]) -> Result<Option<i32>, String> {
    if words.get(2) == Some(&"off") {
        return Ok(None);
    }
    let value: f64 = parse(words, 2, "number")?;
    let value = (value * 1e3).round();
    let fits = (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&value);
    #[expect(clippy::cast_possible_truncation, reason = "it fits")]
    fits.then_some(Some(value as i32)).ok_or_else(|| format!("{value} is too large"))
}

/// `off`, or °C.
fn celsius(words: &[&str]) -> Result<Option<i16>, String> {
    if words.get(2) == Some(&"off") { Ok(None) } else { parse(words, 2, "temperature").map(Some) }
}

/// `off`, or `SPEED [TIME TIME]`.
fn turning(words: &[&str]) -> Result<Option<Turning>, String> {
    let Some(speed) = thousandths(words)? else { return Ok(None) };
    let (turns, holds) = match words.len() {
        3 => (Duration::from_secs(1), Duration::ZERO),
        _ => (duration(words, 3)?, duration(words, 5)?),
    };
    Ok(Some(Turning { speed, turns, holds }))
}

/// Digits of a standard id; an extended one has more.
const STANDARD_DIGITS: usize = 3;

/// A CAN frame in candump's form, `None` for plain hexadecimal.
pub fn can_frame(text: &str) -> Result<Option<CanFrame>, String> {
    let Some((id, data)) = text.split_once('#') else { return Ok(None) };
    let data = hex(data)?;
    let frame = if id.len() <= STANDARD_DIGITS {
        u16::from_str_radix(id, 16).ok().and_then(|id| CanFrame::standard(id, &data))
    } else {
        u32::from_str_radix(id, 16).ok().and_then(|id| CanFrame::extended(id, &data))
    };
    frame.map(Some).ok_or_else(|| format!("{text} is no CAN frame"))
}
