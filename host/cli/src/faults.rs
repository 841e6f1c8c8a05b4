//! The bits of a motor's fault word in words: what its manual calls them, what the motor's light
//! shows, how they end.

use gateway::MAX_AXES;
use host_protocol::{AxisSummary, Protocol};
use rmd::FaultLevel;

/// What the motor of each axis speaks, as far as that is known.
#[derive(Debug, Clone, Copy, Default)]
pub struct Protocols([Option<Protocol>; MAX_AXES]);

impl Protocols {
    /// As the gateway lists its axes.
    pub fn new(axes: &[AxisSummary]) -> Self {
        let mut protocols = Self::default();
        for axis in axes {
            if let Some(protocol) = protocols.0.get_mut(usize::from(axis.axis)) {
                *protocol = axis.protocol;
            }
        }
        protocols
    }

    /// Of one axis.
    pub fn of(&self, axis: u8) -> Option<Protocol> {
        self.0.get(usize::from(axis)).copied().flatten()
    }
}

/// Those bits of a word that the motor's manual lists, lowest first: their names and, of an RMD, how
/// they end.
fn listed(protocol: Protocol, word: u16) -> Vec<(u16, &'static str, Option<FaultLevel>)> {
    match protocol {
        Protocol::Rmd => rmd::Faults::from_bits_retain(word)
            .infos()
            .map(|info| (info.fault.bits(), info.name, Some(info.level)))
            .collect(),
        Protocol::Thruster => thruster::Faults::from_bits_retain(word)
            .infos()
            .map(|info| (info.fault.bits(), info.name, None))
            .collect(),
        Protocol::D5 => d5::Faults::from_bits_retain(word.to_le_bytes()[0])
            .infos()
            .map(|info| (info.fault.bits().into(), info.name, None))
            .collect(),
    }
}

/// The names of those bits that the motor's manual lists, lowest bit first.
pub fn names(protocol: Option<Protocol>, word: u16) -> Vec<&'static str> {
    let listed = protocol.into_iter().flat_map(|protocol| listed(protocol, word));
    listed.map(|(_, name, _)| name).collect()
}

/// A fault word for people: `stall, under voltage (0x0006)`, or only the word.
pub fn in_words(protocol: Option<Protocol>, word: u16) -> String {
    let names = names(protocol, word);
    if names.is_empty() {
        return format!("{word:#06x}");
    }
    format!("{} ({word:#06x})", names.join(", ").replace('_', " "))
}

/// A line for each bit of the word that the manual lists, and one for those that it does not.
pub fn explain(axis: u8, protocol: Protocol, word: u16) -> Vec<String> {
    let line =
        |bits: u16, name: &str, more: &str| format!("axis {axis}: {name} ({bits:#06x}){more}");
    let listed = listed(protocol, word);
    let known = listed.iter().map(|(bits, name, level)| {
        line(*bits, name, &level.map_or(String::new(), |level| rmd_end(axis, level)))
    });
    let mut lines: Vec<String> = known.collect();
    let unlisted = listed.iter().fold(word, |left, (bits, ..)| left & !bits);
    if unlisted != 0 {
        lines.push(line(unlisted, "a fault that the manual does not list", ""));
    }
    lines
}

/// What the light of an RMD shows, and how the fault ends (RMD V3.6 §8.1).
fn rmd_end(axis: u8, level: FaultLevel) -> String {
    match level {
        FaultLevel::Recovers => {
            ": the motor's light flashes slowly until the cause is gone; then the motor resumes by \
                itself"
                .into()
        }
        FaultLevel::UntilRestart => format!(
            ": the motor's light flashes fast until the motor restarts; remove the cause, then \
                `mgw clear {axis} --restart`"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §8.1: a fast flash is level 1, a slow one level 2.
    #[test]
    fn the_light_of_an_rmd_tells_how_its_fault_ends() {
        assert_eq!(
            explain(3, Protocol::Rmd, 0x8006),
            [
                "axis 3: stall (0x0002): the motor's light flashes fast until the motor restarts; \
                    remove the cause, then `mgw clear 3 --restart`",
                "axis 3: under_voltage (0x0004): the motor's light flashes slowly until the cause \
                    is gone; then the motor resumes by itself",
                "axis 3: a fault that the manual does not list (0x8000)",
            ]
        );
    }

    #[test]
    fn faults_of_the_other_protocols_have_their_names() {
        assert_eq!(explain(0, Protocol::Thruster, 0x0800), ["axis 0: timeout (0x0800)"]);
        assert_eq!(
            explain(1, Protocol::D5, 0x0150),
            ["axis 1: stall (0x0040)", "axis 1: a fault that the manual does not list (0x0110)"]
        );
        assert!(explain(0, Protocol::D5, 0).is_empty());
    }
}
