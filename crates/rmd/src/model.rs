//! The motor's model name.

use codec::{FieldInfo, FieldKind, Shown, Visit};

/// Seven ASCII characters of 0xB5 (RMD V3.6 §2.32.3), kept as received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model(pub [u8; 7]);

impl Model {
    /// The name without trailing zeros; `None` if it holds anything but printable ASCII characters.
    pub fn as_str(&self) -> Option<&str> {
        let name = core::str::from_utf8(&self.0).ok()?.trim_end_matches('\0');
        name.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()).then_some(name)
    }
}

impl Shown for Model {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Text, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        match self.as_str() {
            Some(text) => field.visit_name(visit, Some(text)),
            None => field.visit_bytes(visit, &self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §2.32.4.
    #[test]
    fn printed_name() {
        assert_eq!(Model([0x58, 0x38, 0x53, 0x32, 0x56, 0x31, 0x30]).as_str(), Some("X8S2V10"));
        assert_eq!(Model(*b"RMD L5\0").as_str(), Some("RMD L5"));
        assert_eq!(Model([0; 7]).as_str(), Some(""));
        assert_eq!(Model([0x58, 0, 0x53, 0, 0, 0, 0]).as_str(), None);
        assert_eq!(Model([0xFF; 7]).as_str(), None);
    }
}
