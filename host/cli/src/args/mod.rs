//! The command line.

mod bench;
mod config;
mod delays;
mod finding;
mod flight;
mod frames;
mod motion;
mod motor;
mod plan;
mod recording;
mod typed;
mod update;
mod values;
mod watching;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use host_protocol::CanId;

pub use crate::server::ServeArgs;
pub use bench::BenchArgs;
pub use config::{ConfigAction, ConfigFile, ConfigRow};
pub use delays::{DelaysArgs, Told};
pub use finding::{AdoptArgs, Bitrates, FactoryMotor, ScanArgs, ScanCommand, ScanTarget};
pub use flight::{Around, ShowTripArgs, TripsAction};
pub use frames::{
    BusKind, CodecChoice, DecodeArgs, DirectionChoice, EncodeArgs, ProtocolChoice, choice,
    dialect_of,
};
pub use motion::{
    CycleArgs, CycleTarget, JogArgs, Mode, MoveArgs, NativeArgs, SetArgs, Target, TogetherArgs,
};
pub use motor::{
    BrakeAction, FunctionName, MotorArgs, MotorSetting, MotorTarget, OnOff, Reports, Zero,
};
pub use plan::{HostLine, PlanArgs};
pub use recording::{FileArgs, Part, PlayArgs, PlotArgs, RecordArgs};
pub use typed::{Typed, TypedClear, TypedStop};
pub use update::{ImageArgs, UpdateArgs};
use values::{clear_target, seconds, stop_target};
pub use watching::{RawAction, TopArgs, WatchArgs};

/// Where `mgw sim` listens unless told otherwise.
pub const DEFAULT_LISTEN: &str = "127.0.0.1:7401";

#[derive(Debug, Parser)]
#[command(
    name = "mgw",
    version,
    about = "Talks to a motor gateway, real or simulated",
    long_about = "Talks to a motor gateway, real or simulated.\n\n\
        Without a command it shows a gateway with five simulated motors, from configuration to the \
        stop after the host has gone quiet. It needs no hardware.",
    after_help = EXAMPLES
)]
pub struct Cli {
    /// The gateway: a serial device (921600 baud; to 3000000 as DEVICE@RATE), tcp:HOST:PORT or
    /// unix:PATH, or the name that it has on USB or an ST-LINK; without it a running `mgw serve`,
    /// else the only one there
    #[arg(long, short, global = true, env = "MGW_PORT", value_name = "PORT")]
    pub port: Option<String>,

    /// Print JSON: one object per command, one per line for streams; errors likewise on standard
    /// error
    #[arg(long, global = true)]
    pub json: bool,

    #[command(subcommand)]
    pub command: Option<Command>,
}

const EXAMPLES: &str = "\
Examples:
  mgw                                              the demonstration
  mgw sim                                          serve a simulated gateway on tcp:127.0.0.1:7401
  mgw --port tcp:127.0.0.1:7401 info               what it is and what it can do
  mgw --port tcp:127.0.0.1:7401 set 0 velocity 2 --for 3
  mgw --port /dev/ttyACM0 config apply four-motors.toml
  MGW_PORT=/dev/ttyACM0 mgw state --json
  candump -L can0 | mgw decode                     captured frames in words; needs no gateway

Quantities are in SI units: rad, rad/s, A, V, °C, fraction of full signal.
Positive is counter-clockwise.
An axis or a bus that has a name (mgw config axis 0 name=left) can be given by it instead of its number.
An error that ends in a code, as [E-bus-off], has a page: mgw explain E-bus-off.
Exit codes: 0 done; 1 refused or failed, a trip and a value out of its range too; 2 wrong usage, a
file that cannot be read too; 3 a stop was sent and is not confirmed.";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show a gateway with five simulated motors, and how it stops them when the host goes quiet
    Demo,

    /// Serve a simulated gateway with four motors over TCP, and print what its motors do
    #[command(
        after_help = "Lines on its standard input put faults into it, and take them out again:\n  \
            e-stop press      bus 0 cut        motor 0 mute       power off      reset\n  \
            e-stop release    bus 0 mend       motor 0 mute off   power on       help\n\n\
            Examples:\n  mgw sim\n  mgw sim --listen 127.0.0.1:0      on a free port, \
            which is printed\n  \
            mgw sim --motor 0:rmd:1:v4_4 --motor 0:thruster:11 --motor 2:rmd:1@500000"
    )]
    Sim(SimArgs),

    /// Own the cable to a gateway and offer it to any number of local programs
    ///
    /// One of them commands, all may watch; a stop of any of them goes first. When the one in
    /// command ends or hangs, its axes stop as they would on a cable of its own. Every `mgw`
    /// without --port finds the server by itself. When the board is unplugged, reset or updated,
    /// programs are told so, and the server connects again by itself.
    #[command(
        after_help = "Examples:\n  mgw serve                             the only gateway on \
            USB or an ST-LINK\n  mgw serve --port /dev/ttyACM0\n  \
            export MGW_TOKEN=$(openssl rand -hex 16)\n  \
            mgw serve --listen 0.0.0.0:7402       for other computers, whose programs have that \
            MGW_TOKEN"
    )]
    Serve(ServeArgs),

    /// Show what the gateway is: versions, board, buses, boot reason, who commands, e-stop, enable
    /// output
    Info,

    /// Show what the gateway remembers over a reset: its last trips and starts, and the crash
    /// report; or what led to a trip
    Trips {
        #[command(subcommand)]
        action: Option<TripsAction>,
    },

    /// List the axes with bus, protocol, node and state
    Axes,

    /// Configure buses, axes and the gateway: by a file as a whole, or key by key
    ///
    /// All changes of a call are made together or not at all, and refused while an axis that they
    /// change is not idle.
    #[command(
        arg_required_else_help = true,
        after_help = "Examples:\n  \
            mgw config apply host/cli/examples/four-motors.toml\n  \
            mgw config check four-motors.toml           all errors; sends nothing\n  \
            mgw config dump > now.toml\n  \
            mgw config diff four-motors.toml\n  \
            mgw config bus 0 bitrate=1000000 protocols=rmd,thruster\n  \
            mgw config axis 0 bus=0 protocol=rmd node=1 stop_action=hold \
            velocity_limit_rad_s=20\n  \
            mgw config unset axis 0 velocity_limit_rad_s\n  \
            mgw config timeout 0 200\n  \
            mgw config show 0\n  \
            mgw config save                             it runs again after a loss of power"
    )]
    Config {
        #[command(subcommand)]
        action: ConfigAction,
    },

    /// Arm axes and keep the link alive until Ctrl-C or --for, then disarm them
    #[command(
        after_help = "Authority ends with the process that holds it, so the axes stay armed only \
            as long as this command runs.\n\n\
            Examples:\n  mgw arm 0 1\n  mgw arm 2 --for 5"
    )]
    Arm {
        /// The axes
        #[arg(required = true, value_name = "AXIS")]
        axes: Vec<Typed>,
        /// Seconds to stay armed; without it until Ctrl-C
        #[arg(long = "for", value_parser = seconds, allow_negative_numbers = true)]
        seconds: Option<Duration>,
    },

    /// Arm an axis, hold a setpoint, then stop it and wait for the confirmed stop
    #[command(
        after_help = "Examples:\n  mgw set 0 velocity 2 --for 3          2 rad/s for 3 s\n  \
            mgw set 1 signal -0.05                -5 % until Ctrl-C\n  \
            mgw set 0 position 1.57 --speed-limit 0.5 --for 4\n  \
            mgw set 0 impedance 0.5 --stiffness 20 --damping 1 --torque-limit 5 --for 4"
    )]
    Set(SetArgs),

    /// Turn an axis slowly while a key is held down; letting go stops it
    ///
    /// Arrow right or + turns counter-clockwise, arrow left or - clockwise, from the keyboard's
    /// second repetition on: a tap moves nothing. Letting go, or any other key, stops the axis and
    /// disarms it; q ends. Meanwhile position, velocity, current and temperature are shown. Needs
    /// a terminal.
    #[command(after_help = "Examples:\n  mgw jog 0                            0.3 rad/s, a \
        thruster 5 % of its signal\n  mgw jog 0 --velocity 0.1\n  mgw jog 1 --signal 0.1")]
    Jog(JogArgs),

    /// Arm an axis, move it by a distance, then stop it and wait for the confirmed stop
    #[command(
        after_help = "Examples:\n  mgw move 0 1.57 --speed-limit 0.5      a quarter turn\n  \
            mgw move 0 -0.1 --speed-limit 0.5 --for 4 --tolerance 0.01"
    )]
    Move(MoveArgs),

    /// Arm several D5 motors of one bus, set them in motion by one frame, then stop them and wait
    /// for the confirmed stops
    ///
    /// The speed of each waits in it until all are told to start, so that they start in the same
    /// instant. The bus must be `exclusive`, as every D5 motor on it hears that frame, and
    /// nothing may wait in any other.
    #[command(after_help = "Examples:\n  \
            mgw together 3 velocity 10.47 4 velocity -10.47 --for 2\n  \
            mgw together 3 velocity 2 4 velocity 2 5 velocity 2            until Ctrl-C")]
    Together(TogetherArgs),

    /// Arm axes, have the gateway send their setpoints in a period of its own, and stop them at the
    /// end
    ///
    /// Each setpoint leaves once in each period, of every protocol. Prints five times a second how
    /// the axes are, and at the end how many periods were late or longer than they should be, and
    /// why. `mgw plan` says what rate a configuration bears. Ctrl-C stops the motors.
    #[command(after_help = "Examples:\n  \
            mgw cycle 0 velocity 2 1 signal 0.05 --rate 500 --for 3\n  \
            mgw cycle 0 velocity 2 1 velocity -2 --rate 1000        until Ctrl-C")]
    Cycle(CycleArgs),

    /// Have the motor of an axis carry out a command of its own manual, and decode its reply
    ///
    /// What only asks needs no authority, what changes the motor needs an idle axis, and what stops
    /// it is carried out as a stop. What moves it needs --for: the axis is armed, the command
    /// is sent and kept up for so long, then the axis is stopped and disarmed. Commands that
    /// move by a distance go out once and for the TTL of the axis at most: raise its `ttl_us`
    /// for longer ones. What waits in a D5 motor for `execute` does not outlast a call of mgw, so
    /// `execute` and `async_write` are refused.
    #[command(after_help = "Examples:\n  \
            mgw native 0 9C00000000000000                                  RMD: read status 2\n  \
            mgw native 0 --command read_status_2                           the same by name\n  \
            mgw native 0 --command torque_current --field current_a=1 --for 2\n  \
            mgw native 1 51 56 00 00                                       thruster: read the \
            speed\n\n\
            `mgw encode --protocol PROTOCOL --list` shows every command with its fields.")]
    Native(NativeArgs),

    /// Stop an axis, or all axes; needs no authority
    #[command(after_help = "Examples:\n  mgw stop 0\n  mgw stop")]
    Stop {
        /// An axis, or `all`
        #[arg(default_value = "all", value_name = "AXIS|all", value_parser = stop_target)]
        target: TypedStop,
    },

    /// Stop everything and latch: nothing arms until `mgw clear gateway`; needs no authority
    Estop,

    /// Clear the trip of an axis, or the latched e-stop of the gateway; never arms
    #[command(
        after_help = "Examples:\n  mgw clear 0\n  mgw clear 0 --restart\n  mgw clear gateway"
    )]
    Clear {
        /// An axis, or `gateway`
        #[arg(value_name = "AXIS|gateway", value_parser = clear_target)]
        target: TypedClear,
        /// Unsafe: leave a trip whose stop the motor does not confirm; it may still be turning
        #[arg(long)]
        unreachable: bool,
        /// Restart the motor (RMD) and clear once it is back: some faults last until then; what it
        /// holds may drop
        #[arg(long, conflicts_with = "unreachable")]
        restart: bool,
    },

    /// Switch the output of a holding motor off: it lets go, and a load that it holds drops
    #[command(
        after_help = "An axis that stops by `hold` is `holding` after its stop: its motor is \
            energised and holds for ever.\n\n\
            Example:\n  mgw output-off 0"
    )]
    OutputOff {
        /// The axis
        axis: Typed,
    },

    /// Show the state of one axis, or of all configured axes
    State {
        /// The axis; all configured ones without it
        axis: Option<Typed>,
    },

    /// Follow samples and events; takes no authority
    ///
    /// It commands nothing: Ctrl-C ends it and stops no motor, `mgw stop` does. The gateway sends
    /// the samples by itself; those that its link cannot carry are counted as lost. A value marked
    /// with * is older than 1 s; --json has the age of each.
    #[command(
        after_help = "Examples:\n  mgw watch\n  mgw watch 0 2 --period 100 --count 50 --json\n  \
            mgw watch 0 --fields position,velocity --period 10"
    )]
    Watch(WatchArgs),

    /// Show axes, buses, trips and events on a terminal as they are; one key stops everything
    ///
    /// It takes no authority and commands nothing until a key asks for it. Space (or s) stops every
    /// axis at any time, whatever else waits, and shows what each stop came to. The arrows choose
    /// an axis, c clears its trip after a y, q or Ctrl-C ends it and stops no motor. When the
    /// gateway is unplugged or its server restarts it says so and connects again; a stop that was
    /// asked for meanwhile goes out first. A value marked with * is older than 1 s; the load of a
    /// bus counts each frame as the longest. Needs a terminal: `mgw watch` and `mgw state` do
    /// without.
    #[command(after_help = "Examples:\n  mgw top\n  mgw top --period 50\n  NO_COLOR=1 mgw top")]
    Top(TopArgs),

    /// Record samples, events and cycles into an MCAP file, which Foxglove and PlotJuggler read;
    /// takes no authority
    ///
    /// It commands nothing: Ctrl-C ends it and stops no motor. What other programs ask is recorded
    /// by `mgw serve --record`. What is lost is counted, told at the end and stored in the file. A
    /// recording that is cut off lacks its last second at most.
    #[command(after_help = "Examples:\n  mgw record run.mcap\n  \
            mgw record run.mcap 0 1 --period 1 --fields position,velocity,current --for 60\n  \
            mgw record bus.mcap --frames 0        what arrives on bus 0, whose axes are idle")]
    Record(RecordArgs),

    /// Print a recording, or export it as CSV or candump; needs no gateway
    #[command(after_help = "Examples:\n  mgw play run.mcap\n  \
            mgw play run.mcap --topic /event --topic /request\n  \
            mgw play run.mcap --axis 0 --from 12.5 --to 13 --json\n  \
            mgw play run.mcap run.2.mcap --topic /axis --csv > run.csv\n  \
            mgw play bus.mcap --candump | mgw decode")]
    Play(PlayArgs),

    /// Play again what led to a trip, on the core of this program; needs no gateway
    ///
    /// FILE is what a flight recorder has kept: a snapshot of the gateway and every event since.
    /// The core of the same build does it all again, and must end with the same trip at the same
    /// microsecond; with --image also the firmware of that build on an emulated board, within
    /// 200 us. Else the exit code is 1.
    #[command(after_help = "Examples:\n  mgw sim --flight-recorder trip.mgfr\n  \
            mgw replay trip.mgfr                  20 ms before the trip and 20 ms of its stop\n  \
            mgw replay trip.mgfr --around 2 --json\n  \
            mgw trips show --save trip.mgfr && mgw replay trip.mgfr --image ~/motor-gateway")]
    Replay {
        /// The file
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Also on the image, which is built of these sources and run on the virtual board: those
        /// of the commit that the recorded board runs; here where none are named
        #[arg(long, value_name = "SOURCES", num_args = 0..=1, default_missing_value = ".")]
        image: Option<PathBuf>,
        #[command(flatten)]
        around: Around,
    },

    /// Draw curves of a recording as SVG or PNG; needs no gateway
    ///
    /// A chart for each field, a curve for each axis, over the time of the gateway; a red line
    /// where an axis tripped.
    #[command(after_help = "Examples:\n  mgw plot run.mcap\n  \
            mgw plot run.mcap --fields velocity --axis 0 --from 12.5 --to 13 --output trip.svg\n  \
            mgw plot run.mcap --output run.png             960 pixels wide, with text")]
    Plot(PlotArgs),

    /// Show configuration, state and counters of one bus, or of all
    Bus {
        /// The bus; all of the board without it
        bus: Option<Typed>,
    },

    /// Find the motors on the buses; nothing moves, and nothing is written
    ///
    /// Asks RMD motors 1 to 32 or D5 motors 1 to 253 of each configured bus by reads that are safe
    /// whatever the motor's version, and says what they are: model, firmware, dialect with its
    /// evidence, supply, faults, and whether two seem to have one id. Thrusters are heard; they are
    /// asked with --thrusters. Refused while an axis on the bus is not idle.
    #[command(after_help = "Examples:\n  mgw scan\n  mgw scan 0 --thrusters\n  \
            mgw scan 0@1000000 1@210526 2@all       buses that are not configured\n\n\
            On CAN a gateway at a wrong bitrate disturbs what others send there: name only \
            bitrates that the motors may have, on a bus that nothing else uses.")]
    Scan(ScanCommand),

    /// Scan, and write a configuration with an axis for each motor that has none
    ///
    /// What is configured already stays as it is. Two motors with one id are left out. Choose what
    /// a stop does where the file leaves it open, then `mgw config apply FILE`.
    #[command(after_help = "Examples:\n  \
            mgw adopt 0@1000000 1@210526 2@115200 --output robot.toml\n  \
            mgw adopt --stop-action hold --output robot.toml --force")]
    Adopt(AdoptArgs),

    /// Show or change the settings of one motor: id, bitrate, gains, ramps, limits, timeout, …
    ///
    /// Without a value it only reads. Each change is read back where the motor tells it, and what
    /// it says before and after is shown. What stays in the motor, restarts it or may leave it out
    /// of reach asks on a terminal; --yes agrees beforehand. Every axis on the bus must be idle;
    /// nothing moves. A motor need not be an axis: it is lent one meanwhile, where one is free.
    #[command(after_help = "Examples:\n  \
            mgw motor 0 pid                             gains of the motor of axis 0\n  \
            mgw motor 0 acceleration velocity_acceleration_dps2=3000\n  \
            mgw motor 0:1@1000000 id 2                  a motor that is no axis yet\n  \
            mgw motor 1:d5:0x0B id 12 --yes\n  \
            mgw motor 0:thruster:11 timeout 500\n  \
            mgw motor 0 dump --output left-knee.toml\n  \
            mgw motor 0 diff left-knee.toml\n  \
            mgw motor 0 restore left-knee.toml")]
    Motor(MotorArgs),

    /// Give the gateway another firmware over its host link, and keep it if it comes up well
    ///
    /// The firmware that runs goes on meanwhile; then the gateway starts the new one on trial, in
    /// which nothing is armed, and this command confirms it. Without that, or when the power fails
    /// at any time, the one before runs again. Every axis must be at rest.
    #[command(after_help = "Examples:\n  \
            mgw update motor-gateway-nucleo-h743zi.elf\n  \
            mgw update firmware.bin --signature firmware.sig\n  \
            mgw update older.elf --allow-older\n  \
            mgw update --confirm                  after an update that was ended halfway")]
    Update(UpdateArgs),

    /// Say what an image of the firmware is, and write out what a board takes of it; needs no
    /// gateway
    #[command(after_help = "Examples:\n  mgw image motor-gateway.elf\n  \
            mgw image motor-gateway.elf --output firmware.bin --key public.der")]
    Image(ImageArgs),

    /// Look at link, gateway, buses, motors, timeouts, firmware and clocks, and say what to do
    ///
    /// Reads only. Buses whose axes are all idle are scanned. Exit code 1 if something is wrong.
    Doctor,

    /// Send and receive raw frames on a bus whose axes are all idle
    ///
    /// What may do more than read a motor is refused. An e-stop, a stop or a change of the
    /// configuration there ends it.
    #[command(after_help = "Examples:\n  mgw raw 0 send 141#9A00000000000000\n  \
            mgw raw 2 send-hex 3E01089A00000000000000721A\n  mgw raw 0 listen | mgw decode\n  \
            mgw raw --unsafe 1 send 141#A200000010270000")]
    Raw {
        /// The bus
        bus: Typed,
        /// Send any frame, also one that moves a motor, which nothing stops; only on a bus without
        /// axes
        #[arg(long = "unsafe")]
        unsafe_access: bool,
        #[command(subcommand)]
        action: RawAction,
    },

    /// Decode captured frames from files or standard input; needs no gateway
    ///
    /// Reads lines as candump writes them, `(1700000000.0) can0 141#9A00000000000000` or only
    /// `141#9A…`, also those of `candump -x`, and bytes of a serial line in hexadecimal, several
    /// frames and garbage in a line or one frame over several lines. Prints one line for each
    /// frame; what cannot be decoded has an `error` with a stable name, and makes the exit code 1.
    #[command(after_help = "Examples:\n  \
            mgw decode candump-2026-01-01_120000.log\n  \
            echo 241#9A320001E5010400 | mgw decode\n  \
            candump -L can0 | mgw decode --json\n  \
            echo 3E01089C1934129CFF78567AD8 | mgw decode --protocol rmd --direction reply")]
    Decode(DecodeArgs),

    /// Build a frame from the names of a command and its fields; needs no gateway
    #[command(after_help = "Examples:\n  \
            mgw encode --protocol rmd --list\n  \
            mgw encode --protocol rmd --node 1 torque_current --current_a -1.5\n  \
            mgw encode --protocol rmd --node 1 --bus rs485 read_status_2\n  \
            mgw encode --protocol thruster --node 11 speed --speed_rpm -1500\n  \
            mgw encode --protocol d5 --node 11 write --register speed --value 600")]
    Encode(EncodeArgs),

    /// Work out from a configuration alone how often its axes can take setpoints together
    ///
    /// The cycle rate of each bus and of the whole, how long a cycle takes, and within what time
    /// each axis's stop has left: computed by the gateway's own code, with each frame as long as
    /// its unknown bits can make it. Needs no gateway. What it assumes it prints.
    #[command(after_help = "Examples:\n  \
            mgw plan host/cli/examples/four-motors.toml\n  \
            mgw plan arm.toml --rate 500                  exit code 1 if that does not hold\n  \
            mgw plan arm.toml --host usb --reply-delay 120 --reply-delay 3=400\n  \
            mgw plan arm.toml --foreign 0=200 --json")]
    Plan(PlanArgs),

    /// Measure how fast a gateway answers and takes setpoints, beside what is planned for it
    ///
    /// Round trips of Ping and ReadState, then Cycle of 1, 2, 4, … axes, armed together and given
    /// velocity 0 unless told otherwise. It asks before it arms. Ctrl-C stops the motors.
    #[command(after_help = "Examples:\n  mgw bench --yes\n  \
            mgw bench 0 1 2 3 --rounds 5000 --svg rates.svg\n  \
            mgw bench --yes --delays delays.toml && mgw plan arm.toml --delays delays.toml")]
    Bench(BenchArgs),

    /// Make a table of how long motors take to begin their replies, out of recordings and tables;
    /// needs no gateway
    ///
    /// One line for each model, firmware, protocol, bus and command: how many delays, the least,
    /// 50 %, 99 %, the greatest, and how many in each bucket, so that merging two tables gives what
    /// measuring both at once would. docs/reply-delays.md has the format. `mgw plan --delays` takes
    /// it.
    #[command(after_help = "Examples:\n  \
            mgw record bus.mcap --frames 0                 while something else asks the motors\n  \
            mgw delays bus.mcap --bitrate 0=1000000 --where lab-a --output mine.txt\n  \
            mgw delays docs/reply-delays.txt mine.txt --output docs/reply-delays.txt --force\n  \
            mgw plan arm.toml --delays docs/reply-delays.txt")]
    Delays(DelaysArgs),

    /// Print the page that helps with an error, by the code at its end; needs no gateway
    #[command(
        after_help = "Examples:\n  mgw explain E-bus-off\n  mgw explain                  all codes"
    )]
    Explain {
        /// The code, as `E-bus-off`; lists all without it
        code: Option<String>,
    },

    /// Print a script that completes command lines of mgw in a shell
    #[command(after_help = "Examples:\n  \
            mgw completion bash > ~/.local/share/bash-completion/completions/mgw\n  \
            mgw completion zsh > ~/.zfunc/_mgw      (with fpath+=~/.zfunc in .zshrc)\n  \
            mgw completion fish > ~/.config/fish/completions/mgw.fish")]
    Completion {
        /// The shell
        shell: Shell,
    },

    /// Print the manual page of mgw or of one of its commands
    #[command(after_help = "Examples:\n  mgw man | man -l -\n  mgw man set | man -l -\n  \
            mgw man --dir ~/.local/share/man/man1      writes a page for each command")]
    Man {
        /// A command; mgw itself without it
        command: Option<String>,
        /// Write all pages into this directory instead
        #[arg(long, conflicts_with = "command")]
        dir: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
pub struct SimArgs {
    /// Address to listen on; port 0 takes a free one
    #[arg(long, default_value = DEFAULT_LISTEN, value_name = "HOST:PORT")]
    pub listen: SocketAddr,
    /// Leave buses and axes unconfigured, as a board is after power-on
    #[arg(long)]
    pub unconfigured: bool,
    /// CAN id of the D5 motor, 0x123 or, of 29 bits, extended:0x12345678; its node unless
    /// given
    #[arg(long, value_name = "CAN_ID")]
    pub d5_id: Option<CanId>,
    /// A motor instead of the four, unconfigured, as it comes from its box; may be given often.
    /// RATE where it is not the usual one; DIALECT of an RMD, v3_6 to v4_4
    #[arg(
        long = "motor", value_name = "BUS:PROTOCOL:NODE[:DIALECT][@RATE]",
        value_parser = values::factory_motor, conflicts_with = "d5_id"
    )]
    pub motors: Vec<FactoryMotor>,
    /// Keep what `config save` stores in this file; what it holds runs at the start
    #[arg(long, value_name = "FILE")]
    pub storage: Option<PathBuf>,
    /// Keep in this file what led to the latest trip, for `mgw replay`
    #[arg(long, value_name = "FILE")]
    pub flight_recorder: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_negative_value_is_a_value_and_not_an_option() {
        let cli = Cli::parse_from(["mgw", "set", "1", "signal", "-0.05"]);
        let Some(Command::Set(set)) = cli.command else { panic!("{cli:?}") };
        assert_eq!((set.axis, set.mode, set.value), (Typed::Number(1), Mode::Signal, -0.05));
    }

    #[test]
    fn nan_is_passed_on_for_the_gateway_to_refuse() {
        let cli = Cli::parse_from(["mgw", "set", "1", "velocity", "nan"]);
        let Some(Command::Set(set)) = cli.command else { panic!("{cli:?}") };
        assert!(set.value.is_nan());
    }
}
