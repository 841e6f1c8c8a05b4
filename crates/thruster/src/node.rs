//! The id of a device on its bus.

codec::node! {
    /// Id of one device, 1..=127 (Thruster manual §1.1).
    struct Node in 1..=127;
}
