//! A plain CAN frame for the tests and benchmarks of the codecs.

use embedded_can::{Frame, Id};

/// A classic CAN frame, data or remote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: Id,
    remote: bool,
    dlc: usize,
    data: [u8; 8],
}

impl Frame for CanFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(CanFrame { id: id.into(), remote: false, dlc: data.len(), data: bytes })
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        (dlc <= 8).then(|| CanFrame { id: id.into(), remote: true, dlc, data: [0; 8] })
    }

    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.remote
    }

    fn id(&self) -> Id {
        self.id
    }

    fn dlc(&self) -> usize {
        self.dlc
    }

    #[inline]
    fn data(&self) -> &[u8] {
        if self.remote { &[] } else { &self.data[..self.dlc] }
    }
}

#[cfg(test)]
mod tests {
    use embedded_can::StandardId;

    use super::*;

    const ID: StandardId = StandardId::MAX;

    #[test]
    fn a_data_frame_holds_its_bytes() {
        let frame = CanFrame::new(ID, &[1, 2, 3]).unwrap();
        assert_eq!((frame.id(), frame.dlc(), frame.data()), (Id::Standard(ID), 3, &[1, 2, 3][..]));
        assert!(frame.is_data_frame() && frame.is_standard());
        assert_eq!(CanFrame::new(ID, &[0; 9]), None);
    }

    #[test]
    fn a_remote_frame_holds_a_length_and_no_bytes() {
        let frame = CanFrame::new_remote(ID, 8).unwrap();
        assert_eq!((frame.dlc(), frame.data()), (8, &[][..]));
        assert!(frame.is_remote_frame());
        assert_eq!(CanFrame::new_remote(ID, 9), None);
    }
}
