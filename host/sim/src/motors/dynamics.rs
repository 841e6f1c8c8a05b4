//! What every motor does in the physical world, to first order: a shaft, a winding, a supply.

use std::time::Duration;

use super::injection::Outside;

/// Motion is computed at whole multiples of this, so a run does not depend on when it is looked at.
const STEP: Duration = Duration::from_millis(1);
/// Closer than this to its target a speed has reached it, rad/s.
const SPEED_REACHED: f64 = 1e-3;
/// Closer than this to its target a position has been reached, rad.
const POSITION_REACHED: f64 = 1e-4;
/// Current of a winding that no longer carries any, A.
const CURRENT_GONE: f64 = 1e-3;
/// How fast a brake stops the shaft, as a time constant, s.
const BRAKE_S: f64 = 0.005;
/// Time constant of the current, s.
const WINDING_S: f64 = 0.002;

/// The constants of one motor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Characteristics {
    /// No-load speed, rad/s.
    pub(crate) max_speed_rad_s: f64,
    /// Current limit of the driver, A.
    pub(crate) max_current_a: f64,
    /// Speed that one ampere sustains against friction or water, rad/s.
    pub(crate) speed_per_ampere: f64,
    /// Time constant of running out and of speeding up under a constant current, s.
    pub(crate) mechanical_s: f64,
    /// Time constant of the closed speed loop, s.
    pub(crate) speed_loop_s: f64,
    /// Speed asked for per radian of position error, 1/s.
    pub(crate) position_gain: f64,
    /// Supply without load, V.
    pub(crate) supply_v: f64,
    /// Resistance of the supply, Ω.
    pub(crate) supply_ohm: f64,
    /// Time constant of warming, s.
    pub(crate) thermal_s: f64,
    /// Final warming of the winding per A², K.
    pub(crate) warming_per_a2: f64,
    /// Temperature around the motor, °C.
    pub(crate) ambient_c: f64,
}

/// What the driver does with the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Drive {
    /// Output off: the shaft runs out.
    #[default]
    Off,
    /// A constant current, A.
    Current(f64),
    /// A speed, rad/s, reached with at most this acceleration, rad/s².
    Speed { rad_s: f64, acceleration: f64 },
    /// A position, rad, approached with at most this speed, rad/s.
    Position { rad: f64, max_speed: f64 },
    /// Held by the brake.
    Locked,
    /// A current as of a spring and a damper, A: `amps_per_rad` × (`rad` − position) +
    /// `amp_s_per_rad` × (`rad_s` − speed) + `amps`.
    Spring { rad: f64, rad_s: f64, amps_per_rad: f64, amp_s_per_rad: f64, amps: f64 },
}

/// Shaft, winding and supply of one motor.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Plant {
    of: Characteristics,
    drive: Drive,
    stuck: bool,
    outside: Outside,
    at: Duration,
    speed_rad_s: f64,
    position_rad: f64,
    current_a: f64,
    motor_c: f64,
    driver_c: f64,
}

impl Plant {
    pub(crate) fn new(of: Characteristics) -> Self {
        Self {
            of,
            drive: Drive::Off,
            stuck: false,
            outside: Outside::default(),
            at: Duration::ZERO,
            speed_rad_s: 0.0,
            position_rad: 0.0,
            current_a: 0.0,
            motor_c: of.ambient_c,
            driver_c: of.ambient_c,
        }
    }

    pub(crate) fn drive(&self) -> Drive {
        self.drive
    }

    pub(crate) fn set_drive(&mut self, drive: Drive) {
        self.drive = drive;
    }

    /// Blocks the shaft, or frees it.
    pub(crate) fn set_stuck(&mut self, stuck: bool) {
        self.stuck = stuck;
    }

    /// What the world does to the shaft and its sensors from now on.
    pub(crate) fn set_outside(&mut self, outside: Outside) {
        self.outside = outside;
    }

    pub(crate) fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s
    }

    pub(crate) fn position_rad(&self) -> f64 {
        self.position_rad
    }

    pub(crate) fn current_a(&self) -> f64 {
        self.outside.current_ma.map_or(self.current_a, |ma| f64::from(ma) / 1e3)
    }

    pub(crate) fn motor_c(&self) -> f64 {
        self.outside.motor_c.map_or(self.motor_c, f64::from)
    }

    pub(crate) fn driver_c(&self) -> f64 {
        self.outside.driver_c.map_or(self.driver_c, f64::from)
    }

    pub(crate) fn voltage_v(&self) -> f64 {
        self.of.supply_v - self.of.supply_ohm * self.current_a.abs()
    }

    pub(crate) fn max_speed_rad_s(&self) -> f64 {
        self.of.max_speed_rad_s
    }

    /// The driver pushes against a shaft that cannot turn.
    pub(crate) fn is_stalled(&self) -> bool {
        self.stuck && self.pushes(self.drive)
    }

    /// Whether a drive would turn the shaft from where it is.
    pub(crate) fn pushes(&self, drive: Drive) -> bool {
        match drive {
            Drive::Off | Drive::Locked => false,
            Drive::Current(current) => current.abs() >= self.of.max_current_a / 2.0,
            Drive::Speed { rad_s, .. } => rad_s != 0.0,
            Drive::Position { rad, .. } => (rad - self.position_rad).abs() > POSITION_REACHED,
            Drive::Spring { .. } => self.spring_current(0.0).abs() >= self.of.max_current_a / 2.0,
        }
    }

    /// When motion must be computed next; `None` while nothing moves.
    pub(crate) fn next_step(&self) -> Option<Duration> {
        (!self.is_settled()).then(|| next_multiple(self.at))
    }

    /// Computes motion up to `now`.
    pub(crate) fn advance(&mut self, now: Duration) {
        while self.at < now {
            let until = if self.is_settled() { now } else { next_multiple(self.at).min(now) };
            self.step((until - self.at).as_secs_f64());
            self.at = until;
        }
    }

    fn is_settled(&self) -> bool {
        if self.current_a != 0.0 || self.is_stalled() || self.outside.turning.is_some() {
            return false;
        }
        let at_rest = self.speed_rad_s == 0.0;
        match self.drive {
            Drive::Off | Drive::Locked => at_rest,
            Drive::Current(current) => at_rest && current == 0.0,
            Drive::Speed { rad_s, .. } => at_rest && (rad_s == 0.0 || self.stuck),
            Drive::Position { rad, .. } => at_rest && (rad == self.position_rad || self.stuck),
            Drive::Spring { .. } => at_rest && self.spring_current(0.0) == 0.0,
        }
    }

    fn step(&mut self, dt: f64) {
        let before = self.speed_rad_s;
        self.speed_rad_s = match self.turned_from_outside() {
            Some(speed) => speed,
            None if self.stuck => 0.0,
            None => self.next_speed(dt),
        };
        self.position_rad += (before + self.speed_rad_s) / 2.0 * dt;
        if let Drive::Position { rad, .. } = self.drive
            && (rad - self.position_rad).abs() < POSITION_REACHED
            && self.speed_rad_s.abs() < self.of.position_gain * POSITION_REACHED
        {
            (self.position_rad, self.speed_rad_s) = (rad, 0.0);
        }
        let wanted = self.wanted_current((self.speed_rad_s - before) / dt);
        self.current_a = relax(self.current_a, wanted, dt, WINDING_S, CURRENT_GONE);
        let warming = self.of.warming_per_a2 * self.current_a * self.current_a;
        self.motor_c = relax(self.motor_c, self.of.ambient_c + warming, dt, self.of.thermal_s, 0.0);
        // The driver has a heat sink.
        self.driver_c =
            relax(self.driver_c, self.of.ambient_c + warming / 2.0, dt, self.of.thermal_s, 0.0);
    }

    /// The speed that something outside gives the shaft, rad/s.
    fn turned_from_outside(&self) -> Option<f64> {
        let turning = self.outside.turning?;
        let period = (turning.turns + turning.holds).as_nanos().max(1);
        let turns = self.at.as_nanos() % period < turning.turns.as_nanos();
        Some(if turns { f64::from(turning.speed) / 1e3 } else { 0.0 })
    }

    fn next_speed(&self, dt: f64) -> f64 {
        let of = &self.of;
        let speed = self.speed_rad_s;
        let within = |target: f64, limit: f64| target.clamp(-limit, limit);
        match self.drive {
            Drive::Off => relax(speed, 0.0, dt, of.mechanical_s, SPEED_REACHED),
            Drive::Locked => relax(speed, 0.0, dt, BRAKE_S, SPEED_REACHED),
            Drive::Current(_) | Drive::Spring { .. } => {
                let current = match self.drive {
                    Drive::Current(current) => current,
                    _ => self.spring_current(dt),
                };
                let target = within(current, of.max_current_a) * of.speed_per_ampere;
                relax(speed, within(target, of.max_speed_rad_s), dt, of.mechanical_s, SPEED_REACHED)
            }
            Drive::Speed { rad_s, acceleration } => {
                let target = within(rad_s, of.max_speed_rad_s);
                let next = relax(speed, target, dt, of.speed_loop_s, SPEED_REACHED);
                speed + within(next - speed, acceleration * dt)
            }
            Drive::Position { rad, max_speed } => {
                let target = (rad - self.position_rad) * of.position_gain;
                let target = within(target, max_speed.min(of.max_speed_rad_s));
                relax(speed, target, dt, of.speed_loop_s, 0.0)
            }
        }
    }

    /// The current that a spring asks for, A, of the position that the shaft will have after `dt`:
    /// so it gains no energy from the length of the steps.
    fn spring_current(&self, dt: f64) -> f64 {
        let Drive::Spring { rad, rad_s, amps_per_rad, amp_s_per_rad, amps } = self.drive else {
            return 0.0;
        };
        let position = self.position_rad + self.speed_rad_s * dt;
        amps_per_rad * (rad - position) + amp_s_per_rad * (rad_s - self.speed_rad_s) + amps
    }

    /// The current that the motion needs, A.
    fn wanted_current(&self, acceleration: f64) -> f64 {
        let limit = self.of.max_current_a;
        let needed = match self.drive {
            Drive::Off | Drive::Locked => 0.0,
            Drive::Current(current) => current,
            Drive::Spring { .. } => self.spring_current(0.0),
            Drive::Speed { rad_s, .. } if self.is_stalled() => limit.copysign(rad_s),
            Drive::Position { rad, .. } if self.is_stalled() => {
                limit.copysign(rad - self.position_rad)
            }
            Drive::Speed { .. } | Drive::Position { .. } => {
                (self.speed_rad_s + acceleration * self.of.mechanical_s) / self.of.speed_per_ampere
            }
        };
        needed.clamp(-limit, limit)
    }
}

/// First-order approach to a target, exact for any step; within `reached` of it, the target itself.
fn relax(value: f64, target: f64, dt: f64, time_constant: f64, reached: f64) -> f64 {
    let next = target + (value - target) * (-dt / time_constant).exp();
    if (next - target).abs() <= reached { target } else { next }
}

/// The first multiple of [`STEP`] after `time`.
fn next_multiple(time: Duration) -> Duration {
    let step = STEP.as_nanos();
    let next = (time.as_nanos() / step + 1) * step;
    Duration::from_nanos(u64::try_from(next).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::super::injection::Turning;
    use super::*;

    const MOTOR: Characteristics = Characteristics {
        max_speed_rad_s: 30.0,
        max_current_a: 10.0,
        speed_per_ampere: 5.0,
        mechanical_s: 0.2,
        speed_loop_s: 0.02,
        position_gain: 10.0,
        supply_v: 48.0,
        supply_ohm: 0.1,
        thermal_s: 60.0,
        warming_per_a2: 0.5,
        ambient_c: 25.0,
    };
    const FREE: f64 = f64::INFINITY;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn running(drive: Drive, until: Duration) -> Plant {
        let mut plant = Plant::new(MOTOR);
        plant.set_drive(drive);
        plant.advance(until);
        plant
    }

    #[track_caller]
    fn near(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() <= tolerance, "{value} is not {expected} ± {tolerance}");
    }

    /// After one time constant 63.2 % of the target are reached.
    #[test]
    fn speed_follows_to_first_order() {
        let plant = running(Drive::Speed { rad_s: 10.0, acceleration: FREE }, ms(20));
        near(plant.speed_rad_s(), 6.321, 0.01);
        let plant = running(Drive::Speed { rad_s: 10.0, acceleration: FREE }, ms(1000));
        near(plant.speed_rad_s(), 10.0, 0.0);
        near(plant.current_a(), 2.0, 0.01);
        near(plant.voltage_v(), 47.8, 0.01);
    }

    #[test]
    fn acceleration_is_limited() {
        let plant = running(Drive::Speed { rad_s: 20.0, acceleration: 10.0 }, ms(1000));
        near(plant.speed_rad_s(), 10.0, 0.01);
        near(plant.position_rad(), 5.0, 0.02);
    }

    /// One ampere sustains 5 rad/s; the supply cannot give more than 10 A or 30 rad/s.
    #[test]
    fn current_drives_up_to_the_limits() {
        near(running(Drive::Current(1.0), ms(200)).speed_rad_s(), 3.161, 0.01);
        near(running(Drive::Current(100.0), ms(5000)).speed_rad_s(), 30.0, 0.01);
        near(running(Drive::Current(1.0), ms(5000)).current_a(), 1.0, 0.001);
    }

    #[test]
    fn something_outside_turns_the_shaft_and_holds_it() {
        let mut plant = Plant::new(MOTOR);
        let turning = Some(Turning { speed: -2_000, turns: ms(20), holds: ms(5) });
        plant.set_outside(Outside { turning, current_ma: Some(-500), ..Outside::default() });
        plant.advance(ms(15));
        near(plant.speed_rad_s(), -2.0, 0.0);
        near(plant.current_a(), -0.5, 0.0);
        plant.advance(ms(23));
        near(plant.speed_rad_s(), 0.0, 0.0);
        plant.advance(ms(250));
        near(plant.position_rad(), -0.4, 0.02);
        plant.set_outside(Outside::default());
        plant.advance(ms(5_000));
        near(plant.speed_rad_s(), 0.0, 0.0);
    }

    #[test]
    fn position_is_reached_exactly_and_not_faster_than_allowed() {
        let drive = Drive::Position { rad: 3.0, max_speed: 2.0 };
        near(running(drive, ms(1000)).speed_rad_s(), 2.0, 0.05);
        let plant = running(drive, ms(5000));
        assert_eq!((plant.position_rad(), plant.speed_rad_s()), (3.0, 0.0));
    }

    #[test]
    fn without_output_the_shaft_runs_out_and_the_brake_is_faster() {
        let stop = |drive| {
            let mut plant = running(Drive::Speed { rad_s: 10.0, acceleration: FREE }, ms(500));
            plant.set_drive(drive);
            let stopped = |at: &u64| {
                plant.advance(ms(*at));
                plant.speed_rad_s() == 0.0
            };
            (501..5_000).find(stopped).unwrap() - 500
        };
        assert!((1_500..2_500).contains(&stop(Drive::Off)));
        assert!((30..60).contains(&stop(Drive::Locked)));
    }

    #[test]
    fn a_stuck_shaft_draws_the_full_current_and_gets_warm() {
        let mut plant = Plant::new(MOTOR);
        plant.set_stuck(true);
        plant.set_drive(Drive::Speed { rad_s: -1.0, acceleration: FREE });
        plant.advance(Duration::from_secs(60));
        assert!(plant.is_stalled());
        assert_eq!(plant.speed_rad_s(), 0.0);
        near(plant.current_a(), -10.0, 0.01);
        near(plant.motor_c(), 25.0 + 50.0 * 0.632, 0.2);
        near(plant.driver_c(), 25.0 + 25.0 * 0.632, 0.2);
    }

    /// A spring of 2 A/rad that 3 A push against rests 1.5 rad further; a damper alone sustains a
    /// part of its speed.
    #[test]
    fn a_spring_rests_where_its_currents_add_up_to_none() {
        let spring = |amps, amp_s_per_rad| Drive::Spring {
            rad: 1.0,
            rad_s: 0.0,
            amps_per_rad: 2.0,
            amp_s_per_rad,
            amps,
        };
        let plant = running(spring(3.0, 0.5), ms(10_000));
        near(plant.position_rad(), 2.5, 0.01);
        near(plant.speed_rad_s(), 0.0, 0.001);
        near(running(spring(0.0, 0.5), ms(10_000)).position_rad(), 1.0, 0.01);
        let damper = Drive::Spring {
            rad: 0.0,
            rad_s: 4.0,
            amps_per_rad: 0.0,
            amp_s_per_rad: 0.6,
            amps: 0.0,
        };
        // 0.6 (4 − v) A sustain 5 rad/s for each ampere: v = 3 rad/s.
        near(running(damper, ms(5_000)).speed_rad_s(), 3.0, 0.01);
    }

    /// Without damping its swing is lost to friction and not fed by the steps; held fast it stalls.
    #[test]
    fn a_stiff_spring_swings_out_and_a_stuck_one_stalls() {
        let stiff = Drive::Spring {
            rad: 0.01,
            rad_s: 0.0,
            amps_per_rad: 400.0,
            amp_s_per_rad: 0.0,
            amps: 0.0,
        };
        near(running(stiff, ms(5_000)).position_rad(), 0.01, 0.001);
        let mut plant = Plant::new(MOTOR);
        plant.set_stuck(true);
        plant.set_drive(Drive::Spring {
            rad: 1.0,
            rad_s: 0.0,
            amps_per_rad: 6.0,
            amp_s_per_rad: 0.0,
            amps: 0.0,
        });
        plant.advance(ms(100));
        assert!(plant.is_stalled());
        near(plant.current_a(), 6.0, 0.01);
    }

    #[test]
    fn a_plant_at_rest_asks_for_no_steps() {
        let mut plant = Plant::new(MOTOR);
        assert_eq!(plant.next_step(), None);
        plant.set_drive(Drive::Speed { rad_s: 1.0, acceleration: FREE });
        assert_eq!(plant.next_step(), Some(ms(1)));
        plant.advance(ms(300));
        assert_eq!(plant.next_step(), Some(ms(301)));
        plant.set_drive(Drive::Off);
        plant.advance(ms(5_000));
        assert_eq!(plant.next_step(), None);
    }
}
