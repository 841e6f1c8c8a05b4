//! What the gateway says: which request a result belongs to (G9).

use super::grants::in_force;
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::{Clears, Kind, Message, Request, event, events_lost, report};

/// Errors (PROTOCOL.md, Errors) that come before authority is looked at.
const READ_BEFORE_AUTHORITY: [u16; 10] = [1, 2, 5, 6, 7, 17, 44, 45, 75, 76];
/// Those that refuse whoever asks, the link in command too: what is stored, or an image on trial or
/// about to start, comes first.
const REFUSES_EVERYBODY: [u16; 3] = [81, 131, 133];
/// Those that refuse it: another link has it, or nobody and a watcher asks, or that of a link
/// without session.
const NOT_IN_COMMAND: [u16; 3] = [4, 96, 98];
/// What time alone refuses: `Tripped` and `Stale`. It does so before what happens at that instant is
/// looked at.
const BY_TIME: [u16; 2] = [13, 14];

impl Oracle {
    /// Bytes for a host leave the gateway.
    pub fn from_gateway(&mut self, now: u64, link: u8, bytes: &[u8]) {
        self.advance(now);
        let mut frames = 0;
        for byte in bytes {
            let Some(port) = self.links.get_mut(usize::from(link)) else { return };
            let Some(message) = port.outgoing.push(*byte) else { continue };
            frames += 1;
            match message.kind {
                Kind::Reply | Kind::Error => self.result(now, link, &message),
                Kind::Event => {
                    if link == self.listener && events_lost(&message) != Some(0) {
                        let seen = format!("link {link} reads, and events are lost");
                        self.broken(Check::ToldInPart, now, seen);
                    }
                    // Other links tell the same, later or not at all.
                    if link == self.listener
                        && let Some(news) = event(&message)
                    {
                        self.news(now, news);
                    }
                }
                Kind::Request | Kind::WatcherRequest => {
                    self.broken(Check::ResultUnasked, now, "a request of the gateway".into())
                }
            }
        }
        if frames != 1 {
            let seen = format!("link {link}: {frames} whole frames in {bytes:02X?}");
            self.broken(Check::ToldInPart, now, seen);
        }
    }

    /// The host of a link has read all there is: what it asked and what was not refused has been
    /// accepted.
    pub fn drained(&mut self, now: u64, link: u8) {
        let Some(port) = self.links.get_mut(usize::from(link)) else { return };
        port.drained_us = Some(now);
        // A repeated result whose bytes are not kept any more does not come.
        port.records.iter_mut().for_each(|record| record.again = false);
        port.records.retain(|record| {
            record.result.is_some() || !record.may_be_dropped || record.at_us == now
        });
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let accepted = |p: &crate::axis::Permit| {
                p.link == link
                    && !(p.in_force || p.is_relative || p.of_cycle || p.is_of_a_start_to_come())
            };
            if let Some(accepted) = axis.permits.iter().rposition(accepted) {
                in_force(axis, accepted);
                self.deliver(now, index);
            }
        }
    }

    fn result(&mut self, now: u64, link: u8, message: &Message) {
        let sequence = message.sequence;
        let port = &mut self.links[usize::from(link)];
        let of_it = |record: &&mut crate::link::Record| record.sequence == message.sequence;
        // A host may use a sequence twice: a reply says by its number which request it answers.
        let fits =
            |r: &crate::link::Record| message.kind == Kind::Error || r.number == message.number;
        let open = |r: &crate::link::Record| r.sequence == sequence && r.result.is_none();
        // An error does not: most come at once.
        let at_once = port.records.iter().position(|r| open(r) && fits(r) && r.at_us == now);
        // The same bytes again are the result that was asked for again, also where another request
        // has the sequence.
        let repeats = |r: &&mut crate::link::Record| {
            r.again && r.sequence == sequence && r.result.as_ref() == Some(&message.bytes)
        };
        if at_once.is_none()
            && let Some(record) = port.records.iter_mut().find(repeats)
        {
            record.again = false;
            return;
        }
        let place = at_once.or_else(|| port.records.iter().rposition(|r| open(r) && fits(r)));
        if let Some(record) = place.map(|at| &mut port.records[at]) {
            record.result = Some(message.bytes.clone());
            record.result_us = now;
            let (request, at) = (record.request.clone(), record.at_us);
            let (refused, took) = (record.must_be_refused, record.took);
            let is_reply = message.kind == Kind::Reply;
            let has_started = record.has_started;
            let is_by_time = record.started_us == Some(now) && BY_TIME.contains(&message.number);
            if refused
                && (is_reply
                    || !READ_BEFORE_AUTHORITY.contains(&message.number)
                        && !NOT_IN_COMMAND.contains(&message.number))
            {
                let seen = format!(
                    "link {link} is not in command; {request:?} is answered {}",
                    message.number
                );
                self.broken(Check::AuthorityIgnored, now, seen);
            }
            if matches!(request, Request::StartTogether { .. })
                && has_started.is_some_and(|has| has != is_reply)
                && !is_by_time
            {
                let seen =
                    format!("{request:?} is answered {}, started: {has_started:?}", message.number);
                self.broken(Check::StartUnproved, now, seen);
            }
            if is_reply {
                self.granted(now, link, sequence, &request, message);
                // What is told at once is how it is now.
                if link == self.listener
                    && at == now
                    && let Some(report) = report(message)
                {
                    self.reported(now, &request, report);
                }
            } else {
                if took && at == now && is_untaken(&request, message.number) {
                    self.holder = None;
                }
                if !refused
                    && let Request::Clear(Clears::Axis(axis))
                    | Request::ClearByRestart(axis)
                    | Request::ClearUnreachable(axis) = request
                    && let Some(axis) = self.axes.get_mut(usize::from(axis))
                {
                    axis.clearing = axis.clearing.saturating_sub(1);
                }
                if !refused
                    && let Request::Provision { axis, timeout_ms } = request
                    && let Some(axis) = self.axes.get_mut(usize::from(axis))
                {
                    axis.is_not_provisioned(timeout_ms);
                }
                self.refused(link, sequence);
            }
            return;
        }
        let seen = format!("link {link}: a second result for {sequence}");
        // Allowance: a host chooses another sequence than those of its last requests (PROTOCOL.md).
        // Where it does not, nobody can tell which of them a result is for.
        if port.records.iter().filter(|record| record.sequence == sequence).count() > 1 {
            return;
        }
        if !port.records.iter().any(|record| record.sequence == sequence) {
            self.broken(Check::ResultUnasked, now, format!("link {link}: nobody asked {sequence}"));
            return;
        }
        match port
            .records
            .iter_mut()
            .filter(of_it)
            .find(|r| r.result.as_ref() == Some(&message.bytes))
        {
            Some(record) if record.again => record.again = false,
            Some(_) => self.broken(Check::ResultUnasked, now, seen),
            None => self.broken(Check::ResultChanged, now, seen),
        }
    }
}

/// Whether a request that was refused so has not taken authority: what cannot be read, natives that
/// are none, and what is refused whoever asks.
fn is_untaken(request: &Request, error: u16) -> bool {
    matches!(error, 1 | 2)
        || REFUSES_EVERYBODY.contains(&error)
        || matches!(request, Request::Native { .. }) && READ_BEFORE_AUTHORITY.contains(&error)
}
