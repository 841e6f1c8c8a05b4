//! The commands that talk to a gateway, one file for each kind.

mod adopt;
mod arm;
mod axes;
mod bus;
pub mod config;
mod cycle;
mod doctor;
mod drive;
mod info;
mod jog;
mod limits;
mod motor;
mod moving;
mod native;
mod raw;
mod record;
mod scan;
mod set;
mod stop;
pub mod stop_report;
mod together;
mod trips;
mod update;
mod watch;

pub use drive::{ArmedAxis, refuse_twice, state_line, tell_armed};
pub use info::e_stop as e_stop_text;
pub use limits::check_setpoint;
pub use motor::set_id as set_motor_id;
pub use native::motor as motor_of;
pub use raw::recorded_frame;
pub use scan::motor_name;
#[cfg(test)]
pub use scan::notes;
pub use stop::{clear_axis, send_first as send_stop_first};
pub use stop_report::outcome_line;
pub use trips::line as incident_line;

use host_protocol::Error;
use mgw_client::{Interrupt, Transport};

use crate::args::{Command, TripsAction};
use crate::bench;
use crate::failure::Failure;
use crate::output::Output;
use crate::session::Session;
use crate::terminal::Progress;

/// Whether it stops, before all else.
pub fn is_stop(command: &Command) -> bool {
    stop::is_stop(command)
}

/// Runs a command over `transport`, and gives authority back if it may have taken it. A stop is
/// sent before all else. `interrupt` is what ends the command early.
pub fn run(
    transport: Box<dyn Transport>,
    interrupt: Interrupt,
    out: Output,
    command: &Command,
) -> Result<(), Failure> {
    let waiting = out.waiting_for("waiting for the gateway");
    let connect = |transport| Session::on(transport, interrupt, out);
    let mut transport = transport;
    let stop = stop::asked_for(&mut transport, command, out)?;
    let mut session = match stop {
        Some(request) => stop::send_first(transport, request, connect)?,
        None => connect(transport)?,
    };
    drop(waiting);
    let session = &mut session;
    let _waiting = match command {
        // These wait for what the user wants.
        Command::Arm { .. }
        | Command::Jog(_)
        | Command::Watch(_)
        | Command::Record(_)
        | Command::Motor(_)
        | Command::Raw { .. } => Progress::none(),
        Command::Update(_) => out.waiting_for("waiting for the gateway"),
        Command::Trips { action: Some(_) } => out.waiting_for("waiting for the flight recorder"),
        _ => out.waiting_for("waiting for the motors"),
    };
    let result = match stop {
        Some(request) => stop::report(session, request),
        None => dispatch(session, command),
    };
    let in_command = matches!(
        command,
        Command::Config { .. }
            | Command::Arm { .. }
            | Command::Set(_)
            | Command::Jog(_)
            | Command::Move(_)
            | Command::Together(_)
            | Command::Cycle(_)
            | Command::Native(_)
            | Command::Clear { .. }
            | Command::OutputOff { .. }
            | Command::Scan(_)
            | Command::Adopt(_)
            | Command::Motor(_)
            | Command::Update(_)
            | Command::Doctor
            | Command::Raw { .. }
    ) || matches!(command, Command::Record(arguments) if arguments.frames.is_some());
    let reachable = result.as_ref().map_or_else(Failure::is_from_gateway, |()| true);
    if in_command && reachable {
        // Refused when another host is in command, and that is well.
        let _ = session.client.release_authority();
    }
    result.map_err(|failure| name_commander(session, failure))
}

/// Behind a server everybody has the same host link: the server knows which program it is.
fn name_commander(session: &mut Session, failure: Failure) -> Failure {
    let Some(error @ Error::NotInCommand { holder }) = failure.gateway_error().copied() else {
        return failure;
    };
    let Ok(Some(program)) = session.client.commander() else { return failure };
    let text = failure.to_string().replacen(&format!("host link {holder}"), &program, 1);
    Failure::Explained { error, text }
}

fn dispatch(session: &mut Session, command: &Command) -> Result<(), Failure> {
    match command {
        // These have no gateway to talk to; they never come here.
        Command::Demo
        | Command::Sim(_)
        | Command::Serve(_)
        | Command::Decode(_)
        | Command::Encode(_)
        | Command::Plan(_)
        | Command::Delays(_)
        | Command::Image(_)
        | Command::Explain { .. }
        | Command::Play(_)
        | Command::Plot(_)
        | Command::Replay { .. }
        | Command::Top(_)
        | Command::Completion { .. }
        | Command::Man { .. } => Ok(()),
        // These have been sent before all else.
        Command::Stop { .. } | Command::Estop => Ok(()),
        Command::Info => info::run(session),
        Command::Update(arguments) => update::run(session, arguments),
        Command::Trips { action: None } => trips::run(session),
        Command::Trips { action: Some(TripsAction::Show(arguments)) } => {
            trips::show(session, arguments)
        }
        Command::Axes => axes::run(session),
        Command::Config { action } => config::run(session, action),
        Command::Arm { axes, seconds } => {
            let axes = session.axes(axes)?;
            arm::run(session, &axes, *seconds)
        }
        Command::Set(arguments) => set::run(session, arguments),
        Command::Jog(arguments) => jog::run(session, arguments),
        Command::Move(arguments) => moving::run(session, arguments),
        Command::Together(arguments) => together::run(session, arguments),
        Command::Cycle(arguments) => cycle::run(session, arguments),
        Command::Native(arguments) => native::run(session, arguments),
        Command::Clear { target, unreachable, restart } => {
            stop::clear(session, target, *unreachable, *restart)
        }
        Command::OutputOff { axis } => {
            let axis = session.axis(axis)?;
            stop::output_off(session, axis)
        }
        Command::State { axis } => {
            let axes = session.axes_or_all(axis.as_slice())?;
            session.print_states(&axes)
        }
        Command::Watch(arguments) => watch::run(session, arguments),
        Command::Record(arguments) => record::run(session, arguments),
        Command::Scan(arguments) => scan::run(session, arguments),
        Command::Doctor => doctor::run(session),
        Command::Adopt(arguments) => adopt::run(session, arguments),
        Command::Motor(arguments) => motor::run(session, arguments),
        Command::Bus { bus } => {
            let bus = bus.as_ref().map(|bus| session.bus(bus)).transpose()?;
            bus::run(session, bus)
        }
        Command::Bench(arguments) => bench::run(session, arguments),
        Command::Raw { bus, unsafe_access, action } => {
            let bus = session.bus(bus)?;
            raw::run(session, bus, *unsafe_access, action)
        }
    }
}
