//! What motors say of themselves: model and firmware, in their own answers.

use std::collections::BTreeMap;

use rmd::{Dialect, Reply as Rmd};

use super::pairing::Pair;
use super::table::to_word;
use crate::frames::Reply;

/// The parts in which a V4.4 motor tells its model (V4.4 0xB5).
const MODEL_PARTS: [u8; 3] = [1, 2, 3];

/// What is known of a motor.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Identity {
    /// Its model, in one piece.
    model: Option<String>,
    /// The same in three parts (V4.4 0xB5).
    parts: BTreeMap<u8, String>,
    /// The date of its firmware.
    firmware: Option<String>,
}

impl Identity {
    /// Takes what it has answered.
    pub fn hear(&mut self, pair: &Pair) {
        let Reply::Rmd(reply) = &pair.reply else { return };
        match reply {
            Rmd::VersionDate { date } => self.firmware = Some(date.0.to_string()),
            Rmd::Model { model } => match model.as_str() {
                Some(model) => self.model = Some(model.to_owned()),
                None => self.hear_part(reply),
            },
            _ => {}
        }
    }

    /// A V4.4 motor tells its model in parts, which the same bytes say.
    fn hear_part(&mut self, reply: &Rmd) {
        let decoded = reply.encode().ok().map(|data| Rmd::decode_in(Dialect::V4_4, &data));
        if let Some(Ok(Rmd::ModelPart { part, text })) = decoded
            && let Some(text) = text.as_str()
        {
            self.parts.insert(part, text.to_owned());
        }
    }

    /// Its model as a word; nothing where it has not told it, or not all of it.
    pub fn model(&self) -> Option<String> {
        let parts = MODEL_PARTS.iter().map(|part| self.parts.get(part).map(String::as_str));
        let whole = parts.collect::<Option<Vec<_>>>().map(|parts| parts.concat());
        whole.or_else(|| self.model.clone()).map(|model| to_word(&model))
    }

    /// Its firmware as a word; nothing where it has not told it.
    pub fn firmware(&self) -> Option<String> {
        self.firmware.as_deref().map(to_word)
    }
}
