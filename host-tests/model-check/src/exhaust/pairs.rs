//! Two axes that are tried together.

/// Two axes of the plant.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// What they speak, and where.
    pub name: &'static str,
    /// Their numbers.
    pub axes: [u8; 2],
}

const fn pair(name: &'static str, axes: [u8; 2]) -> Pair {
    Pair { name, axes }
}

/// Pairs on one bus, then on two.
pub const PAIRS: [Pair; 12] = [
    pair("RMD coast + RMD hold", [0, 1]),
    pair("RMD hold + RMD brake", [1, 2]),
    pair("RMD coast + thruster", [0, 3]),
    pair("RMD brake + thruster", [2, 4]),
    pair("thruster + thruster", [3, 4]),
    pair("D5 + D5", [6, 7]),
    pair("RS485: RMD hold + RMD coast", [8, 9]),
    pair("RMD hold | D5", [1, 6]),
    pair("thruster | D5", [3, 6]),
    pair("RMD coast | RS485: RMD hold", [0, 8]),
    pair("thruster | RS485: RMD coast", [3, 9]),
    pair("D5 | RS485: RMD hold", [6, 8]),
];
