//! The keys of a gateway, and what a query for a key means. Pure.

use host_protocol::{MAX_NAME, is_name};

use crate::command::Word;
use crate::refusal::Refusal;

/// What all keys begin with.
pub const ROOT: &str = "motor-gateway";

const STATE: &str = "state";
const COMMAND: &str = "command";

/// A name of a gateway or of a peer.
///
/// # Errors
/// What a name may be.
pub fn check_name(text: &str) -> Result<String, String> {
    if is_name(text) {
        return Ok(text.to_owned());
    }
    Err(format!(
        "`{text}` is no name: 1 to {MAX_NAME} letters, digits, `-` and `_` of ASCII, a letter first, \
         neither `all` nor `gateway`"
    ))
}

/// The keys of one gateway.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keys {
    name: String,
}

/// What a query asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// How something is.
    State,
    /// That something is done.
    Command(Word),
}

impl Keys {
    /// Of the gateway of this name, which was checked.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned() }
    }

    /// The name of the gateway.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn under(&self, rest: &str) -> String {
        format!("{ROOT}/{}/{rest}", self.name)
    }

    /// Everything that is asked of this gateway.
    pub fn all(&self) -> String {
        self.under("**")
    }

    /// How it is, or a part of it: `gateway`, `link`, `bus/0`, `axis/0`.
    pub fn state(&self, part: &str) -> String {
        self.under(&format!("{STATE}/{part}"))
    }

    /// The samples of an axis.
    pub fn samples(&self, axis: u8) -> String {
        self.under(&format!("samples/axis/{axis}"))
    }

    /// Its events.
    pub fn events(&self) -> String {
        self.under("events")
    }

    /// A command.
    pub fn command(&self, word: Word) -> String {
        self.under(&format!("{COMMAND}/{}", word.text()))
    }

    /// The sign of life of a program that serves this name.
    pub fn alive(&self, id: &str) -> String {
        self.under(&format!("alive/{id}"))
    }

    /// The sign of life of a peer that wants to command.
    pub fn peer(&self, peer: &str) -> String {
        self.under(&format!("peer/{peer}"))
    }

    /// What a query for this key means; nothing if it means others. Only stops may be asked of many
    /// gateways at once.
    ///
    /// # Errors
    /// There is no such key, and which there are.
    pub fn meaning(&self, key: &str) -> Result<Option<Meaning>, Refusal> {
        let chunks: Vec<&str> = key.split('/').collect();
        let is_wild = key.contains(['*', '$']);
        let unknown = || Refusal::UnknownKey {
            key: key.to_owned(),
            known: format!("{}, {}", self.state("**"), self.commands()),
        };
        match chunks.as_slice() {
            [.., COMMAND, word] if !word.contains(['*', '$']) => {
                let word = Word::read(word).ok_or_else(unknown)?;
                if is_wild && !word.stops() {
                    return Err(Refusal::ManyGateways { word, key: self.command(word) });
                }
                Ok(Some(Meaning::Command(word)))
            }
            _ if is_wild && chunks.contains(&COMMAND) => Ok(None),
            _ if is_wild => Ok(Some(Meaning::State)),
            [ROOT, _, STATE, _, ..] => Ok(Some(Meaning::State)),
            _ => Err(unknown()),
        }
    }

    fn commands(&self) -> String {
        let words: Vec<&str> = Word::ALL.iter().map(|word| word.text()).collect();
        self.under(&format!("{COMMAND}/ with {}", words.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_what_it_may_have() {
        for good in ["a", "left-arm_2", "ABCDEFGHIJKLMNOP"] {
            assert_eq!(check_name(good), Ok(good.to_owned()));
        }
        for bad in ["", "2nd", "a b", "a/b", "*", "a$*", "all", "gateway", "ABCDEFGHIJKLMNOPQ", "ä"]
        {
            let said = check_name(bad).unwrap_err();
            assert!(said.contains("1 to 16 letters, digits, `-` and `_`"), "{bad}: {said}");
        }
    }

    #[test]
    fn a_query_means_what_its_key_says() {
        let keys = Keys::new("left");
        let means = |key: &str| keys.meaning(key).unwrap();
        assert_eq!(means("motor-gateway/left/state/axis/0"), Some(Meaning::State));
        assert_eq!(means("motor-gateway/left/command/arm"), Some(Meaning::Command(Word::Arm)));
        assert_eq!(means("motor-gateway/*/state/axis/*"), Some(Meaning::State));
        // Who asks for everything wants to know, not to stop.
        assert_eq!(means("motor-gateway/**"), Some(Meaning::State));
        assert_eq!(means("**"), Some(Meaning::State));
        assert_eq!(means("motor-gateway/left/command/*"), None);
        assert_eq!(means("motor-gateway/left/command/**"), None);
    }

    #[test]
    fn only_stops_are_for_many() {
        let keys = Keys::new("left");
        for (key, word) in [
            ("motor-gateway/*/command/stop", Word::Stop),
            ("motor-gateway/**/command/estop", Word::Estop),
            ("**/command/stop", Word::Stop),
        ] {
            assert_eq!(keys.meaning(key), Ok(Some(Meaning::Command(word))), "{key}");
        }
        for word in ["take", "arm", "setpoint", "keep_alive", "clear", "release"] {
            let refused = keys.meaning(&format!("motor-gateway/*/command/{word}"));
            assert!(matches!(refused, Err(Refusal::ManyGateways { .. })), "{word}: {refused:?}");
        }
    }

    #[test]
    fn a_wrong_key_is_told_which_there_are() {
        let keys = Keys::new("left");
        for key in [
            "motor-gateway/left/command/fly",
            "motor-gateway/left/command",
            "motor-gateway/left/command/arm/0",
            "motor-gateway/left/state",
            "motor-gateway/left/samples/axis/0",
            "motor-gateway/left",
        ] {
            let said = keys.meaning(key).unwrap_err().to_string();
            assert!(said.contains("motor-gateway/left/state/**"), "{key}: {said}");
            assert!(said.contains("setpoint"), "{key}: {said}");
        }
    }
}
