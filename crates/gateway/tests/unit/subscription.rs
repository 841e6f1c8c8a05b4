//! Tests of `link/subscription.rs`.

extern crate std;
use std::vec::Vec;

use super::*;

fn subscription(axes: u32, period_us: u32) -> Subscription {
    let request = requests::Subscribe { axes, fields: StateFields::NONE, period_us };
    Subscription::new(1_000, &request).unwrap().unwrap()
}

#[test]
fn each_axis_is_due_once_in_a_period() {
    let mut subscription = subscription(0b1010, 2_000);
    subscription.tick(1_000);
    assert_eq!(subscription.take(), Some((1, StateFields::NONE, 0)));
    assert_eq!(subscription.take(), Some((3, StateFields::NONE, 0)));
    assert_eq!(subscription.take(), None);
    subscription.tick(2_999);
    assert!(!subscription.is_due());
    subscription.tick(3_000);
    assert!(subscription.is_due());
}

#[test]
fn what_was_not_taken_in_time_is_counted_and_the_grid_is_kept() {
    let mut subscription = subscription(0b11, 1_000);
    subscription.tick(1_000);
    subscription.tick(5_400);
    assert_eq!(subscription.take(), Some((0, StateFields::NONE, 2)));
    assert_eq!(subscription.next_us, 6_000);
}

#[test]
fn a_link_with_room_for_one_sample_in_a_period_serves_the_axes_in_turn() {
    let mut subscription = subscription(0b1000_0000_0000_0000_0000_0000_0000_0101, 1_000);
    let mut served = Vec::new();
    for period in 1..=4 {
        subscription.tick(period * 1_000);
        served.extend(subscription.take().map(|(axis, ..)| axis));
    }
    assert_eq!(served, [0, 2, 31, 0]);
}

#[test]
fn the_last_axis_has_a_bit_and_none_beyond() {
    let subscription = subscription(1 << 31, 1_000);
    assert!(subscription.watches(31) && !subscription.watches(32) && !subscription.watches(0));
}

#[test]
fn a_period_out_of_range_is_refused_and_no_axis_ends_it() {
    let request =
        |axes, period_us| requests::Subscribe { axes, fields: StateFields::NONE, period_us };
    assert!(Subscription::new(0, &request(1, 999)).is_err());
    assert!(Subscription::new(0, &request(0, 10_000_001)).is_err());
    assert!(matches!(Subscription::new(0, &request(0, 1_000)), Ok(None)));
}
