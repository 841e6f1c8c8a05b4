//! A control loop at 1 kHz, one `Cycle` a round on a fixed grid of time, that shows its own jitter:
//! how late each round began, how long the gateway took to answer it, and how many rounds took
//! longer than a period, so that the next one was left out.
//!
//! ```text
//! mgw sim                                                              # in another terminal
//! cargo run -p mgw-client --example jitter -- tcp:127.0.0.1:7401 0     # axes that take velocities
//! ```
//!
//! What it shows is mostly this computer's: the operating system wakes it late, and a USB adapter
//! keeps bytes back. The motors do not depend on it: each setpoint is valid for 100 ms.
#![forbid(unsafe_code)]

use std::error::Error;
use std::time::Duration;

use mgw_client::host_protocol::{StateField, StateFields, StopTarget};
use mgw_client::{AxisSetpoint, Client, Transport, make_velocity, open};

const PERIOD: Duration = Duration::from_millis(1);
/// The setpoints are valid for so long.
const TTL: Duration = Duration::from_millis(100);
/// rad/s.
const VELOCITY: f32 = 1.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let port = arguments.next().ok_or("usage: jitter PORT AXIS…")?;
    let axes = arguments.map(|axis| axis.parse()).collect::<Result<Vec<u8>, _>>()?;
    let mut gateway = Client::connect(open(&port)?)?;
    println!("{}", run(&mut gateway, &axes, Duration::from_secs(5))?);
    Ok(())
}

/// Turns the axes for so long, stops them, and says how even the rounds were.
pub fn run(
    gateway: &mut Client<impl Transport>,
    axes: &[u8],
    lasts: Duration,
) -> Result<String, Box<dyn Error>> {
    let fields = StateFields::of(&[StateField::Velocity]);
    let setpoints: Vec<AxisSetpoint> =
        axes.iter().map(|axis| make_velocity(*axis, VELOCITY)).collect();
    let epoch = gateway.arm_together(axes)?;

    let (mut late, mut answered, mut left_out) = (Vec::new(), Vec::new(), 0);
    let begin = gateway.now();
    let mut due = begin;
    while due < begin + lasts {
        let wait = due.saturating_sub(gateway.now());
        gateway.transport_mut().sleep(wait);
        let round = gateway.now();
        late.push(round - due);
        gateway.cycle(epoch, &setpoints, fields, TTL)?;
        answered.push(gateway.now() - round);
        due += PERIOD;
        // What the grid has passed meanwhile is left out, not caught up.
        while due < gateway.now() {
            due += PERIOD;
            left_out += 1;
        }
    }
    gateway.stop(StopTarget::All)?;
    Ok(format!(
        "{} rounds of {PERIOD:?}, {left_out} left out\nbegan late:     {}\nanswered after: {}",
        late.len(),
        spread(&mut late),
        spread(&mut answered)
    ))
}

fn spread(times: &mut [Duration]) -> String {
    times.sort();
    let at = |permille: usize| times[(times.len() - 1) * permille / 1_000];
    format!("p50 {:?}, p99 {:?}, p99.9 {:?}, max {:?}", at(500), at(990), at(999), at(1_000))
}
