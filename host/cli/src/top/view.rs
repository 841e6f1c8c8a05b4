//! What the person at the terminal has chosen, and what is said to them.

use crate::live::Live;

/// What is said below the tables, and how much it matters.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Message {
    /// Something is not as it should be.
    pub is_bad: bool,
    /// The lines.
    pub lines: Vec<String>,
}

/// Beside the gateway itself, all that the screen shows.
#[derive(Debug, Default)]
pub struct View {
    /// The axis that is chosen, by its number.
    pub chosen: Option<u8>,
    /// The axis whose trip is cleared if the next key is yes.
    pub confirm: Option<u8>,
    /// What the last key came to.
    pub message: Message,
    /// Whether there are colours.
    pub colour: bool,
}

impl View {
    /// Says something.
    pub fn say(&mut self, line: &str) {
        self.message = Message { is_bad: false, lines: vec![line.to_owned()] };
    }

    /// Says that something failed.
    pub fn complain(&mut self, line: &str) {
        self.message = Message { is_bad: true, lines: vec![line.to_owned()] };
    }

    /// Chooses the axis so many places further down; there is always one chosen if there is one.
    pub fn choose(&mut self, live: &Live, down: isize) {
        let place = live.axes.iter().position(|axis| Some(axis.number) == self.chosen);
        let last = live.axes.len().saturating_sub(1);
        let place = place.map_or(0, |place| place.saturating_add_signed(down).min(last));
        self.chosen = live.axes.get(place).map(|axis| axis.number);
    }

    /// Asks whether to clear the trip of the chosen axis, if it has one.
    pub fn ask_to_clear(&mut self, live: &Live) {
        let chosen = live.axes.iter().find(|axis| Some(axis.number) == self.chosen);
        match chosen {
            None => self.say("no axis is configured"),
            Some(axis) if !axis.is_tripped() => {
                self.say(&format!("axis {} is not tripped", axis.number));
            }
            Some(axis) => self.confirm = Some(axis.number),
        }
    }
}
