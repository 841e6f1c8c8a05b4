//! Axes that share a bus: no motor's slowness delays another's motion, and stops go out in fair turns.

use crate::bench::{self, VELOCITY, arm_axis, e_stop, keep_moving};
use crate::rig::Instead;
use host_protocol::{AxisParameter, Request, Value, requests};

#[test]
fn slow_brakes_do_not_starve_the_motion_of_another_axis() {
    let mut rig = bench::rmd_axes(6);
    for axis in 1..6 {
        bench::parameter(&mut rig, axis, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    }
    rig.instead(|text| if text.contains("#77") { Instead::Nothing } else { Instead::AsUsual });
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 100_000);
    let since = rig.now_us;
    for axis in 1..6 {
        rig.send(&Request::Arm(requests::Arm { axis }));
    }
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 600_000);
    for brake in ["142#77", "143#77", "144#77", "145#77", "146#77"] {
        assert!(rig.sent_since(0, since).iter().any(|text| text.starts_with(brake)), "{brake}");
    }
    let gap = rig.longest_gap_us(0, since, "141#A2");
    assert!(gap <= 20_000, "{gap} µs between motion frames");
}

#[test]
fn every_axis_is_sent_its_first_stop_before_any_is_sent_its_second() {
    let mut rig = bench::rmd_axes(8);
    let moving = [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &moving, VELOCITY, 100_000);
    let since = rig.now_us;
    e_stop(&mut rig);
    rig.run(5_000);
    let sent = rig.sent_since(0, since);
    let stops = sent.into_iter().skip_while(|text| !text.ends_with("#8100000000000000"));
    let mut first_8: Vec<_> = stops.take(8).collect();
    first_8.sort_unstable();
    let stop_of_each = [
        "141#8100000000000000",
        "142#8100000000000000",
        "143#8100000000000000",
        "144#8100000000000000",
        "145#8100000000000000",
        "146#8100000000000000",
        "147#8100000000000000",
        "148#8100000000000000",
    ];
    assert_eq!(first_8, stop_of_each);
}
