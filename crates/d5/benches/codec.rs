//! Time of one frame, and bytes per second of the deframer.

use std::hint::black_box;
use std::time::Duration;

use codec_testing::CanFrame;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use d5::serial::Deframer;
use d5::{Address, Node, Register, Request, Value, Width, answer, can, request_frame};
use embedded_can::Frame;

/// A long read of a serial line: 4096 frames.
const LINE_FRAMES: usize = 4096;

fn requests() -> [(&'static str, Request); 3] {
    [
        ("query_id", Request::QueryId),
        ("read_word", Request::Read { register: Register::CURRENT_SPEED, width: Width::Word }),
        ("write_speed", Request::Write { register: Register::SPEED, value: Value::Word(600) }),
    ]
}

/// The replies that the D5 manual prints: an id, a register of two bytes, a write.
fn replies() -> [(&'static str, CanFrame); 3] {
    let received = |data: [u8; 8]| {
        CanFrame::new(can::default_request_id(Node::FACTORY), &data).expect("8 bytes")
    };
    [
        ("id", received([0x5D, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75])),
        ("read_word", received([0x5D, 0x0B, 0x05, 0x02, 0x15, 0x48, 0x48, 0xB7])),
        ("written_speed", received([0x5D, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D])),
    ]
}

fn can_frames(criterion: &mut Criterion) {
    let (id, address) = (can::default_request_id(Node::FACTORY), Address::Node(Node::FACTORY));
    let mut group = criterion.benchmark_group("d5 can");
    for (name, request) in requests() {
        group.bench_function(format!("encode request {name}"), |bench| {
            bench.iter(|| {
                can::request::<CanFrame>(black_box(id), black_box(address), black_box(&request))
            });
        });
        let frame: CanFrame = can::request(id, address, &request).expect("encodable");
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
            bench
                .iter(|| can::reply::<CanFrame>(black_box(id), black_box(node), black_box(&reply)));
        });
    }
    let request = Request::Write { register: Register::SPEED, value: Value::Word(600) };
    let (from, reply) = can::decode_reply(&replies()[2].1).expect("a reply");
    group.bench_function("match reply written_speed", |bench| {
        bench.iter(|| answer(black_box(&request), Node::FACTORY, from, black_box(&reply)));
    });
    group.finish();
}

fn serial_frames(criterion: &mut Criterion) {
    let frame = request_frame(Address::Node(Node::FACTORY), &Request::QueryId).expect("encodable");
    let clean = frame.repeat(LINE_FRAMES);
    // Header bytes without a frame behind them, before each frame.
    let disturbed = [&[0xD5, 0x0B, 0x5D, 0x0B, 0x05][..], &frame].concat().repeat(LINE_FRAMES);
    let mut group = criterion.benchmark_group("d5 serial");
    for (name, line) in [("clean", clean), ("disturbed", disturbed)] {
        group.throughput(Throughput::Bytes(u64::try_from(line.len()).expect("fits")));
        group.bench_function(format!("deframer {name} line"), |bench| {
            bench.iter(|| Deframer::new().push_slice(black_box(&line)).count());
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
