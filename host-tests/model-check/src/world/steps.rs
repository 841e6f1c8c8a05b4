//! What a step does.

use super::World;
use super::life::Countdown;
use super::ports::Input;
use crate::action::{Action, Ask};
use crate::bus::{Bus, OnWire};
use crate::plant::{AXES, LISTENER};
use gateway::{Event, Instant};
use promise_model::Told;

impl World {
    /// Does what a step says.
    pub fn act(&mut self, action: &Action) {
        self.open_links();
        let now = self.now_us;
        match action {
            // What is stored then, the model cannot know: as above.
            Action::Ask { ask: Ask::Save, .. } | Action::Watch { ask: Ask::Save, .. }
                if self.oracle.is_configuring() => {}
            Action::Ask { link, ask } | Action::Watch { link, ask } => {
                let Some(host) = self.hosts.get_mut(usize::from(*link)) else { return };
                // Whether bytes are a command, and take authority, the model learns from their
                // result; whether a raw frame was accepted, and for how long the host may be silent
                // from now on, too. That is read.
                if is_judged_by_its_result(ask) {
                    host.unread_until = now;
                }
                let watches = matches!(action, Action::Watch { .. });
                let bytes = host.ask(now, ask, &self.epochs, watches);
                self.feed(Input::Host { link: *link, bytes });
            }
            Action::Again { link, back } => {
                let bytes = self.hosts.get(usize::from(*link)).and_then(|host| host.again(*back));
                // Whether it is executed then, the model cannot know: as above.
                if let Some(bytes) = bytes.filter(|bytes| !self.oracle.may_know(*link, bytes)) {
                    self.feed(Input::Host { link: *link, bytes });
                }
            }
            Action::Bytes { link, bytes } => {
                self.feed(Input::Host { link: *link, bytes: bytes.clone() })
            }
            Action::Unread { link, for_us } => {
                if let Some(host) =
                    self.hosts.get_mut(usize::from(*link)).filter(|_| *link != LISTENER)
                {
                    host.unread_until = now + for_us;
                }
            }
            Action::EStopInput { open } => self.feed(Input::Pin { open: *open }),
            Action::Motor { motor, does } => {
                if let Some(motor) = self.motors.get_mut(usize::from(*motor)) {
                    motor.does(now, does);
                }
            }
            Action::Stray { bus, id, data } => {
                let what = OnWire::Can { id: *id, data: data.clone() };
                self.on_bus(*bus, |bus| bus.stray(now, what));
            }
            Action::Noise { bus, bytes } => {
                self.on_bus(*bus, |bus| bus.stray(now, OnWire::Serial(bytes.clone())));
            }
            Action::Cut { bus, for_us } => {
                self.oracle.cut(now, *bus, now + for_us);
                self.on_bus(*bus, |bus| bus.cut(now + for_us));
            }
            Action::Foreign { bus, id, length, pause_us, for_us } => {
                self.on_bus(*bus, |bus| bus.load(now, *id, *length, (*pause_us, *for_us)));
            }
            Action::Stubborn { bus, for_us } => {
                self.on_bus(*bus, |bus| bus.stubborn_until = now + for_us)
            }
            Action::Short { bus, for_us } => {
                self.on_bus(*bus, |bus| bus.short_until = now + for_us);
                if usize::from(*bus) < self.buses.len() {
                    self.feed(Input::State { bus: *bus, off: true });
                }
            }
            // Whether a configuration is kept that nobody has been told of, the model cannot know:
            // a little later, then.
            Action::Reset if self.oracle.is_configuring() => {
                self.life.reset_after(Countdown::Steps { left: 0 })
            }
            Action::Reset => self.reset(false),
            Action::DamagingReset { .. } if self.oracle.is_configuring() => {}
            Action::DamagingReset { words } => {
                let damaged = self.life.damage(*words);
                self.reset_damaged(damaged);
            }
            Action::ResetWhileSaving { words, garbles } => {
                self.life
                    .reset_after(Countdown::Words { left: (*words).max(1), garbles: *garbles });
            }
            Action::ResetAfter { steps } => {
                self.life.reset_after(Countdown::Steps { left: *steps })
            }
            Action::PowerLoss => self.lose_power(),
            Action::Stored { done } => self.stored(*done),
            Action::Errors { bus, transmit, receive } => {
                let runs = |bus: &Bus| bus.generation.is_some() && !bus.is_off;
                if self.buses.get(usize::from(*bus)).is_some_and(runs) {
                    self.feed(Input::Errors { bus: *bus, transmit: *transmit, receive: *receive });
                }
            }
            Action::Overflow { bus } => self.feed(Input::Overflow { bus: *bus }),
            Action::StraySlot { bus, slot } => {
                let held = self.buses.get(usize::from(*bus)).map(Bus::slots).unwrap_or_default();
                if !held.contains(slot) {
                    self.feed(Input::Transmitted { bus: *bus, slot: *slot });
                }
            }
            Action::ClockBack { by_us } => {
                let before = Instant::from_micros(now.saturating_sub(*by_us));
                let changes = self.gateway.handle(before, Event::Tick, &mut self.life.store());
                self.named = self.named.with(changes.buses);
                self.feed(Input::Tick);
            }
        }
    }

    /// Everything works again and a host asks for an e-stop: the axes that have not come to rest
    /// after that, although their motor is where it was and acknowledges.
    pub fn not_at_rest_in_the_end(&mut self) -> Vec<(u8, Told)> {
        // An unreachable motor is left alone for longer than its own timeout: 90 s here.
        const WITHIN_S: u32 = 100;
        let now = self.now_us;
        self.motors.iter_mut().for_each(|motor| motor.mend(now));
        self.buses.iter_mut().for_each(Bus::mend);
        self.hosts.iter_mut().for_each(|host| host.unread_until = now);
        self.act(&Action::Ask { link: LISTENER, ask: Ask::EStop });
        let mut moving = Vec::new();
        for _ in 0..WITHIN_S {
            self.run_to(self.since_start_us() + 1_000_000);
            moving = self.moving().collect();
            if moving.is_empty() {
                break;
            }
        }
        moving
    }

    fn moving(&self) -> impl Iterator<Item = (u8, Told)> {
        let answered = (0..AXES)
            .zip(&self.motors)
            .filter(|(axis, motor)| motor.acknowledges(&self.oracle.place(*axis)));
        let told = answered.map(|(axis, _)| (axis, self.oracle.told(axis)));
        told.filter(|(_, told)| {
            !told.is_at_rest()
                && !matches!(told, Told::Unconfigured | Told::Tripped { confirmed: true })
        })
    }

    fn on_bus(&mut self, bus: u8, act: impl FnOnce(&mut Bus)) {
        let now = self.now_us;
        if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
            act(bus);
            bus.begin(now);
        }
    }

    /// The controller of a bus forgets what it held.
    pub(super) fn drop_held(&mut self, bus: u8) {
        let state = &mut self.buses[usize::from(bus)];
        for slot in state.slots() {
            self.oracle.dropped(self.now_us, bus, slot);
        }
        state.forget();
    }
}

fn is_judged_by_its_result(ask: &Ask) -> bool {
    matches!(
        ask,
        Ask::Native { .. }
            | Ask::RawOpen { .. }
            | Ask::RawSend { .. }
            | Ask::RawClose { .. }
            | Ask::Silence { .. }
            | Ask::Apply
    )
}
