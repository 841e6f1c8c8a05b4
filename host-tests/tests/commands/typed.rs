//! Which typed requests of the host protocol make the gateway send a command.

use host_protocol::{
    AxisParameter, ClearTarget, Protocol, Setpoint, StopAction, StopTarget, Value, requests,
};
use mgw_client::ClientError;
use mgw_sim::{Injection, Wire};
use std::collections::BTreeSet;
use std::time::Duration;

use crate::codecs;
use crate::lab::{AXIS, Lab, SECOND};

/// How long a setpoint lives.
const TTL: Duration = Duration::from_millis(90);
/// Within the life of a setpoint.
const SOON: Duration = Duration::from_millis(30);
/// As long as any stop takes.
const STOPPED: Duration = Duration::from_secs(3);
/// Some polls of each kind.
const POLLED: Duration = Duration::from_secs(2);

const POLLS: &str = "polls";

/// Requests that send a motor nothing, or what another request sends too: `Disarm`, `EStop` and
/// `ReleaseAuthority` run the stop action, `Subscribe` reads as `ReadState` does, `ArmTogether`
/// arms as `Arm` does, `Recognise` asks what `Arm` asks, and `Cycle` and `RunCycle` move as
/// `Setpoint` does. What `Native` and raw frames send is not typed.
pub const NOT_TRIED: [&str; 44] = [
    "SaveConfiguration",
    "ForgetStored",
    "ReadStored",
    "ReadNames",
    "ReadImage",
    "BeginImage",
    "WriteImage",
    "FinishImage",
    "ConfirmImage",
    "SetBaud",
    "BeginChanges",
    "AddChanges",
    "ApplyChanges",
    "ReadGatewayParameter",
    "ReadAxisSettings",
    "ArmTogether",
    "Cycle",
    "RunCycle",
    "Hello",
    "Ping",
    "TakeAuthority",
    "ReleaseAuthority",
    "ConfigureGateway",
    "ConfigureBus",
    "BusStatus",
    "GatewayStatus",
    "ConfigureAxis",
    "ReadAxisParameter",
    "ListAxes",
    "RemoveAxis",
    "Disarm",
    "EStop",
    "ClearUnreachable",
    "Native",
    "Subscribe",
    "RawOpen",
    "RawSend",
    "RawReceive",
    "RawClose",
    "ReadIncidents",
    "ReadCrashReport",
    "ReadFlightRecord",
    "Recognise",
    "RawOpenAt",
];

/// The commands that the gateway sends, each with the request that made it. `polls` is what it
/// sends to an armed motor unasked; a setpoint or a move does not count as the one who made those.
pub type Uses = BTreeSet<(String, &'static str)>;

/// Every typed request that reaches a motor, tried on a motor of a protocol.
pub fn uses(protocol: Protocol) -> Uses {
    let mut uses = Uses::new();
    let actions = [
        (StopAction::Coast, "Stop coast"),
        (StopAction::Hold, "Stop hold"),
        (StopAction::Brake, "Stop brake"),
    ];
    let action = *actions
        .iter()
        .map(|(action, _)| action)
        .find(|action| possible(protocol, **action))
        .unwrap();
    let mut lab = Lab::new(protocol, false, action);
    lab.arm();
    lab.frames();
    lab.pass(POLLED);
    note(&mut uses, protocol, POLLS, &lab.frames());
    for (action, name) in actions {
        if possible(protocol, action) {
            Session { protocol, lab: quiet_lab(protocol, action), uses: &mut uses }.run(name);
        }
    }
    uses
}

/// The stop actions that a protocol has (PROTOCOL.md, what each protocol can do).
fn possible(protocol: Protocol, action: StopAction) -> bool {
    match protocol {
        Protocol::Rmd => true,
        Protocol::Thruster => action == StopAction::Coast,
        Protocol::D5 => action == StopAction::Hold,
    }
}

fn quiet_lab(protocol: Protocol, action: StopAction) -> Lab {
    let mut lab = Lab::quiet(protocol, false, action);
    if action == StopAction::Brake {
        lab.inject(Injection::Brake(true));
        lab.configure(AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    }
    lab
}

fn note(uses: &mut Uses, protocol: Protocol, user: &'static str, frames: &[Wire]) {
    for frame in frames {
        let meaning =
            codecs::request(protocol, frame).unwrap_or_else(|| panic!("{frame} is no request"));
        uses.extend(meaning.names().iter().map(|name| (name.clone(), user)));
    }
}

struct Session<'a> {
    protocol: Protocol,
    lab: Lab,
    uses: &'a mut Uses,
}

impl Session<'_> {
    /// Asks for something, waits, and notes what was sent meanwhile. What the protocol cannot do is
    /// passed over.
    fn ask<R>(
        &mut self,
        user: &'static str,
        wait: Duration,
        act: impl FnOnce(&mut Lab) -> Result<R, ClientError>,
    ) -> Option<R> {
        self.lab.frames();
        let result = match act(&mut self.lab) {
            Ok(result) => Some(result),
            Err(ClientError::Gateway(error)) if error.name() == "Unsupported" => None,
            Err(error) => panic!("{user} on {}: {error}", self.protocol),
        };
        self.lab.pass(wait);
        let frames = self.lab.frames();
        note(self.uses, self.protocol, user, &frames);
        result
    }

    /// Sets the armed axis in motion, and notes what was sent besides the polls.
    fn move_by<R>(
        &mut self,
        user: &'static str,
        act: impl FnOnce(&mut Lab, u32) -> Result<R, ClientError>,
    ) {
        let epoch = self.armed();
        self.ask(user, SOON, |lab| act(lab, epoch));
        let polls: Vec<String> =
            self.uses.iter().filter(|(_, by)| *by == POLLS).map(|(name, _)| name.clone()).collect();
        self.uses.retain(|(name, by)| *by != user || !polls.contains(name));
    }

    fn run(&mut self, stop: &'static str) {
        let timeout_ms = if self.protocol == Protocol::D5 { 1 } else { 1_000 };
        self.ask("ReadState", SOON, |lab| lab.client.read_state(AXIS));
        self.ask("ProvisionMotorTimeout", SOON, |lab| {
            lab.client.provision_motor_timeout(AXIS, timeout_ms)
        });
        let setpoints = [
            ("Setpoint Signal", Setpoint::Signal { fraction: 0.1 }),
            ("Setpoint Current", Setpoint::Current { current_a: 0.1 }),
            ("Setpoint Velocity", Setpoint::Velocity { velocity_rad_s: 5.0 }),
            ("Setpoint Position", Setpoint::Position { position_rad: 0.1, speed_limit_rad_s: 5.0 }),
            (
                "Setpoint Impedance",
                Setpoint::Impedance {
                    position_rad: 0.0,
                    velocity_rad_s: 0.0,
                    stiffness_nm_per_rad: 1.0,
                    damping_nm_s_per_rad: 1.0,
                    torque_nm: 0.0,
                },
            ),
        ];
        for (user, setpoint) in setpoints {
            self.move_by(user, |lab, epoch| lab.client.set(AXIS, epoch, setpoint, TTL));
            self.stopped(stop);
        }
        self.move_by("MoveRelative", |lab, epoch| {
            lab.client.move_relative(AXIS, epoch, 0.1, 5.0, TTL)
        });
        self.stopped(stop);
        self.ask("OutputOff", SOON, |lab| match lab.client.output_off(AXIS) {
            Err(ClientError::Gateway(error)) if error.name() == "NotHolding" => Ok(()),
            result => result,
        });
        self.armed();
        self.ask(stop, STOPPED, |lab| lab.client.estop());
        self.lab.client.clear(ClearTarget::Gateway).unwrap();
        self.ask("Clear", SOON, |lab| lab.client.clear(ClearTarget::Axis(AXIS)));
        // Other motors have no restart.
        if self.protocol == Protocol::Rmd {
            self.armed();
            self.ask(stop, STOPPED, |lab| lab.client.estop());
            self.lab.client.clear(ClearTarget::Gateway).unwrap();
            self.ask("ClearByRestart", SOON, |lab| lab.client.clear_by_restart(AXIS));
        }
        if self.protocol == Protocol::D5 {
            self.start_together();
        }
    }

    /// Two D5 motors begin to turn by one frame.
    fn start_together(&mut self) {
        self.lab.configure_second();
        let members = [AXIS, SECOND].map(|axis| {
            let epoch = self.lab.arm_axis(axis);
            requests::Member { axis, epoch, velocity_rad_s: 1.0 }
        });
        let members = host_protocol::Vec::from_slice(&members).unwrap();
        self.ask("StartTogether", SOON, |lab| lab.client.start_together(&members, TTL));
    }

    fn armed(&mut self) -> u32 {
        self.ask("Arm", SOON, |lab| Ok(lab.arm())).unwrap()
    }

    fn stopped(&mut self, stop: &'static str) {
        self.ask(stop, STOPPED, |lab| lab.client.stop(StopTarget::Axis(AXIS)));
    }
}
