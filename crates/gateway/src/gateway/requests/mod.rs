//! What each request of a host does.

mod authority;
mod config;
mod cycle;
mod draft;
mod native;
mod raw;
mod running;
mod together;

pub(crate) use authority::Authority;
pub(crate) use cycle::{Arming, Cycle, check_body};
pub(crate) use draft::Draft;
pub(crate) use running::Running;
pub(crate) use together::Together;

use crate::MAX_AXES_WIRE;
use crate::axis::{Axis, Is, JobKind};
use crate::bus::Bus;
use crate::gateway::unstopped::Why;
use crate::gateway::{Gateway, unknown_bus};
use crate::log::LogEntry;
use crate::outbox::Ticket;
use crate::protocol::Exchange;
use crate::rules;
use crate::time::{Duration, Instant};
use crate::tracked::Tracked;
use host_protocol::{
    AuthorityLossReason, AxisParameter, AxisState, BusCapability, BusConfig, Change, ClearTarget,
    Error, Event, MAX_MESSAGE, PROTOCOL_MAJOR, PROTOCOL_MINOR, Reply, Request, StopTarget, Text,
    TripReason, class, replies, requests,
};

pub(crate) type Result<T, E = Error> = core::result::Result<T, E>;

impl Gateway {
    /// Executes one request, or answers why it could not be read.
    pub(crate) fn execute(&mut self, now: Instant, ticket: Ticket, request: &Result<Request>) {
        let result = match request {
            Ok(request) if ticket.slot.is_none() && !self.is_stop(request) => return,
            Ok(request) => self.dispatch(now, ticket, request),
            Err(error) => Err(*error),
        };
        // Not only when all requests are done: one may latch the e-stop, the next clear it.
        self.close_barred_raw(now);
        if let Err(error) = result {
            self.outbox(now).answer(ticket, Err(error));
        }
    }

    /// Whether a request is executed even if no reply slot is left: it stops, and takes no exchange
    /// of its own.
    fn is_stop(&self, request: &Request) -> bool {
        match request {
            Request::Native(native) => self.is_native_stop(native),
            _ => request.is(class::STOPS),
        }
    }

    /// Executes a request and answers it, or has a job do so; not if it fails.
    fn dispatch(&mut self, now: Instant, ticket: Ticket, request: &Request) -> Result<()> {
        let commands = request.is(class::COMMANDS);
        if commands {
            self.authority.check(ticket)?;
        }
        // What is refused whoever asks takes no authority.
        self.refuse_for_image(request)?;
        if self.stored.is_saving() && request.is(class::BEGINS | class::CHANGES) {
            return Err(Error::Saving {});
        }
        if commands {
            self.authority.take(now, ticket)?;
        }
        macro_rules! done {
            ($reply:ident, $done:expr) => {{
                $done;
                Reply::$reply(replies::Done {})
            }};
        }
        let reply = match request {
            Request::Hello(hello) => Reply::Hello(self.hello(now, ticket, hello)?),
            Request::Ping(_) => Reply::Ping(replies::Pong { time_us: now.as_micros() }),
            Request::TakeAuthority(_) => Reply::TakeAuthority(replies::Done {}),
            Request::ReleaseAuthority(_) => {
                if self.authority.is_held_by(ticket.link) && !ticket.watches {
                    self.end_authority(now, Why::Released, AuthorityLossReason::Released);
                }
                Reply::ReleaseAuthority(replies::Done {})
            }
            Request::SetBaud(request) => done!(
                SetBaud,
                self.links
                    .get_mut(ticket.link)
                    .map_or(Ok(()), |link| link.baud.ask(request.baud))?
            ),
            Request::ConfigureGateway(requests::ConfigureGateway { parameter, value }) => {
                let change = Change::Gateway { parameter: *parameter, value: *value };
                done!(ConfigureGateway, self.change(now, &change)?)
            }
            Request::ConfigureBus(request) => {
                let requests::ConfigureBus { bus, bitrate, protocols, exclusive, reply_window_us } =
                    *request;
                let config = Some(BusConfig { bitrate, protocols, exclusive, reply_window_us });
                done!(ConfigureBus, self.change(now, &Change::Bus { bus, config })?)
            }
            Request::BusStatus(request) => Reply::BusStatus(self.bus(request.bus)?.report()),
            Request::GatewayStatus(_) => Reply::GatewayStatus(self.status(now)),
            Request::BeginChanges(_) => done!(BeginChanges, self.draft.open()),
            Request::AddChanges(request) => done!(AddChanges, self.add_changes(&request.changes)?),
            Request::ApplyChanges(_) => done!(ApplyChanges, self.apply_changes(now)?),
            Request::SaveConfiguration(_) => return self.save_configuration(true, ticket),
            Request::ForgetStored(_) => return self.save_configuration(false, ticket),
            Request::ReadStored(_) => Reply::ReadStored(self.stored_report()),
            Request::ReadNames(request) => Reply::ReadNames(self.read_names(*request)),
            Request::ReadGatewayParameter(request) => {
                let value = self.gateway_parameter(request.parameter)?;
                Reply::ReadGatewayParameter(replies::ParameterValue { value: Some(value) })
            }
            Request::ReadAxisSettings(request) => {
                let axis = self.axis(request.axis)?;
                Reply::ReadAxisSettings(axis.settings(now, request.first))
            }
            Request::ConfigureAxis(requests::ConfigureAxis { axis, parameter, value }) => {
                let (axis, parameter, value) = (*axis, *parameter, Some(*value));
                done!(ConfigureAxis, self.change(now, &Change::Axis { axis, parameter, value })?)
            }
            Request::ReadAxisParameter(request) => {
                let parameter = request.parameter;
                let known = AxisParameter::from_number(parameter)
                    .ok_or(Error::UnknownParameter { parameter })?;
                let value = self.axis(request.axis)?.config.get(known);
                Reply::ReadAxisParameter(replies::ParameterValue { value })
            }
            Request::ListAxes(request) => Reply::ListAxes(self.list_axes(request.first)),
            Request::RemoveAxis(request) => done!(RemoveAxis, self.remove_axis(now, request.axis)?),
            Request::ProvisionMotorTimeout(request) => return self.provision(now, request, ticket),
            Request::Arm(request) => return self.arm(now, request.axis, ticket),
            Request::ArmTogether(request) => return self.arm_together(now, request.axes, ticket),
            Request::Disarm(request) => {
                done!(Disarm, self.with_axis(now, request.axis, |axis, out| axis.disarm(now, out))?)
            }
            Request::Stop(request) => done!(Stop, self.stop(now, request.target)?),
            Request::EStop(_) => done!(EStop, self.e_stop(now)),
            Request::Clear(request) => match request.target {
                ClearTarget::Axis(axis) => return self.clear(now, axis, ticket),
                ClearTarget::Gateway => done!(Clear, self.clear_gateway(now)?),
            },
            Request::ClearUnreachable(request) => {
                // It may have become unreachable just now.
                self.remember_trips();
                self.with_axis(now, request.axis, |axis, out| axis.clear_unreachable(now, out))??;
                Reply::ClearUnreachable(replies::Done {})
            }
            Request::OutputOff(request) => return self.output_off(now, request.axis, ticket),
            Request::ClearByRestart(request) => {
                return self.clear_by_restart(now, request.axis, ticket);
            }
            Request::Setpoint(request) => done!(Setpoint, self.setpoint(now, request)?),
            Request::ReadState(request) => return self.read_state(now, request.axis, ticket),
            Request::Recognise(request) => return self.recognise(now, request.axis, ticket),
            Request::MoveRelative(request) => return self.move_relative(now, request, ticket),
            Request::Native(request) => return self.native(now, request, ticket),
            Request::StartTogether(request) => return self.start_together(now, request, ticket),
            Request::Cycle(request) => return self.cycle(now, request, ticket),
            Request::RunCycle(request) => {
                done!(RunCycle, self.run_cycle(now, request, ticket.link)?)
            }
            Request::Subscribe(request) => {
                if let Some(link) = self.links.get_mut(ticket.link) {
                    link.subscribe(now.as_micros(), request)?;
                    self.watch();
                }
                Reply::Subscribe(replies::Done {})
            }
            Request::RawOpen(request) => done!(RawOpen, self.raw_open(now, *request)?),
            Request::RawOpenAt(request) => done!(RawOpenAt, self.raw_open_at(now, *request)?),
            Request::RawSend(request) => done!(RawSend, self.raw_send(request)?),
            Request::RawReceive(request) => {
                let bus = request.bus;
                let raw = self.bus_mut(bus)?.raw.as_mut().ok_or(Error::RawNotOpen { bus })?;
                Reply::RawReceive(raw.read())
            }
            Request::RawClose(request) => done!(RawClose, self.raw_close(now, request.bus)?),
            Request::ReadIncidents(request) => {
                self.remember_trips();
                Reply::ReadIncidents(self.history.page(request.first))
            }
            Request::ReadImage(_) => Reply::ReadImage(self.image_report(now)),
            Request::BeginImage(request) => done!(BeginImage, self.begin_image(request)?),
            Request::WriteImage(request) => return self.write_image(request, ticket),
            Request::FinishImage(request) => return self.finish_image(request, ticket),
            Request::ConfirmImage(_) => return self.confirm_image(ticket),
            Request::ReadCrashReport(_) => {
                Reply::ReadCrashReport(replies::CrashReport { text: text(self.board.crash_report) })
            }
            Request::ReadFlightRecord(request) => {
                return self.read_flight_record(now, request, ticket);
            }
        };
        self.outbox(now).answer(ticket, Ok(&reply));
        Ok(())
    }

    fn hello(
        &mut self,
        now: Instant,
        Ticket { link, watches, .. }: Ticket,
        hello: &requests::Hello,
    ) -> Result<replies::HelloReply> {
        // A new session knows nothing of the epochs of the one before: its authority ends like that
        // of a silent host.
        if self.authority.is_held_by(link) && !watches {
            self.lose_authority(now);
            self.finish_stops();
        }
        // Its subscription has ended with it.
        self.watch();
        if hello.protocol_major != PROTOCOL_MAJOR {
            let host_major = hello.protocol_major;
            return Err(Error::UnsupportedVersion { gateway_major: PROTOCOL_MAJOR, host_major });
        }
        if !watches {
            self.links.log(LogEntry::Hello { link });
        }
        self.remember_trips();
        Ok(replies::HelloReply {
            protocol_major: PROTOCOL_MAJOR,
            protocol_minor: PROTOCOL_MINOR,
            firmware: text(self.board.firmware),
            build_id: text(self.board.build_id),
            board: text(self.board.name),
            boot: self.board.boot,
            has_crash_report: !self.board.crash_report.is_empty(),
            trips_recorded: self.history.len(),
            max_axes: MAX_AXES_WIRE,
            #[allow(clippy::cast_possible_truncation)]
            max_message: MAX_MESSAGE as u16,
            buses: self.buses.iter().map(|bus| capability(bus)).collect(),
            time_us: now.as_micros(),
        })
    }

    fn list_axes(&self, first: u8) -> replies::AxisList {
        let mut configured =
            self.axes.iter().filter(|axis| axis.index >= first && !axis.config.is_empty());
        let axes = configured.by_ref().take(replies::MAX_AXIS_SUMMARIES);
        let axes = axes.map(Axis::summary).collect();
        replies::AxisList { axes, next: configured.next().map(|axis| axis.index) }
    }

    fn provision(
        &mut self,
        now: Instant,
        request: &requests::ProvisionMotorTimeout,
        ticket: Ticket,
    ) -> Result<()> {
        self.refuse_e_stopped(request.axis)?;
        let axis = self.idle_axis(request.axis)?;
        rules::check_timeout(request.axis, request.timeout_ms, self.waits(axis), &axis.config)?;
        self.start(now, request.axis, JobKind::Provision { timeout_ms: request.timeout_ms }, ticket)
    }

    /// How long what its motor must hear may wait on the bus of an axis; no time where there is none.
    fn waits(&self, axis: &Axis) -> Duration {
        let bus = axis.config.bus().and_then(|bus| self.bus(bus).ok());
        bus.map_or(Duration::ZERO, Bus::feeds_within)
    }

    /// Refuses a time for the own timeout of an axis's motor that it cannot be set to, or may not on
    /// its bus as it is configured.
    ///
    /// # Errors
    /// [`Error::UnknownAxis`], [`Error::OutOfRange`] and [`Error::MotorTimeoutTooShort`].
    pub fn check_timeout(&self, axis: u8, timeout_ms: u32) -> Result<()> {
        let known = self.axis(axis)?;
        rules::check_timeout(axis, timeout_ms, self.waits(known), &known.config)
    }

    fn arm(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        self.check_arm(now, index)?;
        let epoch = self.next_epoch()?;
        self.start(now, index, JobKind::Arm { epoch, alone: true }, ticket)
    }

    /// The epoch of a new arming.
    fn next_epoch(&mut self) -> Result<u32> {
        let epoch = self.epoch.ok_or(Error::NoRandomNumber {})?.wrapping_add(1);
        self.epoch = Some(epoch);
        Ok(epoch)
    }

    /// Why an axis may not be armed now.
    fn check_arm(&self, now: Instant, index: u8) -> Result<()> {
        self.refuse_latched()?;
        let axis = self.idle_axis(index)?;
        if !axis.arming_settles_the_timeout() {
            axis.check_motor_timeout(now)?;
        }
        axis.check_programmed_timeout(self.waits(axis))?;
        if !crate::protocol::can_confirm(&axis.config) {
            return Err(Error::CannotConfirm { axis: index });
        }
        if let Some(bus) = axis.config.bus()
            && self.bus(bus)?.raw.is_some()
        {
            return Err(Error::RawOpen { bus });
        }
        let tripped = |other: &&Axis| {
            other.trip_group() == axis.trip_group() && other.trip_reason().is_some()
        };
        if axis.trip_group().is_some()
            && let Some((other, reason)) =
                self.axes.iter().find(tripped).and_then(|a| Some((a.index, a.trip_reason()?)))
        {
            return Err(Error::Tripped { axis: other, reason });
        }
        // A motor timeout programmed since may ask for a faster refresh than the configuration did.
        self.check_axis_load(index)?;
        axis.refuse_busy()
    }

    fn clear(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        self.check_clear(index)?;
        self.start(now, index, JobKind::Clear, ticket)
    }

    /// Why an axis may not be cleared now.
    fn check_clear(&self, index: u8) -> Result<()> {
        let axis = self.axis(index)?;
        match (axis.state(), axis.trip_reason()) {
            (AxisState::Tripped { confirmed: true }, Some(reason)) => {
                if reason == TripReason::EStop && self.e_stopped {
                    return Err(Error::CauseRemains { axis: index, reason });
                }
            }
            (AxisState::Tripped { .. }, _) => return Err(Error::StopNotConfirmed { axis: index }),
            // Nothing has tripped, but the motor may keep a fault of its own that bars arming.
            (AxisState::Idle | AxisState::Holding, _) => {}
            _ => return Err(Error::NothingToClear { axis: index }),
        }
        self.ready_bus(axis)
    }

    /// Only what has tripped and stands confirmed is restarted: at rest a native 0x76 does, under
    /// the rules of native commands.
    fn clear_by_restart(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        let axis = self.axis(index)?;
        if !matches!(axis.state(), AxisState::Tripped { .. }) {
            return Err(Error::NothingToClear { axis: index });
        }
        self.check_clear(index)?;
        // It lets go.
        self.refuse_latched()?;
        let axis = self.axis(index)?;
        if let Some(protocol) = axis.config.protocol().filter(|_| !axis.can(Exchange::Restart)) {
            return Err(Error::Unsupported { axis: index, protocol });
        }
        self.start(now, index, JobKind::Restart, ticket)
    }

    fn output_off(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        self.refuse_e_stopped(index)?;
        let axis = self.idle_axis(index)?;
        if axis.state() != AxisState::Holding {
            return Err(Error::NotHolding { axis: index, state: axis.state() });
        }
        if let Some(protocol) = axis.config.protocol().filter(|_| !axis.can(Exchange::OutputOff)) {
            return Err(Error::Unsupported { axis: index, protocol });
        }
        self.start(now, index, JobKind::OutputOff, ticket)
    }

    fn read_state(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        let axis = self.axis(index)?;
        let is_left_alone = axis.left_alone_at_rad_s(now).is_some();
        match axis.state() {
            AxisState::Unconfigured => Err(axis.not_configured()),
            AxisState::Idle | AxisState::Holding | AxisState::Armed | AxisState::Active
                if !is_left_alone =>
            {
                self.ready_bus(axis)?;
                self.start(now, index, JobKind::ReadState, ticket)
            }
            // The bus belongs to the arming or the stop, or reading would keep a motor that turns
            // from stopping by its own timeout: what is known is told with its age.
            _ => {
                let reply = Reply::ReadState(axis.report(now));
                self.outbox(now).answer(ticket, Ok(&reply));
                Ok(())
            }
        }
    }

    /// Asks a motor at rest which dialect it speaks; of another axis what is known is told.
    fn recognise(&mut self, now: Instant, index: u8, ticket: Ticket) -> Result<()> {
        let axis = self.axis(index)?;
        match (axis.state(), axis.config.protocol()) {
            (AxisState::Unconfigured, _) | (_, None) => Err(axis.not_configured()),
            (_, Some(protocol)) if !axis.can(Exchange::Version(0)) => {
                Err(Error::Unsupported { axis: index, protocol })
            }
            (AxisState::Idle | AxisState::Holding, _)
                if axis.left_alone_at_rad_s(now).is_none() =>
            {
                self.ready_bus(axis)?;
                self.start(now, index, JobKind::Recognise, ticket)
            }
            _ => {
                let reply = Reply::Recognise(axis.recognition());
                self.outbox(now).answer(ticket, Ok(&reply));
                Ok(())
            }
        }
    }

    fn setpoint(&mut self, now: Instant, request: &requests::Setpoint) -> Result<()> {
        self.refuse_e_stopped(request.axis)?;
        let config = &self.axis(request.axis)?.config;
        if let Some(bus) = config.bus() {
            rules::check_bus(request.axis, self.bus(bus)?.kind(), request.setpoint, config)?;
        }
        let (epoch, expires) = (request.epoch, request.expires_at_us);
        self.with_axis(now, request.axis, |axis, out| {
            axis.set(now, epoch, expires, request.setpoint, out)
        })?
    }

    pub(crate) fn stop(&mut self, now: Instant, target: StopTarget) -> Result<()> {
        match target {
            StopTarget::Axis(index) => {
                let axis = self.axis(index)?;
                if !axis.is_configured() {
                    return Err(axis.not_configured());
                }
                // On a bus that is off it is owed until that is back.
                if axis.is_idle_or_holding() {
                    running_bus(&self.buses, axis)?;
                }
                self.with_axis(now, index, |axis, out| axis.halt(now, out))
            }
            StopTarget::All => {
                self.stop_many(now, self.axes.which(Is::Configured), Why::Asked);
                Ok(())
            }
        }
    }

    fn clear_gateway(&mut self, now: Instant) -> Result<()> {
        if self.e_stop_input_open {
            return Err(Error::EStopInputOpen {});
        }
        if self.e_stopped {
            self.e_stopped = false;
            self.retention.forget_lost();
            self.outbox(now).event(&Event::EStopCleared {});
        }
        Ok(())
    }

    /// An axis that is complete, at rest and on a working bus.
    pub(crate) fn idle_axis(&self, index: u8) -> Result<&Axis> {
        let axis = self.axis(index)?;
        match (axis.state(), axis.trip_reason()) {
            (AxisState::Idle | AxisState::Holding, _) => {}
            (AxisState::Unconfigured, _) => return Err(axis.not_configured()),
            (AxisState::Tripped { .. }, Some(reason)) => {
                return Err(Error::Tripped { axis: index, reason });
            }
            (state, _) => return Err(Error::NotIdle { axis: index, state }),
        }
        self.ready_bus(axis)?;
        Ok(axis)
    }

    pub(crate) fn ready_bus(&self, axis: &Axis) -> Result<()> {
        ready_bus(&self.buses, axis)
    }

    pub(crate) fn start(
        &mut self,
        now: Instant,
        axis: u8,
        kind: JobKind,
        ticket: Ticket,
    ) -> Result<()> {
        self.with_axis(now, axis, |axis, out| axis.start(now, kind, ticket, out))
    }

    /// Authority lost by silence: what moves trips, what is armed is disarmed.
    pub(crate) fn lose_authority(&mut self, now: Instant) {
        self.end_authority(now, Why::HostSilent, AuthorityLossReason::Silence);
        self.link_lost = true;
    }

    fn end_authority(&mut self, now: Instant, why: Why, reason: AuthorityLossReason) {
        self.authority.holder = None;
        self.draft.close();
        self.stop_running();
        self.close_raw(now, true);
        self.stop_many(now, self.axes.which(Is::Configured), why);
        self.outbox(now).event(&Event::AuthorityLost { reason });
    }
}

/// Whether the bus of an axis is configured and not off.
pub(crate) fn ready_bus(buses: &[Tracked<Bus>], axis: &Axis) -> Result<()> {
    match running_bus(buses, axis)? {
        Some(bus) if bus.is_off() => Err(Error::BusOff { bus: bus.index() }),
        _ => Ok(()),
    }
}

/// The bus of an axis, which must be configured.
pub(crate) fn running_bus<'a>(buses: &'a [Tracked<Bus>], axis: &Axis) -> Result<Option<&'a Bus>> {
    let Some(index) = axis.config.bus() else { return Ok(None) };
    let bus = buses.get(usize::from(index)).ok_or_else(|| unknown_bus(buses, index))?;
    bus.config().map(|_| Some(&**bus)).ok_or(Error::BusNotConfigured { bus: index })
}

/// A board's text, cut to what the wire holds.
fn text<const N: usize>(full: &str) -> Text<N> {
    let mut text = Text::new();
    for character in full.chars() {
        if text.push(character).is_err() {
            break;
        }
    }
    text
}

fn capability(bus: &Bus) -> BusCapability {
    BusCapability {
        kind: bus.kind(),
        bitrates: bus.port().bitrates.iter().copied().take(host_protocol::MAX_BITRATES).collect(),
        protocols: crate::protocol::on(bus.kind()),
    }
}
