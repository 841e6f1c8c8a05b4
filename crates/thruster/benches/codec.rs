//! Time of one frame.

use std::hint::black_box;
use std::time::Duration;

use codec_testing::CanFrame;
use criterion::{Criterion, criterion_group, criterion_main};
use embedded_can::{Frame, StandardId};
use thruster::{Decidegrees, Node, Percent, Request, Rpm, RpmLimit, answer, can};

fn received(data: [u8; 8]) -> CanFrame {
    CanFrame::new(StandardId::new(0x28B).expect("11 bits"), &data).expect("8 bytes")
}

fn requests() -> [(&'static str, Request); 4] {
    [
        ("signal", Request::Signal { signal: Percent(-5) }),
        ("speed", Request::Speed { speed: Rpm(-1500) }),
        ("read_speed", Request::ReadSpeed),
        (
            "absolute_position",
            Request::AbsolutePosition { speed: RpmLimit(300), position: Decidegrees(900) },
        ),
    ]
}

/// An echo, a value, a refusal, and speed, voltage and current for a signal (Thruster manual §1.3,
/// §2.1, §2.4).
fn replies() -> [(&'static str, CanFrame); 4] {
    [
        ("signal", received([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFB])),
        ("measured_speed", received([0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0xFA, 0x24])),
        ("refusal", received([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE])),
        ("returned_motion", received([0x54, 0x01, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A])),
    ]
}

fn can_frames(criterion: &mut Criterion) {
    let node = Node::new(0x0B).expect("1..=127");
    let mut group = criterion.benchmark_group("thruster can");
    for (name, request) in requests() {
        group.bench_function(format!("encode request {name}"), |bench| {
            bench.iter(|| can::request::<CanFrame>(black_box(node), black_box(&request)));
        });
        let frame: CanFrame = can::request(node, &request).expect("encodable");
        group.bench_function(format!("decode request {name}"), |bench| {
            bench.iter(|| can::decode_request(black_box(&frame)));
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
    let (_, reply) = can::decode_reply(&replies()[0].1).expect("a reply");
    let request = Request::Signal { signal: Percent(-5) };
    group.bench_function("match reply signal", |bench| {
        bench.iter(|| answer(black_box(&request), black_box(&reply)));
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = can_frames
}
criterion_main!(benches);
