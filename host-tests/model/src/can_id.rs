//! Ids of CAN frames as numbers: with bit 31 set they have 29 bits (PROTOCOL.md, `CanId`).

/// What marks an id of 29 bits.
pub const EXTENDED: u32 = 1 << 31;
/// Bits of such an id behind those that are compared with one of 11 bits.
const BEHIND: u32 = 18;

/// Whether an id has 29 bits.
pub fn is_extended(id: u32) -> bool {
    id & EXTENDED != 0
}

/// What decides the arbitration, the least wins: 11 bits as they go over the bus, then the bit that
/// is dominant in frames of 11 bits only, then 18 more.
pub fn rank(id: u32) -> (u32, bool, u32) {
    if !is_extended(id) {
        return (id, false, 0);
    }
    let id = id & !EXTENDED;
    (id >> BEHIND, true, id & ((1 << BEHIND) - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0503FFFF begins with 0x140, 05040000 with 0x141.
    #[test]
    fn ids_of_both_lengths_are_in_the_order_of_the_arbitration() {
        let order = [
            EXTENDED,
            0x001,
            EXTENDED | 0x0503_FFFF,
            0x141,
            EXTENDED | 0x0504_0000,
            EXTENDED | 0x0504_0001,
            0x142,
        ];
        assert!(order.is_sorted_by(|one, other| rank(*one) < rank(*other)));
    }
}
