//! The motor's model name.

use codec::{FieldInfo, FieldKind, Shown, Visit};

/// Characters of a name, kept as received.
macro_rules! text {
    ($(#[$doc:meta])* $Text:ident: $LEN:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $Text(pub [u8; $LEN]);

        impl $Text {
            /// The text without trailing zeros; `None` if it holds anything but printable ASCII
            /// characters.
            pub fn as_str(&self) -> Option<&str> {
                let name = core::str::from_utf8(&self.0).ok()?.trim_end_matches('\0');
                name.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()).then_some(name)
            }
        }

        impl Shown for $Text {
            const INFO: FieldInfo = FieldInfo::other(FieldKind::Text, "");

            fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
                match self.as_str() {
                    Some(text) => field.visit_name(visit, Some(text)),
                    None => field.visit_bytes(visit, &self.0),
                }
            }
        }
    };
}

text! {
    /// Seven ASCII characters of 0xB5 (RMD V3.6 §2.32.3).
    Model: 7
}
text! {
    /// Five of the fifteen ASCII characters of 0xB5 of a V4.4 motor.
    ModelPart: 5
}
