//! What the gateway says: results and events (G1, G9).

use crate::axis::{Axis, Cause, StopAction};
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::{Body, Clears, Kind, Message, News, Request, Told, event};

/// Errors (PROTOCOL.md, Errors) that come before authority is looked at.
const READ_BEFORE_AUTHORITY: [u16; 8] = [1, 2, 5, 6, 7, 17, 44, 45];
const NOT_IN_COMMAND: u16 = 4;
/// Kind of a reply, and the length of a header.
const REPLY: u8 = 2;
const HEADER: usize = 5;

impl Oracle {
    /// Bytes for a host leave the gateway.
    pub fn from_gateway(&mut self, now: u64, link: u8, bytes: &[u8]) {
        self.advance(now);
        for byte in bytes {
            let Some(port) = self.links.get_mut(usize::from(link)) else { return };
            let Some(message) = port.outgoing.push(*byte) else { continue };
            match message.kind {
                Kind::Reply | Kind::Error => self.result(now, link, &message),
                Kind::Event => {
                    // Other links tell the same, later or not at all.
                    if link == self.listener
                        && let Some(news) = event(&message)
                    {
                        self.news(now, news);
                    }
                }
                Kind::Request => self.broken(Check::ResultUnasked, now, "a request of the gateway".into()),
            }
        }
    }

    /// The host of a link has read all there is: what it asked and what was not refused has been accepted.
    pub fn drained(&mut self, now: u64, link: u8) {
        let Some(port) = self.links.get_mut(usize::from(link)) else { return };
        port.drained_us = Some(now);
        // A repeated result whose bytes are not kept any more does not come.
        port.records.iter_mut().for_each(|record| record.again = false);
        port.records
            .retain(|record| record.result.is_some() || !record.may_be_dropped || record.at_us == now);
        for axis in &mut self.axes {
            let accepted = |p: &crate::axis::Permit| p.link == link && !p.in_force && !p.is_relative;
            if let Some(index) = axis.permits.iter().rposition(accepted) {
                in_force(axis, index);
            }
        }
    }

    fn result(&mut self, now: u64, link: u8, message: &Message) {
        let sequence = message.sequence;
        let port = &mut self.links[usize::from(link)];
        let of_it = |record: &&mut crate::link::Record| record.sequence == message.sequence;
        // A host may use a sequence twice: a reply says by its number which request it answers.
        let fits = |r: &crate::link::Record| message.kind == Kind::Error || r.number == message.number;
        let open = |r: &crate::link::Record| r.sequence == sequence && r.result.is_none();
        // An error does not: most come at once.
        let at_once = port.records.iter().position(|r| open(r) && fits(r) && r.at_us == now);
        let place = at_once.or_else(|| port.records.iter().rposition(|r| open(r) && fits(r)));
        if let Some(record) = place.map(|at| &mut port.records[at]) {
            record.result = Some(message.bytes.clone());
            record.result_us = now;
            let (request, at) = (record.request.clone(), record.at_us);
            let (refused, took) = (record.must_be_refused, record.took);
            let is_reply = message.kind == Kind::Reply;
            if refused
                && (is_reply
                    || !READ_BEFORE_AUTHORITY.contains(&message.number) && message.number != NOT_IN_COMMAND)
            {
                let seen =
                    format!("link {link} is not in command; {request:?} is answered {}", message.number);
                self.broken(Check::AuthorityIgnored, now, seen);
            }
            if is_reply {
                self.granted(now, link, sequence, &request, message);
            } else {
                if took
                    && at == now
                    && READ_BEFORE_AUTHORITY.contains(&message.number)
                    && self.untaken(&request, message.number)
                {
                    self.holder = None;
                }
                if !refused
                    && let Request::Clear(Clears::Axis(axis)) | Request::ClearUnreachable(axis) = request
                    && let Some(axis) = self.axes.get_mut(usize::from(axis))
                {
                    axis.clearing = axis.clearing.saturating_sub(1);
                }
                self.refused(link, sequence);
            }
            return;
        }
        let seen = format!("link {link}: a second result for {sequence}");
        // Allowance: a host chooses another sequence than those of its last requests (PROTOCOL.md). Where it does not, nobody can
        // tell which of them a result is for.
        if port.records.iter().filter(|record| record.sequence == sequence).count() > 1 {
            return;
        }
        if !port.records.iter().any(|record| record.sequence == sequence) {
            self.broken(Check::ResultUnasked, now, format!("link {link}: nobody asked {sequence}"));
            return;
        }
        match port.records.iter_mut().filter(of_it).find(|r| r.result.as_ref() == Some(&message.bytes)) {
            Some(record) if record.again => record.again = false,
            Some(_) => self.broken(Check::ResultUnasked, now, seen),
            None => self.broken(Check::ResultChanged, now, seen),
        }
    }

    /// Whether a request that was refused so has not taken authority: what cannot be read, and natives that are none.
    fn untaken(&self, request: &Request, error: u16) -> bool {
        matches!(error, 1 | 2) || matches!(request, Request::Native { .. })
    }

    /// A request was carried out.
    fn granted(&mut self, now: u64, link: u8, sequence: u16, request: &Request, message: &Message) {
        match *request {
            Request::LinkSilence(us) => self.silence_us = us.into(),
            Request::ConfigureBus { bus, bitrate, wholly_ours, reply_window_us } => {
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.bitrate = bitrate;
                    bus.wholly_ours = wholly_ours;
                    bus.window_us = reply_window_us.into();
                }
            }
            Request::ConfigureAxis { axis, parameter, value } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.set(parameter, value);
                }
            }
            Request::RemoveAxis(axis) => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    *axis = Axis::default();
                }
            }
            Request::Provision { axis, timeout_ms } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.motor_timeout_ms = (timeout_ms > 0).then_some(timeout_ms);
                }
            }
            Request::Arm(axis) => {
                let epoch = Body(message.body()).u32();
                if let Some(axis) = self.axes.get_mut(usize::from(axis)).filter(|axis| axis.armed) {
                    axis.epoch = epoch;
                }
            }

            Request::Clear(Clears::Axis(axis)) | Request::ClearUnreachable(axis) => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.cleared_us = Some(now);
                    if let Request::ClearUnreachable(_) = request {
                        // Unsafe, and named so: nothing is owed any more.
                        axis.duty = None;
                        axis.unreachable = false;
                    }
                }
            }
            Request::Setpoint { axis, epoch, expires_at_us } => {
                self.grant(now, link, sequence, axis, (epoch, expires_at_us));
            }
            Request::MoveRelative { axis, epoch, expires_at_us } => {
                self.grant(now, link, sequence, axis, (epoch, expires_at_us));
            }
            Request::Native { axis, .. } => {
                // A motion was granted when it was not refused; a stop says so by its events.
                self.fulfil(link, sequence, axis);
            }
            Request::RawOpen(bus) => {
                let armed = self.axes.iter().any(|axis| axis.bus() == Some(usize::from(bus)) && axis.armed);
                if armed {
                    self.broken(
                        Check::RawUnopened,
                        now,
                        format!("bus {bus} is opened with an armed axis on it"),
                    );
                }
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.raw_open = true;
                }
            }
            Request::RawSend { bus, id, ref data } => {
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.raw.push_back((id, data.clone()));
                }
            }
            Request::RawClose(bus) => {
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.raw_open = false;
                    bus.raw.clear();
                }
            }
            _ => {}
        }
    }

    /// A setpoint was accepted: it should not have been unless it was offered.
    fn grant(&mut self, now: u64, link: u8, sequence: u16, index: u8, (epoch, expires_at_us): (u32, u32)) {
        let Some(axis) = self.axes.get_mut(usize::from(index)) else { return };
        let offered = axis.permits.iter().rposition(|p| (p.link, p.sequence) == (link, sequence));
        if let Some(offered) = offered {
            in_force(axis, offered);
            return;
        }
        // The axis may have been stopped since, or the host may read late.
        let at =
            self.links[usize::from(link)].records.iter().find(|r| r.sequence == sequence).map(|r| r.at_us);
        let axis = &self.axes[usize::from(index)];
        if at != Some(now) {
            return;
        }
        let check = match axis.epoch {
            _ if !axis.armed => Check::MotionUnarmed,
            Some(current) if current != epoch => Check::EpochIgnored,
            Some(_) => Check::ExpiryIgnored,
            // Its host has not read yet which epoch it is.
            None => return,
        };
        let seen = format!("axis {index} takes a setpoint of epoch {epoch} that expires at {expires_at_us}");
        self.broken(check, now, seen);
    }

    /// A permission whose result is there: in force if it was not before.
    fn fulfil(&mut self, link: u8, sequence: u16, axis: u8) {
        let Some(axis) = self.axes.get_mut(usize::from(axis)) else { return };
        let offered = |p: &crate::axis::Permit| (p.link, p.sequence) == (link, sequence) && !p.in_force;
        if let Some(offered) = axis.permits.iter().rposition(offered) {
            in_force(axis, offered);
        }
    }

    /// A request was refused: what it offered is void. A native motion that fails later trips its axis or was replaced.
    fn refused(&mut self, link: u8, sequence: u16) {
        for axis in &mut self.axes {
            axis.permits.retain(|p| (p.link, p.sequence) != (link, sequence) || p.in_force);
        }
    }

    fn news(&mut self, now: u64, news: News) {
        match news {
            News::EStopLatched => self.e_stopped = true,
            News::EStopCleared => {
                let asked = |link: &crate::link::Link| {
                    link.records
                        .iter()
                        .any(|r| r.request == Request::Clear(Clears::Gateway) && r.at_us == now)
                };
                if self.links.iter().any(asked) {
                    self.e_stopped = false;
                } else {
                    self.broken(
                        Check::EStopIgnored,
                        now,
                        "the e-stop is cleared, unasked or with its input open".into(),
                    );
                }
            }
            News::Unreachable { axis } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.unreachable = true;
                    if let Some(duty) = &mut axis.duty {
                        duty.confirmed = false;
                        // Known as confirmed until now: what follows is silence, so that its own timeout can act.
                        duty.rests = duty.since_us == now;
                        duty.left += duty.left_before;
                    }
                }
            }
            News::Tripped { axis } => self.tripped(now, usize::from(axis)),
            News::State { axis, state } => self.state(now, usize::from(axis), state),
        }
    }

    fn tripped(&mut self, now: u64, index: usize) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        axis.told = Told::Tripped { confirmed: false };
        let group = axis.trip_group();
        self.owe_stop(index, Cause::Told, now);
        for other in 0..self.axes.len() {
            if group.is_some() && self.axes[other].trip_group() == group && self.axes[other].armed {
                self.owe_stop(other, Cause::Group, now);
            }
        }
    }

    fn state(&mut self, now: u64, index: usize, state: Told) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        let before = std::mem::replace(&mut axis.told, state);
        match (before, state) {
            (Told::Armed | Told::Active, Told::Armed | Told::Active) => {}
            (_, Told::Armed | Told::Active) => self.armed(now, index),
            (_, Told::Stopping) => self.owe_stop(index, Cause::Told, now),
            (Told::Tripped { confirmed: true }, Told::Tripped { confirmed: false }) => {
                // It turns again: the stop begins anew.
                let before = axis.duty.take().map_or(0, |duty| duty.left);
                self.owe_stop(index, Cause::Told, now);
                if let Some(duty) = &mut self.axes[index].duty {
                    duty.left_before = before;
                }
            }
            (_, Told::Tripped { confirmed: false }) => self.owe_stop(index, Cause::Told, now),
            (_, Told::Tripped { confirmed: true }) => self.confirmed(now, index),
            (Told::Tripped { .. }, Told::Idle | Told::Unconfigured) => self.cleared(now, index),
            (Told::Stopping, Told::Idle | Told::Unconfigured) => {
                self.confirmed(now, index);
                self.axes[index].duty = None;
            }
            (_, Told::Idle | Told::Unconfigured | Told::Arming) => {
                if axis.armed {
                    // No stop is under way: one is due all the same.
                    self.owe_stop(index, Cause::Told, now);
                }
            }
        }
    }

    fn armed(&mut self, now: u64, index: usize) {
        let number = u8::try_from(index).unwrap_or(u8::MAX);
        let holder = self.holder.map(|(holder, _)| holder);
        let asked = |link: u8| {
            let records = &self.links[usize::from(link)].records;
            records.iter().any(|r| r.request == Request::Arm(number) && !r.must_be_refused)
        };
        if !holder.is_some_and(asked) {
            self.broken(Check::ArmedUnasked, now, format!("axis {index}"));
        }
        if self.e_stopped || self.e_stop_open {
            self.broken(Check::EStopIgnored, now, format!("axis {index} is armed"));
        }
        let bus = self.axes[index].bus();
        if bus.and_then(|bus| self.buses.get(bus)).is_some_and(|bus| bus.raw_open) {
            self.broken(Check::RawUnopened, now, format!("axis {index} is armed on a bus with raw access"));
        }
        let outside = bus.and_then(|bus| self.buses.get(bus)).map_or(0, |bus| bus.outside_us(now));
        let axis = &mut self.axes[index];
        axis.armed = true;
        axis.armed_us = now;
        axis.heard = (now, outside);
        axis.epoch = None;
        axis.permits.clear();
        axis.duty = None;
        // The reply may have come before the event, on another link.
        let arms = |r: &&crate::link::Record| r.request == Request::Arm(number) && r.result_us == now;
        let replies = self.links.iter().flat_map(|link| link.records.iter().filter(arms));
        let is_reply = |bytes: &&Vec<u8>| bytes.first() == Some(&REPLY);
        if let Some(reply) = replies.filter_map(|r| r.result.as_ref()).find(is_reply) {
            axis.epoch = Body(&reply[HEADER..]).u32();
        }
    }

    /// The gateway says that the motor has confirmed the stop.
    fn confirmed(&mut self, now: u64, index: usize) {
        let axis = &mut self.axes[index];
        axis.unreachable = false;
        let action = axis.stop_action();
        let Some(duty) = &mut axis.duty else { return };
        let twice = duty.left >= 2;
        let stands = match action {
            Some(StopAction::Coast) => true,
            Some(StopAction::Hold) => duty.still >= 2,
            Some(StopAction::Brake) => duty.still >= 2 && duty.locked && duty.output_off,
            None => false,
        };
        let proved = duty.acknowledged_us.is_some() && stands;
        duty.confirmed = true;
        let seen = format!("axis {index}, {action:?}: {duty:?}");
        if !twice {
            self.broken(Check::StopOnce, now, seen.clone());
        }
        if !proved {
            self.broken(Check::ConfirmedUnproved, now, seen);
        }
    }

    fn cleared(&mut self, now: u64, index: usize) {
        let axis = &mut self.axes[index];
        axis.duty = None;
        axis.unreachable = false;
        // Its result may belong to a session that is over.
        if axis.cleared_us != Some(now) && std::mem::take(&mut axis.clearing) == 0 {
            self.broken(Check::TripForgotten, now, format!("axis {index}"));
        }
    }
}

/// Puts a permission in force: it takes the place of those before it.
fn in_force(axis: &mut Axis, index: usize) {
    axis.permits[index].in_force = true;
    axis.permits[index].is_relative = false;
    axis.permits.drain(..index);
}
