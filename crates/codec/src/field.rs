//! A field of a command: its name, unit, range and counts per unit.

/// One field of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldInfo {
    /// Name in snake_case, with the unit as its last part where there is one.
    pub name: &'static str,
    /// Unit of the name; empty for numbers without one.
    pub unit: &'static str,
    /// What the field holds.
    pub kind: FieldKind,
    /// Lowest value, in the unit.
    pub min: f64,
    /// Highest value, in the unit.
    pub max: f64,
    /// Counts on the wire for one unit.
    pub counts_per_unit: f64,
}

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FieldKind {
    /// A whole number.
    Integer,
    /// A measured or commanded quantity in the unit of the name.
    Physical,
    /// False or true, built from 0 or 1.
    Bool,
    /// A bit mask with named bits.
    Flags,
    /// A name or printable characters.
    Text,
    /// Bytes without further meaning.
    Bytes,
}

impl FieldInfo {
    /// One count on the wire, in the unit of the name.
    pub const fn lsb(&self) -> f64 {
        1.0 / self.counts_per_unit
    }

    /// A whole number in `min..=max`.
    pub const fn integer(name: &'static str, unit: &'static str, min: i64, max: i64) -> FieldInfo {
        FieldInfo::of(FieldKind::Integer, name, unit, min, max)
    }

    /// A quantity of which one unit is `counts_per_unit` counts; the range is given in counts.
    pub const fn physical(
        name: &'static str,
        unit: &'static str,
        counts: (i64, i64),
        counts_per_unit: f64,
    ) -> FieldInfo {
        FieldInfo {
            name,
            unit,
            kind: FieldKind::Physical,
            min: counts.0 as f64 / counts_per_unit,
            max: counts.1 as f64 / counts_per_unit,
            counts_per_unit,
        }
    }

    /// False or true.
    pub const fn boolean(name: &'static str) -> FieldInfo {
        FieldInfo::of(FieldKind::Bool, name, "", 0, 1)
    }

    /// A bit mask; its range is that of the bits that may be sent.
    pub const fn flags(name: &'static str, bits: i64) -> FieldInfo {
        FieldInfo::of(FieldKind::Flags, name, "", 0, bits)
    }

    /// A field that is only shown and has no range: text, bytes, or flags that are not sent.
    pub const fn other(kind: FieldKind, name: &'static str) -> FieldInfo {
        FieldInfo::of(kind, name, "", 0, 0)
    }

    /// The field under another name.
    pub const fn named(self, name: &'static str) -> FieldInfo {
        FieldInfo { name, ..self }
    }

    /// The field in a range, which is given in counts.
    pub const fn within(self, min: i64, max: i64) -> FieldInfo {
        FieldInfo {
            min: min as f64 / self.counts_per_unit,
            max: max as f64 / self.counts_per_unit,
            ..self
        }
    }

    const fn of(
        kind: FieldKind,
        name: &'static str,
        unit: &'static str,
        min: i64,
        max: i64,
    ) -> FieldInfo {
        FieldInfo { name, unit, kind, min: min as f64, max: max as f64, counts_per_unit: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a signed word in hundredths, as of the torque current (RMD V3.6 §2.17).
    #[test]
    fn the_range_of_a_quantity_is_in_its_unit() {
        let current = FieldInfo::physical("current_a", "A", (-32_768, 32_767), 100.0);
        assert_eq!((current.min, current.max, current.lsb()), (-327.68, 327.67, 0.01));
        assert_eq!(
            (current.name, current.unit, current.kind),
            ("current_a", "A", FieldKind::Physical)
        );
    }

    #[test]
    fn fields_that_are_not_scaled_count_ones() {
        let timeout = FieldInfo::integer("timeout_ms", "ms", 0, 0xFFFF_FFFF);
        let fields = [
            (timeout, FieldKind::Integer, "ms", 4_294_967_295.0),
            (FieldInfo::boolean("enabled"), FieldKind::Bool, "", 1.0),
            (FieldInfo::flags("frames", 0x07), FieldKind::Flags, "", 7.0),
            (FieldInfo::other(FieldKind::Text, "model"), FieldKind::Text, "", 0.0),
        ];
        for (field, kind, unit, max) in fields {
            assert_eq!((field.kind, field.unit, field.min, field.max), (kind, unit, 0.0, max));
            assert_eq!((field.counts_per_unit, field.lsb()), (1.0, 1.0));
        }
    }
}
