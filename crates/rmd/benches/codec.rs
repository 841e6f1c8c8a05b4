//! Time of one frame, and bytes per second of the deframer.

use std::hint::black_box;
use std::time::Duration;

use codec_testing::CanFrame;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use embedded_can::{Frame, StandardId};
use rmd::rs485::{self, Deframer, Scan};
use rmd::{
    Centiamps, Centidegrees, CentidegreesPerSecond, MotionCommand, Node, Request, SpeedLimit,
    answer, can,
};

/// A long read of a serial line: 4096 frames.
const LINE_FRAMES: usize = 4096;

fn received(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::new(StandardId::new(id).expect("11 bits"), &data).expect("8 bytes")
}

fn requests() -> [(&'static str, Request); 5] {
    [
        ("read_status_2", Request::ReadStatus2),
        ("torque_current", Request::TorqueCurrent { current: Centiamps(100) }),
        ("velocity", Request::Velocity { speed: CentidegreesPerSecond(10_000) }),
        (
            "absolute_position",
            Request::AbsolutePosition { max_speed: SpeedLimit(500), angle: Centidegrees(36_000) },
        ),
        ("motion_mode", Request::MotionMode { command: MotionCommand::NEUTRAL }),
    ]
}

/// The replies that RMD V3.6 prints.
fn replies() -> [(&'static str, CanFrame); 4] {
    [
        ("status_1", received(0x241, [0x9A, 0x32, 0x00, 0x01, 0xE5, 0x01, 0x04, 0x00])),
        ("status_2", received(0x241, [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00])),
        ("torque_current", received(0x241, [0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00])),
        ("motion_mode", received(0x501, [0x01, 0xE6, 0x65, 0x82, 0xEB, 0x55, 0x00, 0x00])),
    ]
}

fn can_frames(criterion: &mut Criterion) {
    let node = Node::new(1).expect("1..=32");
    let mut group = criterion.benchmark_group("rmd can");
    for (name, request) in requests() {
        group.bench_function(format!("encode request {name}"), |bench| {
            bench.iter(|| can::request::<CanFrame>(black_box(node), black_box(&request)));
        });
        let frame: CanFrame = can::request(node, &request).expect("encodable");
        group.bench_function(format!("decode request {name}"), |bench| {
            bench.iter(|| can::decode_any_request(black_box(&frame)));
        });
    }
    for (name, frame) in replies() {
        group.bench_function(format!("decode reply {name}"), |bench| {
            bench.iter(|| can::decode_reply(black_box(&frame)));
        });
        let (node, reply) = can::decode_reply(&frame).expect("a reply");
        group.bench_function(format!("encode reply {name}"), |bench| {
            bench.iter(|| can::reply::<CanFrame>(black_box(node), black_box(&reply)));
        });
    }
    let request = Request::ReadStatus2;
    let (_, reply) = can::decode_reply(&replies()[1].1).expect("a reply");
    group.bench_function("match reply status_2", |bench| {
        bench.iter(|| answer(black_box(&request), black_box(&reply)));
    });
    group.finish();
}

fn serial_frames(criterion: &mut Criterion) {
    let node = Node::new(1).expect("1..=32");
    let frame = rs485::request(node, &Request::ReadStatus2).expect("encodable");
    let mut group = criterion.benchmark_group("rmd rs485");
    group.bench_function("encode request read_status_2", |bench| {
        bench.iter(|| rs485::request(black_box(node), black_box(&Request::ReadStatus2)));
    });
    group.bench_function("decode request read_status_2", |bench| {
        bench.iter(|| rs485::decode_request(black_box(&frame)));
    });
    let clean = frame.repeat(LINE_FRAMES);
    // Header bytes without a frame behind them, before each frame.
    let disturbed = [&[0x3E, 0x01, 0x3E, 0x01, 0x08][..], &frame].concat().repeat(LINE_FRAMES);
    for (name, line) in [("clean", clean), ("disturbed", disturbed)] {
        group.throughput(Throughput::Bytes(u64::try_from(line.len()).expect("fits")));
        group.bench_function(format!("deframer {name} line"), |bench| {
            bench.iter(|| Deframer::new().push_slice(black_box(&line)).count());
        });
        group.bench_function(format!("scan {name} line"), |bench| {
            bench.iter(|| Scan::new(black_box(&line)).count());
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = can_frames, serial_frames
}
criterion_main!(benches);
