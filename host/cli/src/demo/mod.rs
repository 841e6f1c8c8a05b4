//! The demonstration: configure, arm, move, and then the host falls silent.

mod moving;
mod setup;
mod silence;
mod trace;

use serde_json::json;

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::four_motors;
use crate::json;
use crate::output::Output;
use moving::Motion;
use trace::Trace;

/// Shows it all; fails if any axis does not stop as it must.
pub fn run(mut out: Output) -> Result<(), Failure> {
    let (world, configuration) = four_motors::demonstration()?;
    let mut trace = Trace::new(&configuration);

    out.text(
        "A motor gateway with five simulated motors, in simulated time. The gateway is the \
        very code of the firmware.",
    )?;
    let mut client = four_motors::connect(&world)?;
    setup::introduce(&client, out)?;
    setup::configure(&mut client, &configuration, out)?;
    out.motors = Protocols::new(&client.list_axes()?);
    let axes: Vec<u8> = configuration.axes.keys().copied().collect();
    let armed = setup::arm(&mut client, &axes, out)?;

    trace.collect(&world);
    let motions = moving::motions(&armed);
    moving::run(&mut client, &motions, &world, &mut trace, out)?;

    let stops = silence::run(&mut client, &world, &mut trace, &axes, out)?;
    finish(&motions, &stops, out)
}

fn finish(motions: &[Motion], stops: &[silence::Stop], out: Output) -> Result<(), Failure> {
    let failed: Vec<String> =
        stops.iter().filter(|stop| !stop.is_proven()).map(|stop| stop.axis.to_string()).collect();
    let counts = json!({ "axes": motions.len(), "stopped": stops.len() - failed.len() });
    out.object(&json::line("demonstration_ended", counts))?;
    if !failed.is_empty() {
        return Err(Failure::named(
            "Demonstration",
            None,
            format!(
                "no confirmed stop of axis {}: this must not happen; the frames above show how far it \
                came",
                failed.join(", ")
            ),
        ));
    }
    out.text("")?;
    out.text(format!("All {} axes tripped and stopped without the host.", stops.len()))?;
    out.text("")?;
    out.text("What to try next:")?;
    // Who has run it by cargo may have it nowhere else.
    let mgw = if std::env::var_os("CARGO").is_some() { "cargo run --" } else { "mgw" };
    for (words, effect) in [
        ("sim", "serve this gateway on tcp:127.0.0.1:7401; then, in another window:"),
        ("--port tcp:127.0.0.1:7401 info", "what it is"),
        (
            "--port tcp:127.0.0.1:7401 set 0 velocity 2 --for 3",
            "move an axis; kill it and see what happens",
        ),
        ("--port tcp:127.0.0.1:7401 watch", "states and events"),
        ("--help", "every command"),
    ] {
        let command = format!("{mgw} {words}");
        out.text(format!("  {command:<66} {effect}"))?;
    }
    Ok(())
}
