//! Impedance on an RMD on CAN: the motor is a spring and a damper around a point that swings
//! slowly. With an `AsyncClient`, for programs that await.
//!
//! ```text
//! mgw sim                                                              # in another terminal
//! cargo run -p mgw-client --example impedance -- tcp:127.0.0.1:7401 0
//! ```
#![forbid(unsafe_code)]

use std::error::Error;
use std::f32::consts::TAU;
use std::time::Duration;

use mgw_client::host_protocol::{StateField, StateFields, StopTarget};
use mgw_client::{AsyncClient, make_impedance};

/// N·m/rad and N·m·s/rad: soft enough to be pushed away by hand.
const STIFFNESS: f32 = 5.0;
const DAMPING: f32 = 0.2;
/// How far the point swings to both sides, rad, and for how long each time.
const AMPLITUDE: f32 = 0.2;
const PERIOD_S: f32 = 2.0;
/// The setpoints are valid for so long.
const TTL: Duration = Duration::from_millis(100);

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(port), Some(axis)) = (arguments.next(), arguments.next()) else {
        return Err("usage: impedance PORT AXIS".into());
    };
    let axis = axis.parse()?;
    // Any executor will do.
    println!(
        "{}",
        pollster::block_on(async {
            let gateway = AsyncClient::open(&port).await?;
            run(&gateway, axis, Duration::from_secs(4)).await
        })?
    );
    Ok(())
}

/// Swings the axis for so long, stops it, and says how far it was from its point.
pub async fn run(
    gateway: &AsyncClient,
    axis: u8,
    lasts: Duration,
) -> Result<String, Box<dyn Error>> {
    let swung = swing(gateway, axis, lasts).await;
    // Also where it failed: a stop that nothing needs harms nothing.
    gateway.stop(StopTarget::Axis(axis)).await?;
    swung
}

async fn swing(gateway: &AsyncClient, axis: u8, lasts: Duration) -> Result<String, Box<dyn Error>> {
    let fields = StateFields::of(&[StateField::Position, StateField::Velocity]);
    let start = gateway.read_state(axis).await?.position_rad.map_or(0.0, |reading| reading.value);
    let epoch = gateway.arm(axis).await?.epoch;
    let (begin, mut rounds, mut furthest) = (gateway.now().await?, 0, 0.0_f32);
    loop {
        let elapsed = gateway.now().await? - begin;
        if elapsed >= lasts {
            break;
        }
        let phase = TAU * elapsed.as_secs_f32() / PERIOD_S;
        let (point, velocity) =
            (start + AMPLITUDE * phase.sin(), AMPLITUDE * TAU / PERIOD_S * phase.cos());
        let setpoint = make_impedance(axis, point, velocity, STIFFNESS, DAMPING, 0.0);
        let states = gateway.cycle(epoch, &[setpoint], fields, TTL).await?;
        if let Some(lost) = states.iter().find(|state| !state.result.is_answered()) {
            return Err(format!("axis {}: {}, {}", lost.axis, lost.result, lost.state).into());
        }
        let position = states.first().and_then(|state| state.position_rad).unwrap_or(point);
        furthest = furthest.max((position - point).abs());
        rounds += 1;
    }
    Ok(format!("{rounds} rounds, at most {furthest:.3} rad from the point"))
}
