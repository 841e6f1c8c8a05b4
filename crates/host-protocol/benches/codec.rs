//! Time of one message, and bytes per second of the deframer. Both compute the checksum bit by bit,
//! as the firmware does.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use host_protocol::{Deframer, MAX_FRAME, Request, Setpoint, requests};

/// A long read of a link: 1024 frames.
const LINE_FRAMES: usize = 1024;

fn setpoint() -> Request {
    Request::Setpoint(requests::Setpoint {
        axis: 0,
        epoch: 1,
        expires_at_us: 80_000,
        setpoint: Setpoint::Velocity { velocity_rad_s: 1.0 },
    })
}

/// A whole frame.
fn frame(request: &Request) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = request.encode_frame(1, &mut out).expect("fits");
    out[..length].to_vec()
}

fn messages(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("host link");
    let mut out = [0; MAX_FRAME];
    group.bench_function("encode frame setpoint", |bench| {
        bench.iter(|| black_box(&setpoint()).encode_frame(black_box(1), black_box(&mut out)));
    });
    let bytes = frame(&setpoint());
    let mut deframer = Deframer::new();
    group.bench_function("deframe and decode setpoint", |bench| {
        bench.iter(|| {
            let mut request = None;
            for byte in black_box(&bytes) {
                if let Some(Ok(frame)) = deframer.push(*byte) {
                    request = Request::decode(frame.number, frame.body).ok();
                }
            }
            request
        });
    });
    let line = bytes.repeat(LINE_FRAMES);
    group.throughput(Throughput::Bytes(u64::try_from(line.len()).expect("fits")));
    group.bench_function("deframer clean line", |bench| {
        bench.iter(|| {
            let mut deframer = Deframer::new();
            black_box(&line)
                .iter()
                .filter(|byte| matches!(deframer.push(**byte), Some(Ok(_))))
                .count()
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = messages
}
criterion_main!(benches);
