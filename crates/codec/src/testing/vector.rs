//! Golden vectors of protocols on CAN: lines of `label | direction | can | id#data | meaning |
//! source`.

use super::std::format;
use super::std::vec::Vec;
use core::fmt::Debug;

use embedded_can::{Frame, StandardId};

use super::CanFrame;

/// In the source column: accepted, but not the form that is sent.
const DECODE_ONLY: &str = "decode only";

/// One line.
#[derive(Debug)]
pub struct Vector<'a> {
    /// Its label.
    pub label: &'a str,
    /// `request`, `reply` or `event`.
    pub direction: &'a str,
    /// The CAN id.
    pub id: StandardId,
    /// The data, which in a misprint may be more than a frame holds.
    pub data: Vec<u8>,
    /// What it decodes to, as `Debug` shows it.
    pub meaning: &'a str,
    /// Where it stands, and what is special about it.
    pub source: &'a str,
}

/// The vectors of a file.
pub fn vectors(text: &str) -> Vec<Vector<'_>> {
    text.lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(Vector::parse)
        .collect()
}

impl<'a> Vector<'a> {
    /// A column may hold ` | ` only in the meaning, so the outer columns are split off first.
    fn parse(line: &'a str) -> Self {
        let mut columns = line.splitn(5, " | ");
        let mut column = || columns.next().unwrap_or_else(|| panic!("too few columns: {line}"));
        let (label, direction, transport, hex, rest) =
            (column(), column(), column(), column(), column());
        assert_eq!(transport, "can", "{label}");
        let (meaning, source) =
            rest.rsplit_once(" | ").unwrap_or_else(|| panic!("too few columns: {line}"));
        let (id, data) = hex.split_once('#').expect("id#data");
        let id =
            StandardId::new(u16::from_str_radix(id, 16).expect("hex id")).expect("standard id");
        assert!(data.is_ascii() && data.len().is_multiple_of(2), "{hex}");
        let data = (0..data.len())
            .step_by(2)
            .map(|start| u8::from_str_radix(&data[start..start + 2], 16).expect("hex data"))
            .collect();
        Self { label, direction, id, data, meaning, source }
    }

    /// The frame.
    #[must_use]
    pub fn frame(&self) -> CanFrame {
        CanFrame::new(self.id, &self.data).expect("at most eight bytes")
    }

    /// Compares the decoded value with the meaning and, if it is one that is sent, the bytes with
    /// its encoding.
    #[track_caller]
    pub fn check<T: Debug, D: Debug, E: Debug>(
        &self,
        decoded: Result<T, D>,
        encode: impl FnOnce(&T) -> Result<CanFrame, E>,
    ) {
        let label = self.label;
        let value = match decoded {
            Ok(value) => value,
            Err(error) => return assert_eq!(format!("Err({error:?})"), self.meaning, "{label}"),
        };
        assert_eq!(format!("{value:?}"), self.meaning, "{label}");
        let encoded = encode(&value);
        let is_sent_form = matches!(&encoded, Ok(frame) if *frame == self.frame());
        assert_eq!(
            is_sent_form,
            !self.source.contains(DECODE_ONLY),
            "{label}: encoded to {encoded:?}"
        );
    }
}
