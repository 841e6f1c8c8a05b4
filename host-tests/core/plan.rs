//! What a bus is planned to carry, from its configuration alone.

use crate::bench::{self, configure_axis};
use crate::rig::Rig;
use gateway::{Assumptions, BusPlan, Duration, Set};
use host_protocol::{Protocol, StopAction};

/// RMD axes with nodes from 1 on CAN bus 0 at 1 Mbit/s.
fn rmd(axes: u8) -> Rig {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
    for axis in 0..axes {
        configure_axis(&mut rig, axis, 0, Protocol::Rmd, axis + 1, StopAction::Hold);
    }
    rig
}

fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

fn assumed(delay_us: u64, software_us: u64) -> Assumptions {
    let reply_delay = [us(delay_us); gateway::MAX_AXES];
    Assumptions { reply_delay, software: us(software_us), ..Assumptions::DEFAULT }
}

fn plan(rig: &Rig, assumed: &Assumptions) -> BusPlan {
    rig.gateway.plan_bus(0, assumed).expect("bus 0 is configured")
}

/// A4 with a zero behind it, a speed limit and an angle; any reply of eight bytes.
const REQUEST: u64 = 129;
const REPLY: u64 = 132;

#[test]
fn frames_are_as_long_as_what_is_known_of_them_allows() {
    let rig = rmd(1);
    let axis = plan(&rig, &Assumptions::DEFAULT).axes[0];
    assert_eq!((axis.request_bits, axis.reply_bits, axis.replies), (REQUEST, REPLY, 1));
    // g + 2F: GUARANTEES G5 with F of 135 bits.
    assert_eq!((axis.stop_alone, axis.stop_together), (Some(us(370)), Some(us(370))));
}

/// Without delays the wire is never idle; with one of 200 µs two axes still answer while others
/// are asked, and one waits.
#[test]
fn replies_come_while_others_are_asked() {
    type Cycle = fn(u64, u64) -> u64;
    let cases: [(u8, u64, Cycle); 4] = [
        (1, 0, |requests, replies| requests + replies),
        (4, 0, |requests, replies| requests + replies),
        (1, 200, |requests, replies| requests + 200 + replies),
        // The second request leaves while the first motor makes up its reply.
        (2, 200, |_, replies| REQUEST + 200 + replies),
    ];
    for (axes, delay, cycle) in cases {
        let plan = plan(&rmd(axes), &assumed(delay, 0));
        let requests = plan.axes.iter().map(|axis| axis.request_bits).sum();
        let replies = plan.axes.iter().map(|axis| axis.reply_bits).sum();
        assert_eq!(plan.cycle.as_micros(), cycle(requests, replies), "{axes} {delay}");
        assert_eq!(plan.wire.as_micros(), requests + replies);
        assert!(plan.period > Some(plan.cycle) && plan.longest > plan.period);
        assert_eq!(plan.axes.last().map(|axis| axis.answered), Some(plan.cycle));
    }
    // Each request leaves 100 µs behind the one before, where no reply comes between.
    let gaps = plan(&rmd(3), &assumed(1_000, 100));
    let frames: u64 = gaps.axes.iter().map(|axis| axis.request_bits).sum();
    assert_eq!(gaps.cycle.as_micros(), frames + 200 + 1_000 + gaps.axes[2].reply_bits);
}

#[test]
fn foreign_frames_take_their_part_of_everything() {
    let rig = rmd(2);
    let quiet = plan(&rig, &Assumptions::DEFAULT);
    let busy = plan(&rig, &Assumptions { foreign_frames_s: 2_000, ..Assumptions::DEFAULT });
    assert_eq!((quiet.foreign_permille, busy.foreign_permille), (0, 320));
    assert!(busy.period > quiet.period && busy.longest > quiet.longest);
    // (100 + 2 · 135 + 135 + 25) / (1 − 0.32), rounded down: a foreign frame may have an id of 29
    // bits, and then has 25 more.
    assert_eq!(busy.axes[0].stop_alone, Some(us(530_000 / 680)));
    let full = plan(&rig, &Assumptions { foreign_frames_s: 8_000, ..Assumptions::DEFAULT });
    assert_eq!((full.period, full.longest), (None, None));
    // A stop has no bound there.
    assert_eq!((full.axes[0].stop_alone, full.axes[0].stop_together), (None, None));
}

#[test]
fn only_the_axes_that_take_part_are_planned() {
    let rig = rmd(4);
    let one = plan(&rig, &Assumptions { axes: Set::of(2_u8), ..Assumptions::DEFAULT });
    assert_eq!(one.axes.iter().map(|axis| axis.axis).collect::<Vec<_>>(), [2]);
    // But all stop.
    assert_eq!(one.axes[0].stop_together, Some(us(100 + 4 * 270)));
    assert_eq!(rig.gateway.plan_bus(1, &Assumptions::DEFAULT), None);
    assert_eq!(rig.gateway.plan_bus(9, &Assumptions::DEFAULT), None);
}

/// A line is asked in turn: 2C, the delay, and a pause of 20 bits before either.
#[test]
fn a_line_is_asked_in_turn() {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 2, 2_000_000, &[Protocol::Rmd]);
    for axis in 0..2 {
        configure_axis(&mut rig, axis, 2, Protocol::Rmd, axis + 1, StopAction::Hold);
    }
    let plan = rig.gateway.plan_bus(2, &assumed(50, 0)).unwrap();
    // 13 bytes of 10 bits.
    assert_eq!(plan.axes[0].request_bits, 130);
    assert_eq!(plan.cycle, us(2 * (65 + 10 + 50 + 65 + 10)));
}

/// Bits of a standard frame on the wire, with intermission.
fn wire_bits(id: u16, data: &[u8]) -> u64 {
    let length = u32::try_from(data.len()).unwrap();
    let header = [(0, 1), (u32::from(id), 11), (0, 3), (length, 4)];
    let fields = header.into_iter().chain(data.iter().map(|byte| (u32::from(*byte), 8)));
    let bit = |(value, count): (u32, u32)| (0..count).rev().map(move |at| value >> at & 1 == 1);
    let mut bits: Vec<bool> = fields.flat_map(bit).collect();
    let crc = bits.iter().fold(0_u32, |crc, bit| {
        let shifted = crc << 1 & 0x7FFF;
        if (crc >> 14 == 1) == *bit { shifted } else { shifted ^ 0x4599 }
    });
    bits.extend(bit((crc, 15)));
    let (mut run, mut last, mut stuffed) = (0, true, 0);
    for bit in &bits {
        (run, last) = (if *bit == last { run + 1 } else { 1 }, *bit);
        if run == 5 {
            (run, last, stuffed) = (1, !bit, stuffed + 1);
        }
    }
    bits.len() as u64 + stuffed + 13
}

/// VC and TC of a thruster, writes of a D5's speed, torque, speed and position of an RMD.
#[test]
fn no_setpoint_is_longer_than_planned() {
    let planned = |rig: Rig, bus| {
        rig.gateway.plan_bus(bus, &Assumptions::DEFAULT).unwrap().axes[0].request_bits
    };
    let thruster = planned(bench::thruster().0, 0);
    for value in (-0x1000..0x1000_i16).map(i16::to_be_bytes) {
        for command in [*b"VC\0\0", *b"TC\0\0"] {
            let data = [&command[..], &[0, 0], &value].concat();
            assert!(wire_bits(0x30B, &data) <= thruster, "{data:02X?}");
        }
    }
    let d5 = planned(bench::d5().0, 1);
    for [low, high] in (0..=u16::MAX).map(u16::to_le_bytes) {
        let mut data = [0xD5, 0x0B, 5, 3, 0x20, low, high, 0];
        data[7] = data[1..7].iter().fold(0, |sum, byte| byte.wrapping_add(sum));
        assert!(wire_bits(0x00B, &data) <= d5, "{data:02X?}");
    }
    let rmd = planned(rmd(1), 0);
    let mut dice = fastrand::Rng::with_seed(0x9E37_79B9);
    for _ in 0..100_000 {
        // Few bits set, or few that are not, make the longest frames.
        let word = dice.u64(..) & dice.u64(..) & dice.u64(..);
        let [speed @ .., a, b, c, d, _, _] = if dice.bool() { word } else { !word }.to_le_bytes();
        for head in [[0xA1, 0, 0, 0], [0xA2, 0, 0, 0], [0xA4, 0, speed[0], speed[1]]] {
            let data = [head, [a, b, c, d]].concat();
            assert!(wire_bits(0x141, &data) <= rmd, "{data:02X?}");
        }
    }
}
