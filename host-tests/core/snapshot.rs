//! What cannot be resumed. That what can be goes on as before, every test of this folder sees: its
//! gateway is resumed before each event.

use crate::rig::{BOARD, BOARD_VALUES, Rig};
use gateway::{Board, Gateway, MAX_SNAPSHOT, ResumeError};

#[test]
fn a_snapshot_of_other_bytes_or_of_another_board_is_refused() {
    let mut rig = Rig::new();
    let mut bytes = [0; MAX_SNAPSHOT];
    let taken = rig.gateway.snapshot(&mut bytes).unwrap().to_vec();

    let resumed = |bytes: &[u8]| Gateway::resume(&BOARD, bytes).map(|(_, behind)| behind.len());
    assert_eq!(resumed(&taken), Ok(0));
    assert_eq!(resumed(&[]), Err(ResumeError::Unreadable));
    assert_eq!(resumed(&taken[..taken.len() - 1]), Err(ResumeError::Unreadable));
    assert_eq!(resumed(&[&taken[..], &[7, 8]].concat()), Ok(2));

    static ONE_BUS: Board = Board { buses: BOARD_VALUES.buses.split_at(1).0, ..BOARD_VALUES };
    assert_eq!(Gateway::resume(&ONE_BUS, &taken).map(|_| ()), Err(ResumeError::OtherBoard));
}

#[test]
fn a_snapshot_that_does_not_fit_is_none() {
    let mut rig = Rig::new();
    let mut bytes = [0; MAX_SNAPSHOT];
    let length = rig.gateway.snapshot(&mut bytes).unwrap().len();
    assert_eq!(rig.gateway.snapshot(&mut bytes[..length - 1]), None);
    assert!(rig.gateway.snapshot(&mut bytes[..length]).is_some());
}
