//! What the first host sets up.

use super::raw::unsafe_access;
use crate::action::{Action, Ask, Does, Number};
use crate::dice::Dice;
use crate::plant::{BUSES, MOTORS, POSITION_DEVICE, extended_id};
use host_protocol::AxisParameter;
use host_protocol::Protocol;

/// Speeds, rad/s, that are no whole number of the unit of some motor: limits, and what is asked
/// for.
pub(super) const LIMITS: [f32; 6] = [3.0, 0.009, 0.026_2, 1.234, 0.5, 2.0];

/// What VM may be set to: bytes 6 and 7 (Thruster manual §2.4).
pub(super) const RETURN_MODES: [u16; 8] = [0, 0x01, 0x02, 0x03, 0x07, 0x200, 0x203, 0x100];

/// What an RMD may speak, by the numbers of `rmd_dialect`; the first is the default.
pub(super) const DIALECTS: [u8; 6] = [1, 2, 3, 4, 5, 6];

/// The steps of a host that has the configuration stored, or what is stored forgotten: the storage
/// may fail, and the gateway start anew before it is done.
pub(super) fn saved(dice: &mut Dice, protocols: [u8; BUSES as usize], starts: bool) -> Vec<Action> {
    let ask = dice.pick(&[Ask::Save, Ask::Save, Ask::Save, Ask::Forget]);
    let then = dice.pick(&[
        Action::Stored { done: true },
        Action::Stored { done: true },
        Action::Stored { done: false },
        Action::PowerLoss,
        Action::Reset,
        Action::Ask { link: 0, ask: Ask::Ping },
    ]);
    let mut actions = vec![Action::Ask { link: 0, ask }, then];
    if let Some(Action::PowerLoss) = actions.last() {
        actions.extend(configuration(dice, protocols, starts));
    }
    actions
}

/// The steps of a host that finds nothing configured, and what the motors are then.
pub(super) fn configuration(
    dice: &mut Dice,
    protocols: [u8; BUSES as usize],
    starts: bool,
) -> Vec<Action> {
    let mut asks = vec![Ask::Hello, Ask::Silence { us: dice.pick(&[100_000, 250_000]) }];
    asks.extend((0..BUSES).zip(protocols).map(|(bus, protocols)| Ask::Bus {
        bus,
        window_us: dice.pick(&[2_000, 3_000, 5_000]),
        protocols,
        exclusive: starts,
    }));
    // Mostly all D5 motors or none: those with ids of another length are not started together.
    let extended = dice.pick(&[0, 0, 0, 0, 100, 40]);
    let behind_buses = asks.len();
    let object = dice.percent(20);
    let returns = if dice.percent(35) { dice.pick(&RETURN_MODES) } else { 0 };
    let grouped = dice.percent(30);
    let provisioned = dice.percent(40);
    // Where it is not provisioned either, the axis is not armed, unless its motor tells of its
    // timeout by itself.
    let known_only = dice.percent(if provisioned { 50 } else { 5 });
    // Mostly what nobody has stated; now and then what an axis says is wrong.
    let spoken = if dice.percent(30) { dice.pick(&DIALECTS) } else { DIALECTS[0] };
    for (axis, motor) in (0u8..).zip(&MOTORS) {
        let mut set = |parameter: AxisParameter, value: Number| {
            asks.push(Ask::Set { axis, parameter: parameter.number(), value });
        };
        set(AxisParameter::Bus, Number::Unsigned(motor.bus.into()));
        set(AxisParameter::Protocol, Number::Unsigned(motor.protocol.number().into()));
        set(AxisParameter::Node, Number::Unsigned(motor.node.into()));
        set(AxisParameter::StopAction, Number::Unsigned(motor.stop.number().into()));
        // Its motor listens there as well.
        if motor.protocol == Protocol::D5 && dice.percent(extended) {
            set(AxisParameter::D5RequestId, Number::Unsigned(extended_id(motor.node)));
        }
        set(AxisParameter::AllowUnknownMotorTimeout, Number::Bool(!known_only));
        set(AxisParameter::TtlUs, Number::Unsigned(dice.pick(&[50_000, 100_000, 200_000])));
        // Before the limits: without it nothing measures a position.
        if axis == POSITION_DEVICE {
            set(AxisParameter::PositionDevice, Number::Bool(true));
        }
        let limited = if starts && motor.protocol == Protocol::D5 { 3 } else { 20 };
        if dice.percent(limited) {
            set(AxisParameter::VelocityLimitRadS, Number::Float(dice.pick(&LIMITS)));
        }
        // Nothing tells the current of a D5.
        if motor.protocol != Protocol::D5 && dice.percent(15) {
            set(AxisParameter::CurrentLimitA, Number::Float(2.0));
        }
        if dice.percent(15) {
            set(AxisParameter::TemperatureLimitC, Number::Float(60.0));
        }
        let tells_position = motor.protocol != Protocol::Thruster || axis == POSITION_DEVICE;
        if tells_position && dice.percent(8) {
            // A thruster tells half a turn to either side.
            let farthest = if motor.protocol == Protocol::Thruster { 2.0 } else { 20.0 };
            set(AxisParameter::PositionMinRad, Number::Float(-farthest));
            set(AxisParameter::PositionMaxRad, Number::Float(farthest));
        }
        // Less than what a thruster can tell: an axis with it cannot become that of one.
        if motor.protocol != Protocol::Thruster && dice.percent(10) {
            set(AxisParameter::StandstillRadS, Number::Float(0.02));
        }
        if object && motor.protocol == Protocol::D5 {
            // Their answers for others count in the load of the bus, once they are known.
            set(AxisParameter::FaultPollUs, Number::Unsigned(400_000));
            set(AxisParameter::StatePollUs, Number::Unsigned(400_000));
        }
        if motor.protocol == Protocol::Thruster && returns != 0 {
            set(AxisParameter::ReturnMode, Number::Unsigned(returns.into()));
        }
        if motor.protocol == Protocol::Rmd && spoken != DIALECTS[0] {
            let stated = match dice.percent(85) {
                true => dice.pick(&[spoken, spoken, 0]),
                false => dice.pick(&DIALECTS),
            };
            set(AxisParameter::RmdDialect, Number::Unsigned(stated.into()));
        }
        if grouped && axis < 4 {
            set(AxisParameter::TripGroup, Number::Unsigned(1));
        }
        if axis == 2 && dice.percent(80) {
            set(AxisParameter::ReleaseBrakeWhenArming, Number::Bool(true));
        }
        if dice.percent(20) {
            set(AxisParameter::Direction, Number::Signed(-1));
        }
        if provisioned {
            asks.push(Ask::Provision { axis, timeout_ms: dice.pick(&[200, 500]) });
        }
    }
    // Before there are axes a bus is opened for everything; while it is, none can be configured
    // there.
    if dice.percent(15) {
        let bus = dice.byte() % BUSES;
        let closes = match dice.percent(50) {
            true => behind_buses,
            false => behind_buses + usize::from(dice.byte()) % (asks.len() - behind_buses),
        };
        asks.insert(closes, Ask::RawClose { bus });
        asks.splice(behind_buses..behind_buses, unsafe_access(dice, bus));
    }
    let motors = (0u8..).zip(&MOTORS).map(|(motor, wired)| {
        let does = match wired.protocol {
            Protocol::D5 => Does::AnswersOthers { on: object },
            Protocol::Thruster => Does::Returns { mode: returns },
            Protocol::Rmd => Does::Speaks { dialect: spoken },
        };
        Action::Motor { motor, does }
    });
    motors.chain(asks.into_iter().map(|ask| Action::Ask { link: 0, ask })).collect()
}
