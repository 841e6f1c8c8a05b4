//! The requests as methods: one line each, with the deadline that fits.

use std::time::Duration;

use host_protocol::replies::{
    Armed, AxisReport, BusReport, GatewayReport, HelloReply, MoveTarget, RawFrames, Recognition,
    StoredReport,
};
use host_protocol::requests::{self as ask, MAX_CHANGES_AT_ONCE};
use host_protocol::{
    AxisParameter, AxisState, AxisSummary, BusMode, Bytes, Call, Change, ClearTarget, Error,
    GatewayParameter, Incident, MAX_CAN_DATA, MotorTimeout, Named, ProtocolSet, RawFrame, Setpoint,
    Setting, StateFields, StopTarget, Subject, Value,
};

use crate::client::{Client, EXPIRY_MARGIN, REPEAT_MOVE_AFTER};
use crate::error::ClientError;
use crate::stopping::StopRequest;
use crate::stream::expiry_excess;
use crate::transport::Transport;

/// Arming, provisioning and native commands talk with the motor, brake release and its confirmation
/// included.
pub const MOTOR_DEADLINE: Duration = Duration::from_secs(5);

/// A sector of 128 KiB takes up to some seconds to be erased.
const SAVE_DEADLINE: Duration = Duration::from_secs(20);

/// How often an axis that is busy is asked in all, and how long after each time.
const BUSY_TRIES: u32 = 5;
const BUSY_PAUSE: Duration = Duration::from_millis(50);

/// Asks for each page of a list: `ask` takes where it begins, and returns where the next one does.
pub(crate) fn each_page<P: Copy + PartialOrd>(
    mut first: P,
    mut ask: impl FnMut(P) -> Result<Option<P>, ClientError>,
) -> Result<(), ClientError> {
    // A page that leads back would never end.
    while let Some(next) = ask(first)?.filter(|next| *next > first) {
        first = next;
    }
    Ok(())
}

/// What a request returns: its reply, or nothing where that is `Done`.
macro_rules! returned {
    ($result:expr) => {
        $result.map(drop)
    };
    ($result:expr, $reply:ty) => {
        $result
    };
}

/// Methods that send one request and await its reply for [`DEADLINE`].
macro_rules! plain_requests {
    (@type) => { () };
    (@type $reply:ty) => { $reply };
    ($(
        $(#[$doc:meta])+
        fn $name:ident($($argument:ident: $type:ty),*) $(-> $reply:ty)? = $request:expr;
    )+) => {
        impl<T: Transport> Client<T> {
            $(
                $(#[$doc])+
                ///
                /// # Errors
                /// As [`request`](Self::request).
                pub fn $name(
                    &mut self,
                    $($argument: $type),*
                ) -> Result<plain_requests!(@type $($reply)?), ClientError> {
                    returned!(self.request(&$request) $(, $reply)?)
                }
            )+
        }
    };
}

plain_requests! {
    /// Releases the right to command.
    fn release_authority() = ask::ReleaseAuthority {};

    /// Sets a parameter of the gateway.
    fn configure_gateway(parameter: GatewayParameter, value: Value) =
        ask::ConfigureGateway { parameter: parameter.number(), value };

    /// How a bus is.
    fn bus_status(bus: u8) -> BusReport = ask::BusStatus { bus };

    /// How the gateway itself is: who commands, e-stop, enable output.
    fn gateway_status() -> GatewayReport = ask::GatewayStatus {};

    /// Sets a parameter of an axis.
    fn configure_axis(axis: u8, parameter: AxisParameter, value: Value) =
        ask::ConfigureAxis { axis, parameter: parameter.number(), value };

    /// Begins a list of changes of the configuration. It is forgotten with the right to command.
    fn begin_changes() = ask::BeginChanges {};

    /// Makes all changes of the list, or none.
    fn apply_changes() = ask::ApplyChanges {};

    /// What is stored of the configuration.
    fn read_stored() -> StoredReport = ask::ReadStored {};

    /// Forgets an axis and its parameters.
    fn remove_axis(axis: u8) = ask::RemoveAxis { axis };

    /// Switches the output of a holding motor off: it lets go, and a load that it held may drop.
    fn output_off(axis: u8) = ask::OutputOff { axis };

    /// Clears the trip of an axis, or the latched e-stop. Never arms.
    fn clear(target: ClearTarget) = ask::Clear { target };

    /// How an axis is.
    fn read_state(axis: u8) -> AxisReport = ask::ReadState { axis };

    /// What the answers of the motor of an axis say of its dialect (RMD).
    fn recognise(axis: u8) -> Recognition = ask::Recognise { axis };

    /// Opens a bus for raw frames that only read a motor.
    fn raw_open(bus: u8) = ask::RawOpen { bus, unsafe_access: false };

    /// Opens a bus without axes for any raw frame. Unsafe: frames may move motors, and nothing
    /// stops them.
    fn raw_open_unsafe(bus: u8) = ask::RawOpen { bus, unsafe_access: true };

    /// Runs a bus without axes otherwise than it is configured, open for raw frames that only read
    /// a motor, until it is closed.
    fn raw_open_at(
        bus: u8, bitrate: u32, protocols: ProtocolSet, reply_window_us: u32, mode: BusMode
    ) = ask::RawOpenAt { bus, bitrate, protocols, reply_window_us, mode };

    /// Sends a raw frame on an open bus.
    fn raw_send(bus: u8, frame: RawFrame) = ask::RawSend { bus, frame };

    /// Fetches frames that were received on an open bus; as many as fit, so ask until there are
    /// none.
    fn raw_receive(bus: u8) -> RawFrames = ask::RawReceive { bus };

    /// Closes a bus for raw frames.
    fn raw_close(bus: u8) = ask::RawClose { bus };
}

impl<T: Transport> Client<T> {
    /// Says hello again and returns what the gateway says of itself now. To the gateway that is a
    /// new session: if this link held authority, it ends, what moves trips and what is armed is
    /// disarmed.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn info(&mut self) -> Result<HelloReply, ClientError> {
        self.say_hello()
    }

    /// Takes the right to command, if it is free. Commands that need it do so by themselves.
    ///
    /// # Errors
    /// As [`request`](Self::request); `NotInCommand` when another host link holds it.
    pub fn take_authority(&mut self) -> Result<(), ClientError> {
        self.request(&ask::TakeAuthority {}).map(drop)
    }

    /// Starts a bus, or restarts it differently. `reply_window` is how long a reply is awaited, 100
    /// µs to 200 ms.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn configure_bus(
        &mut self,
        bus: u8,
        bitrate: u32,
        protocols: ProtocolSet,
        exclusive: bool,
        reply_window: Duration,
    ) -> Result<(), ClientError> {
        // Too long for the field is too long for the gateway, which then names the limits.
        let reply_window_us = u32::try_from(reply_window.as_micros()).unwrap_or(u32::MAX);
        self.request(&ask::ConfigureBus { bus, bitrate, protocols, exclusive, reply_window_us })
            .map(drop)
    }

    /// Stores the running configuration, so that it runs again after a loss of power.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn save_configuration(&mut self) -> Result<(), ClientError> {
        self.request_within(&ask::SaveConfiguration {}, SAVE_DEADLINE).map(drop)
    }

    /// Forgets the stored configuration; the running one stays.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn forget_stored(&mut self) -> Result<(), ClientError> {
        self.request_within(&ask::ForgetStored {}, SAVE_DEADLINE).map(drop)
    }

    /// Adds changes to the list that was begun: nothing changes yet.
    ///
    /// # Errors
    /// As [`request`](Self::request); the list is then forgotten.
    pub fn add_changes(&mut self, changes: &[Change]) -> Result<(), ClientError> {
        for changes in changes.chunks(MAX_CHANGES_AT_ONCE) {
            let changes = changes.iter().cloned().collect();
            self.request(&ask::AddChanges { changes })?;
        }
        Ok(())
    }

    /// The parameters of an axis that are set, and what is known of its motor's own timeout, which
    /// nobody asks the motor for.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn axis_settings(&mut self, axis: u8) -> Result<(Vec<Setting>, MotorTimeout), ClientError> {
        let (mut settings, mut motor_timeout) = (Vec::new(), MotorTimeout::Unknown);
        each_page(0, |first| {
            let page = self.request(&ask::ReadAxisSettings { axis, first })?;
            settings.extend(page.settings);
            motor_timeout = page.motor_timeout;
            Ok(page.next)
        })?;
        Ok((settings, motor_timeout))
    }

    /// The value in force of a parameter of the gateway.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn read_gateway_parameter(
        &mut self,
        parameter: GatewayParameter,
    ) -> Result<Option<Value>, ClientError> {
        self.request(&ask::ReadGatewayParameter { parameter: parameter.number() })
            .map(|reply| reply.value)
    }

    /// The last trips and starts of the gateway, the latest first; they outlive a reset.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn incidents(&mut self) -> Result<Vec<Incident>, ClientError> {
        let mut incidents = Vec::new();
        each_page(0, |first| {
            let page = self.request(&ask::ReadIncidents { first })?;
            incidents.extend(page.incidents);
            Ok(page.next)
        })?;
        Ok(incidents)
    }

    /// Why the run before failed: the message of a panic, a fault or the watchdog; empty if it did
    /// not.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn crash_report(&mut self) -> Result<String, ClientError> {
        self.request(&ask::ReadCrashReport {}).map(|report| report.text.as_str().to_owned())
    }

    /// A parameter of an axis: the value in force, `None` where none is set and there is no
    /// default.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn read_axis_parameter(
        &mut self,
        axis: u8,
        parameter: AxisParameter,
    ) -> Result<Option<Value>, ClientError> {
        self.request(&ask::ReadAxisParameter { axis, parameter: parameter.number() })
            .map(|reply| reply.value)
    }

    /// How long a setpoint of this axis may be valid: its parameter `ttl_us`.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn axis_ttl(&mut self, axis: u8) -> Result<Duration, ClientError> {
        let parameter = AxisParameter::TtlUs;
        match self.read_axis_parameter(axis, parameter)?.or(parameter.info().default) {
            Some(Value::Unsigned(ttl_us)) => Ok(Duration::from_micros(ttl_us.into())),
            _ => Err(Error::WrongType { parameter: parameter.number() }.into()),
        }
    }

    /// Every axis that has at least one parameter set.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn list_axes(&mut self) -> Result<Vec<AxisSummary>, ClientError> {
        let mut axes = Vec::new();
        each_page(0, |first| {
            let page = self.request(&ask::ListAxes { first })?;
            axes.extend(page.axes);
            Ok(page.next)
        })?;
        Ok(axes)
    }

    /// The names of the gateway, its buses and its axes, in this order.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn names(&mut self) -> Result<Vec<Named>, ClientError> {
        let mut names = Vec::new();
        each_page(Subject::Gateway, |first| {
            let page = self.request(&ask::ReadNames { first })?;
            names.extend(page.names);
            Ok(page.next)
        })?;
        Ok(names)
    }

    /// Programs the motor's own timeout; it stays in the motor.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn provision_motor_timeout(
        &mut self,
        axis: u8,
        timeout_ms: u32,
    ) -> Result<MotorTimeout, ClientError> {
        let request = ask::ProvisionMotorTimeout { axis, timeout_ms };
        self.request_within(&request, MOTOR_DEADLINE).map(|reply| reply.timeout)
    }

    /// Allows an axis to move. The epoch in the reply goes into every setpoint.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn arm(&mut self, axis: u8) -> Result<Armed, ClientError> {
        // An interrupt that came before has nothing to stop here, and another host may be moving
        // the axis.
        self.heed_interrupt(ask::Arm::NUMBER)?;
        // A session that begins ends what was armed in another.
        self.greet_anew()?;
        // Noted before it is asked for: an answer that is lost may have armed it all the same.
        let is_new = self.note_arming(axis);
        let armed =
            self.request_within(&ask::Arm { axis }, MOTOR_DEADLINE).inspect_err(|error| {
                if is_new && matches!(error, ClientError::Gateway(_)) {
                    self.forget_arming(axis);
                }
            })?;
        // An interrupt may have come with the answer.
        self.heed_interrupt(ask::Arm::NUMBER)?;
        Ok(armed)
    }

    /// Ends an axis' permission to move, through its stop action. Needs no authority.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn disarm(&mut self, axis: u8) -> Result<(), ClientError> {
        self.request(&ask::Disarm { axis })?;
        self.note_stopped(axis);
        Ok(())
    }

    /// Runs the stop action of one axis or of all. Needs no authority. It is the next frame written,
    /// and written again until it is answered; a connection that fails is opened again for it.
    ///
    /// # Errors
    /// As [`stop_armed`](Self::stop_armed).
    pub fn stop(&mut self, target: StopTarget) -> Result<(), ClientError> {
        self.stop_first(StopRequest::Stop(target))
    }

    /// Emergency stop: trips every axis that may move, stops the others too, and latches the
    /// gateway. Needs no authority. It is sent as [`stop`](Self::stop).
    ///
    /// # Errors
    /// As [`stop_armed`](Self::stop_armed).
    pub fn estop(&mut self) -> Result<(), ClientError> {
        self.stop_first(StopRequest::EStop)
    }

    fn stop_first(&mut self, request: StopRequest) -> Result<(), ClientError> {
        // An interrupt stops what was armed here, and goes before.
        self.heed_interrupt(ask::Stop::NUMBER)?;
        self.until_stopped(&[request])
    }

    /// Unsafe: leaves the trip of an axis whose motor cannot be reached or does not come to rest.
    /// It may still be turning.
    ///
    /// # Errors
    /// As [`request`](Self::request); `NothingToClear` while the stop may still be confirmed.
    pub fn clear_unreachable(&mut self, axis: u8) -> Result<(), ClientError> {
        self.request(&ask::ClearUnreachable { axis }).map(drop)
    }

    /// Says what an armed axis should do from now on, for `ttl` at most; it has to be said again
    /// before that. The reply is awaited as long as the setpoint is valid. Twice a second a
    /// ping comes first, which measures the clock that the expiry is derived from.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn set(
        &mut self,
        axis: u8,
        epoch: u32,
        setpoint: Setpoint,
        ttl: Duration,
    ) -> Result<(), ClientError> {
        self.refresh_clock()?;
        let request = ask::Setpoint { axis, epoch, expires_at_us: self.expiry(ttl), setpoint };
        self.exchange(&request, ttl, REPEAT_MOVE_AFTER).map(drop)
    }

    /// Moves an armed axis by `distance_rad`, positive is counter-clockwise, at `speed_limit_rad_s`
    /// at most: the gateway reads the position once and holds the returned target for `ttl`.
    /// Keep it up with [`Setpoint::Position`] to that target. However often the line makes it
    /// necessary to ask, the axis moves once.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn move_relative(
        &mut self,
        axis: u8,
        epoch: u32,
        distance_rad: f32,
        speed_limit_rad_s: f32,
        ttl: Duration,
    ) -> Result<MoveTarget, ClientError> {
        self.once_permitted(ttl, |client, expires_at_us| {
            let request =
                ask::MoveRelative { axis, epoch, expires_at_us, distance_rad, speed_limit_rad_s };
            client.exchange(&request, MOTOR_DEADLINE, REPEAT_MOVE_AFTER).map(|(target, _)| target)
        })
    }

    /// Sets several armed D5 motors of one bus in motion by one frame, valid for `ttl`: the speed
    /// of each waits in it until all are told to execute. Keep each up with
    /// [`Setpoint::Velocity`].
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn start_together(
        &mut self,
        members: &host_protocol::Vec<ask::Member, { ask::MAX_MEMBERS }>,
        ttl: Duration,
    ) -> Result<(), ClientError> {
        self.once_permitted(ttl, |client, expires_at_us| {
            let request = ask::StartTogether { expires_at_us, members: members.clone() };
            client.exchange(&request, MOTOR_DEADLINE, REPEAT_MOVE_AFTER).map(drop)
        })
    }

    /// Has the motor of an axis carry out a command of its own manual: `data` is the data field
    /// there, without CAN id or serial framing. Returns the data field of the motor's reply,
    /// empty where there is none.
    ///
    /// What moves needs the epoch of the arming and is valid for `ttl`, as a setpoint; for all else
    /// both may be 0.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn native(
        &mut self,
        axis: u8,
        epoch: u32,
        data: Bytes<MAX_CAN_DATA>,
        ttl: Duration,
    ) -> Result<Bytes<MAX_CAN_DATA>, ClientError> {
        self.once_permitted(ttl, |client, expires_at_us| {
            let request = ask::Native { axis, epoch, expires_at_us, data: data.clone() };
            client.request_within(&request, MOTOR_DEADLINE).map(|reply| reply.data)
        })
    }

    /// Asks with the latest expiry that the gateway may take, and if it lies too far ahead, with
    /// one that is so much earlier as it was too late: the gateway has then done nothing.
    fn once_permitted<R>(
        &mut self,
        ttl: Duration,
        mut ask: impl FnMut(&mut Self, u32) -> Result<R, ClientError>,
    ) -> Result<R, ClientError> {
        self.refresh_clock()?;
        let expires_at_us = self.latest_expiry(ttl);
        let answer = ask(self, expires_at_us);
        let Err(ClientError::Gateway(error)) = &answer else { return answer };
        let Some(excess) = expiry_excess(error) else { return answer };
        let earlier = u32::try_from((excess + EXPIRY_MARGIN).as_micros());
        ask(self, expires_at_us.wrapping_sub(earlier.unwrap_or(u32::MAX / 2)))
    }

    /// As [`native`](Self::native), asked again a few times while the axis is carrying out another
    /// request: a question of another host is soon answered. Not for a command that moves by a
    /// distance, which is better refused than late.
    ///
    /// # Errors
    /// As [`request`](Self::request); `Busy` at once of an axis that is arming or stopping.
    pub fn native_when_free(
        &mut self,
        axis: u8,
        epoch: u32,
        data: Bytes<MAX_CAN_DATA>,
        ttl: Duration,
    ) -> Result<Bytes<MAX_CAN_DATA>, ClientError> {
        for _ in 1..BUSY_TRIES {
            match self.native(axis, epoch, data.clone(), ttl) {
                Err(ClientError::Gateway(busy @ Error::Busy { .. })) => {
                    let state = self.read_state_when_free(axis)?.state;
                    if matches!(state, AxisState::Arming | AxisState::Stopping) {
                        return Err(busy.into());
                    }
                    self.pause(BUSY_PAUSE)?;
                }
                answer => return answer,
            }
        }
        self.native(axis, epoch, data, ttl)
    }

    /// Has the gateway send [`Sample`](host_protocol::Event::Sample) events, one for each of `axes`
    /// in each `period` of 1 ms to 10 s; [`poll_event`](Self::poll_event) returns them. It
    /// replaces the subscription before. Call [`keep_subscription`](Self::keep_subscription)
    /// between two looks at the events, or it ends after 5 s.
    ///
    /// # Errors
    /// As [`request`](Self::request); `UnknownAxis` for an axis that no gateway can have.
    pub fn subscribe(
        &mut self,
        axes: &[u8],
        fields: StateFields,
        period: Duration,
    ) -> Result<(), ClientError> {
        let mut mask = 0;
        for axis in axes {
            let unknown = Error::UnknownAxis { axis: *axis, max_axes: self.hello().max_axes };
            mask |= 1u32.checked_shl(u32::from(*axis)).ok_or(unknown)?;
        }
        // Too long for the field is too long for the gateway, which then names the limits.
        let period_us = u32::try_from(period.as_micros()).unwrap_or(u32::MAX);
        self.subscribe_as(ask::Subscribe { axes: mask, fields, period_us })
    }

    /// Ends the subscription of this link.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn unsubscribe(&mut self) -> Result<(), ClientError> {
        // No axis; a period has to be one all the same.
        const PERIOD_US: u32 = 1_000_000;
        self.subscribe_as(ask::Subscribe {
            axes: 0,
            fields: StateFields::NONE,
            period_us: PERIOD_US,
        })
    }

    /// As [`read_state`](Self::read_state), asked again a few times while the axis is carrying out
    /// another request.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn read_state_when_free(&mut self, axis: u8) -> Result<AxisReport, ClientError> {
        for _ in 1..BUSY_TRIES {
            match self.read_state(axis) {
                Err(ClientError::Gateway(Error::Busy { .. })) => self.pause(BUSY_PAUSE)?,
                answer => return answer,
            }
        }
        self.read_state(axis)
    }

    /// Restarts the motor of a tripped axis whose stop is confirmed, and clears the trip. Takes up
    /// to 3 s, in which what the motor held may drop.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn clear_by_restart(&mut self, axis: u8) -> Result<(), ClientError> {
        self.request_within(&ask::ClearByRestart { axis }, MOTOR_DEADLINE).map(drop)
    }
}
