//! Who commands: one peer at a time, for as long as it shows signs of life. Pure.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::command::Lease;
use crate::refusal::Refusal;

/// How long taking command may last: the gateway's hello and its answers. The peer has no lease
/// yet, and so cannot say that it is there.
const TAKE_WITHIN: Duration = Duration::from_millis(2_500);

/// The peer in command.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Holder {
    lease: Lease,
    peer: String,
    heard: Duration,
    silence: Duration,
}

/// Who commands.
#[derive(Debug, Default)]
pub struct Authority {
    holder: Option<Holder>,
    /// Peers that show a sign of life.
    present: BTreeSet<String>,
    /// Other gateways of the same name.
    twins: BTreeSet<String>,
}

impl Authority {
    /// A peer shows a sign of life.
    pub fn arrived(&mut self, peer: &str) {
        self.present.insert(peer.to_owned());
    }

    /// Its sign of life is gone: what it commanded is over at once.
    pub fn left(&mut self, peer: &str) {
        self.present.remove(peer);
        self.holder.take_if(|holder| holder.peer == peer);
    }

    /// Whether a peer shows a sign of life.
    pub fn is_present(&self, peer: &str) -> bool {
        self.present.contains(peer)
    }

    /// Another gateway of the same name is there, or has gone. While there is one nobody commands.
    pub fn twin(&mut self, id: &str, is_there: bool) {
        if is_there {
            self.twins.insert(id.to_owned());
            self.holder = None;
        } else {
            self.twins.remove(id);
        }
    }

    /// A peer takes command, which it has when [`begin`](Self::begin) follows.
    ///
    /// # Errors
    /// Another commands, or this one shows no sign of life.
    pub fn take(
        &mut self,
        now: Duration,
        peer: &str,
        lease: Lease,
        name: &str,
        key: &str,
    ) -> Result<(), Refusal> {
        if !self.twins.is_empty() {
            return Err(Refusal::NameTwice { name: name.to_owned() });
        }
        if !self.is_present(peer) {
            return Err(Refusal::NoSignOfLife { key: key.to_owned() });
        }
        self.end_of_the_silent(now);
        if let Some(holder) = &self.holder {
            return Err(Refusal::NotInCommand { by: holder.peer.clone() });
        }
        let peer = peer.to_owned();
        self.holder = Some(Holder { lease, peer, heard: now, silence: TAKE_WITHIN });
        Ok(())
    }

    /// The gateway has given command; from now on the peer may be silent for so long. Whether it
    /// still is the one.
    pub fn begin(&mut self, now: Duration, lease: Lease, silence: Duration) -> bool {
        let is_it = self.may_send(now, lease);
        if let Some(holder) = self.holder.as_mut().filter(|_| is_it) {
            (holder.heard, holder.silence) = (now, silence);
        }
        is_it
    }

    /// The peer in command was heard.
    ///
    /// # Errors
    /// It does not command, or no longer.
    pub fn hear(&mut self, now: Duration, lease: Lease) -> Result<(), Refusal> {
        self.end_of_the_silent(now);
        match &mut self.holder {
            Some(holder) if holder.lease == lease => {
                holder.heard = now;
                Ok(())
            }
            _ => Err(Refusal::LeaseOver),
        }
    }

    /// Whether anything may be sent to the gateway for this peer.
    pub fn may_send(&mut self, now: Duration, lease: Lease) -> bool {
        self.end_of_the_silent(now);
        self.holder.as_ref().is_some_and(|holder| holder.lease == lease)
    }

    /// It no longer commands.
    pub fn end(&mut self, lease: Lease) {
        self.holder.take_if(|holder| holder.lease == lease);
    }

    fn end_of_the_silent(&mut self, now: Duration) {
        self.holder.take_if(|holder| now.saturating_sub(holder.heard) > holder.silence);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENCE: Duration = Duration::from_millis(250);
    const A: Lease = Lease(1);
    const B: Lease = Lease(2);

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn take(authority: &mut Authority, at: u64, peer: &str, lease: Lease) -> Result<(), Refusal> {
        authority.take(ms(at), peer, lease, "left", "the key")
    }

    /// Peer `a` commands from 0 ms on; `b` is there.
    fn commanded() -> Authority {
        let mut authority = Authority::default();
        authority.arrived("a");
        authority.arrived("b");
        assert_eq!(take(&mut authority, 0, "a", A), Ok(()));
        assert!(authority.begin(ms(0), A, SILENCE));
        authority
    }

    #[test]
    fn one_commands_at_a_time() {
        let mut authority = commanded();
        let held = Err(Refusal::NotInCommand { by: "a".to_owned() });
        assert_eq!(take(&mut authority, 10, "b", B), held);
        assert_eq!(take(&mut authority, 10, "a", B), held, "a second session of the same name");
        assert_eq!(authority.hear(ms(10), B), Err(Refusal::LeaseOver));
        assert!(!authority.may_send(ms(10), B));
        assert!(authority.may_send(ms(10), A));
        authority.end(B);
        assert!(authority.may_send(ms(10), A), "another's lease ends nothing");
        authority.end(A);
        assert_eq!(take(&mut authority, 11, "b", B), Ok(()));
    }

    #[test]
    fn what_is_silent_is_over_and_stays_so() {
        let mut authority = commanded();
        assert_eq!(authority.hear(ms(200), A), Ok(()));
        assert!(authority.may_send(ms(450), A));
        assert!(!authority.may_send(ms(451), A));
        // A process that goes on after it was halted does not command again by that.
        assert_eq!(authority.hear(ms(452), A), Err(Refusal::LeaseOver));
        assert!(!authority.may_send(ms(452), A));
        assert_eq!(take(&mut authority, 453, "b", B), Ok(()));
    }

    #[test]
    fn silence_counts_without_anybody_looking() {
        let mut authority = commanded();
        assert_eq!(authority.hear(ms(251), A), Err(Refusal::LeaseOver));
    }

    #[test]
    fn who_has_gone_is_over_at_once() {
        let mut authority = commanded();
        authority.left("b");
        assert!(authority.may_send(ms(1), A));
        authority.left("a");
        assert!(!authority.may_send(ms(1), A));
        authority.arrived("a");
        assert_eq!(authority.hear(ms(2), A), Err(Refusal::LeaseOver));
    }

    #[test]
    fn without_a_sign_of_life_nobody_commands() {
        let mut authority = Authority::default();
        let refused = take(&mut authority, 0, "a", A);
        assert_eq!(refused, Err(Refusal::NoSignOfLife { key: "the key".to_owned() }));
        assert!(!authority.may_send(ms(0), A));
    }

    #[test]
    fn taking_command_has_its_time_too() {
        let mut authority = Authority::default();
        authority.arrived("a");
        authority.arrived("b");
        assert_eq!(take(&mut authority, 0, "a", A), Ok(()));
        assert!(authority.may_send(ms(2_500), A));
        assert!(!authority.begin(ms(2_501), A, SILENCE));
        assert_eq!(take(&mut authority, 2_502, "b", B), Ok(()));
        authority.left("b");
        assert!(!authority.begin(ms(2_503), B, SILENCE), "it has gone while it took command");
    }

    #[test]
    fn with_two_gateways_of_a_name_nobody_commands() {
        let mut authority = commanded();
        authority.twin("1", true);
        authority.twin("2", true);
        assert!(!authority.may_send(ms(1), A));
        let refused = Err(Refusal::NameTwice { name: "left".to_owned() });
        assert_eq!(take(&mut authority, 2, "a", B), refused);
        authority.twin("1", false);
        assert_eq!(take(&mut authority, 2, "a", B), refused);
        authority.twin("2", false);
        assert_eq!(take(&mut authority, 2, "a", B), Ok(()));
    }
}
