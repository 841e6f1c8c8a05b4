//! The bounds of the sizes, reached by the largest values: none of them lies too low.

use host_protocol::messages::Call;
use host_protocol::replies::*;
use host_protocol::requests::*;
use host_protocol::{
    AxisState, AxisSummary, BootReason, BusCapability, BusConfig, BusCounters, BusKind, BusLimit,
    BusState, CanFrame, ClearTarget, Deframer, Error, Event, FaultReading, Incident, MAX_FRAME,
    MaxSize, MotorTimeout, Protocol, ProtocolSet, Quantity, REQUESTS, RawFrame, Reading,
    ReceivedFrame, Reply, Request, Setpoint as SetpointValue, StateFields, StopTarget, Text, Trip,
    TripReason, Value, Vec as List,
};

/// Bytes of the body of a delimited frame.
fn body_length(frame: &[u8]) -> usize {
    let mut deframer = Deframer::new();
    let mut length = None;
    for byte in frame {
        if let Some(frame) = deframer.push(*byte) {
            length = Some(frame.unwrap().body.len());
        }
    }
    length.unwrap()
}

fn full<T: Clone, const N: usize>(value: T) -> List<T, N> {
    std::iter::repeat_n(value, N).collect()
}

fn text<const N: usize>() -> Text<N> {
    Text::try_from("x".repeat(N).as_str()).unwrap()
}

const PARAMETER: u16 = u16::MAX;
const VALUE: Value = Value::Signed(i32::MIN);
const READING: Option<Reading> = Some(Reading { value: f32::MAX, age_us: u32::MAX });
const TIMEOUT: MotorTimeout = MotorTimeout::Written { timeout_ms: u32::MAX };
const REASON: TripReason = TripReason::LimitExceeded {
    quantity: Quantity::Parameter(u16::MAX),
    value: f32::MAX,
    limit: f32::MAX,
};
const TRIP: Trip = Trip {
    reason: REASON,
    time_us: u64::MAX,
    velocity_rad_s: Some(f32::MAX),
    position_rad: Some(f32::MAX),
    current_a: Some(f32::MAX),
    unreachable: true,
};
const STATE: AxisState = AxisState::Tripped { confirmed: true };

fn largest_requests() -> Vec<(Request, usize)> {
    fn row<T: Call + MaxSize + Into<Request>>(request: T) -> (Request, usize) {
        (request.into(), T::MAX_SIZE)
    }
    let serial = RawFrame::Serial(full(0xFF));
    let impedance = SetpointValue::Impedance {
        position_rad: f32::MAX,
        velocity_rad_s: f32::MAX,
        stiffness_nm_per_rad: f32::MAX,
        damping_nm_s_per_rad: f32::MAX,
        torque_nm: f32::MAX,
    };
    vec![
        row(Hello { protocol_major: u16::MAX, protocol_minor: u16::MAX, session: u32::MAX }),
        row(Ping {}),
        row(TakeAuthority {}),
        row(ReleaseAuthority {}),
        row(ConfigureGateway { parameter: PARAMETER, value: VALUE }),
        row(ConfigureBus {
            bus: u8::MAX,
            bitrate: u32::MAX,
            protocols: ProtocolSet::from_bits(u8::MAX),
            exclusive: true,
            reply_window_us: u32::MAX,
        }),
        row(BusStatus { bus: u8::MAX }),
        row(GatewayStatus {}),
        row(ConfigureAxis { axis: u8::MAX, parameter: PARAMETER, value: VALUE }),
        row(ReadAxisParameter { axis: u8::MAX, parameter: PARAMETER }),
        row(ListAxes { first: u8::MAX }),
        row(RemoveAxis { axis: u8::MAX }),
        row(ProvisionMotorTimeout { axis: u8::MAX, timeout_ms: u32::MAX }),
        row(Arm { axis: u8::MAX }),
        row(Disarm { axis: u8::MAX }),
        row(Stop { target: StopTarget::Axis(u8::MAX) }),
        row(EStop {}),
        row(Clear { target: ClearTarget::Axis(u8::MAX) }),
        row(ClearUnreachable { axis: u8::MAX }),
        row(OutputOff { axis: u8::MAX }),
        row(ClearByRestart { axis: u8::MAX }),
        row(Setpoint {
            axis: u8::MAX,
            epoch: u32::MAX,
            expires_at_us: u32::MAX,
            setpoint: impedance,
        }),
        row(ReadState { axis: u8::MAX }),
        row(MoveRelative {
            axis: u8::MAX,
            epoch: u32::MAX,
            expires_at_us: u32::MAX,
            distance_rad: f32::MAX,
            speed_limit_rad_s: f32::MAX,
        }),
        row(Native { axis: u8::MAX, epoch: u32::MAX, expires_at_us: u32::MAX, data: full(0xFF) }),
        row(Subscribe {
            axes: u32::MAX,
            fields: StateFields::from_bits(u8::MAX),
            period_us: u32::MAX,
        }),
        row(StartTogether {
            expires_at_us: u32::MAX,
            members: full(Member { axis: u8::MAX, epoch: u32::MAX, velocity_rad_s: f32::MAX }),
        }),
        row(RawOpen { bus: u8::MAX, unsafe_access: true }),
        row(RawSend { bus: u8::MAX, frame: serial }),
        row(RawReceive { bus: u8::MAX }),
        row(RawClose { bus: u8::MAX }),
        row(ReadIncidents { first: u8::MAX }),
        row(ReadCrashReport {}),
    ]
}

fn largest_replies() -> Vec<(Reply, usize)> {
    let capability = BusCapability {
        kind: BusKind::Rs485,
        bitrates: full(u32::MAX),
        protocols: ProtocolSet::from_bits(u8::MAX),
    };
    let hello = HelloReply {
        protocol_major: u16::MAX,
        protocol_minor: u16::MAX,
        firmware: text(),
        build_id: text(),
        board: text(),
        boot: BootReason::Simulated,
        has_crash_report: true,
        trips_recorded: u16::MAX,
        max_axes: u8::MAX,
        max_message: u16::MAX,
        buses: full(capability),
        time_us: u64::MAX,
    };
    let config = BusConfig {
        bitrate: u32::MAX,
        protocols: ProtocolSet::from_bits(u8::MAX),
        exclusive: true,
        reply_window_us: u32::MAX,
    };
    let counters = BusCounters {
        transmitted: u32::MAX,
        received: u32::MAX,
        unmatched: u32::MAX,
        late: u32::MAX,
        rejected: u32::MAX,
        receive_overflows: u32::MAX,
        missed_acknowledgements: u32::MAX,
        cancelled: u32::MAX,
        bus_offs: u32::MAX,
    };
    let bus = BusReport {
        config: Some(config),
        state: BusState::BusOff,
        transmit_errors: u16::MAX,
        receive_errors: u16::MAX,
        counters,
        raw_open: true,
    };
    let gateway = GatewayReport {
        time_us: u64::MAX,
        starts: u32::MAX,
        holder: Some(u8::MAX),
        e_stop_latched: true,
        e_stop_input_open: Some(true),
        enable_output: Some(true),
        random_number: true,
        memory_damaged: true,
        bus_limit: Some(BusLimit::NoClock),
    };
    let incident = Incident::Tripped { start: u32::MAX, axis: u8::MAX, trip: TRIP };
    let summary = AxisSummary {
        axis: u8::MAX,
        bus: Some(u8::MAX),
        protocol: Some(Protocol::D5),
        node: Some(u8::MAX),
        state: STATE,
        missing: Some(PARAMETER),
    };
    let axis = AxisReport {
        axis: u8::MAX,
        state: STATE,
        epoch: Some(u32::MAX),
        trip: Some(TRIP),
        position_rad: READING,
        velocity_rad_s: READING,
        current_a: READING,
        voltage_v: READING,
        motor_temperature_c: READING,
        driver_temperature_c: READING,
        faults: Some(FaultReading { word: u16::MAX, warnings: u16::MAX, age_us: u32::MAX }),
        fault_record: Some(u16::MAX),
        motor_timeout: TIMEOUT,
        standstill: Some(true),
        stop_acknowledged: true,
    };
    let frame = ReceivedFrame { time_us: u64::MAX, frame: RawFrame::Serial(full(0xFF)) };
    vec![
        (Reply::Hello(hello), HelloReply::MAX_SIZE),
        (Reply::Ping(Pong { time_us: u64::MAX }), Pong::MAX_SIZE),
        (Reply::Stop(Done {}), Done::MAX_SIZE),
        (Reply::BusStatus(bus), BusReport::MAX_SIZE),
        (Reply::GatewayStatus(gateway), GatewayReport::MAX_SIZE),
        (Reply::ReadAxisParameter(ParameterValue { value: Some(VALUE) }), ParameterValue::MAX_SIZE),
        (
            Reply::ListAxes(AxisList { axes: full(summary), next: Some(u8::MAX) }),
            AxisList::MAX_SIZE,
        ),
        (
            Reply::ProvisionMotorTimeout(MotorTimeoutReport { timeout: TIMEOUT }),
            MotorTimeoutReport::MAX_SIZE,
        ),
        (Reply::Arm(Armed { epoch: u32::MAX, motor_timeout: TIMEOUT }), Armed::MAX_SIZE),
        (Reply::ReadState(axis), AxisReport::MAX_SIZE),
        (
            Reply::MoveRelative(MoveTarget { start_rad: f32::MAX, target_rad: f32::MAX }),
            MoveTarget::MAX_SIZE,
        ),
        (Reply::Native(NativeReply { data: full(0xFF) }), NativeReply::MAX_SIZE),
        (
            Reply::RawReceive(RawFrames { frames: full(frame), dropped: u32::MAX }),
            RawFrames::MAX_SIZE,
        ),
        (
            Reply::ReadIncidents(IncidentPage { incidents: full(incident), next: Some(u8::MAX) }),
            IncidentPage::MAX_SIZE,
        ),
        (Reply::ReadCrashReport(CrashReport { text: text() }), CrashReport::MAX_SIZE),
    ]
}

#[test]
fn every_request_reaches_its_bound() {
    let largest = largest_requests();
    assert!(
        largest
            .iter()
            .map(|(request, _)| request.number())
            .eq(REQUESTS.iter().map(|info| info.number))
    );
    for (request, bound) in largest {
        let mut out = [0; MAX_FRAME];
        let length = request.encode_frame(u16::MAX, &mut out).unwrap();
        assert_eq!(body_length(&out[..length]), bound, "{}", request.name());
    }
}

#[test]
fn every_kind_of_reply_reaches_its_bound() {
    for (reply, bound) in largest_replies() {
        let mut out = [0; MAX_FRAME];
        let length = reply.encode_frame(u16::MAX, &mut out).unwrap();
        assert_eq!(body_length(&out[..length]), bound, "{}", reply.name());
    }
}

#[test]
fn the_other_raw_frame_and_the_other_values_are_no_longer() {
    let can = RawFrame::Can(CanFrame::extended(0x1FFF_FFFF, &[0xFF; 8]).unwrap());
    let mut out = [0; MAX_FRAME];
    for request in [
        Request::from(RawSend { bus: u8::MAX, frame: can }),
        ConfigureAxis { axis: u8::MAX, parameter: PARAMETER, value: Value::Unsigned(u32::MAX) }
            .into(),
        ConfigureAxis { axis: u8::MAX, parameter: PARAMETER, value: Value::Float(f32::MAX) }.into(),
    ] {
        let bound = if matches!(request, Request::RawSend(_)) {
            RawSend::MAX_SIZE
        } else {
            ConfigureAxis::MAX_SIZE
        };
        let length = request.encode_frame(u16::MAX, &mut out).unwrap();
        assert!(body_length(&out[..length]) <= bound);
    }
}

#[test]
fn the_largest_error_and_event_fit() {
    let mut out = [0; MAX_FRAME];
    let error = Error::Tripped { axis: u8::MAX, reason: REASON };
    let length = error.encode_frame(u16::MAX, &mut out).unwrap();
    // Axis 1, reason 1 + quantity 1 + parameter 3 + two floats.
    assert_eq!(body_length(&out[..length]), 14);

    let error =
        Error::BitrateNotOffered { bus: u8::MAX, bitrate: u32::MAX, offered: [u32::MAX; 8] };
    let length = error.encode_frame(u16::MAX, &mut out).unwrap();
    // Bus 1, bitrate 5, eight of them 40.
    assert_eq!(body_length(&out[..length]), 46);

    let event = Event::Tripped { axis: u8::MAX, trip: TRIP };
    let length = event.encode_frame(u16::MAX, u32::MAX, u64::MAX, &mut out).unwrap();
    // Dropped 5, time 10, axis 1, reason 13, time 10, three optional floats 15, unreachable 1.
    assert_eq!(body_length(&out[..length]), 55);

    let event = Event::Sample {
        axis: u8::MAX,
        state: STATE,
        position_rad: READING,
        velocity_rad_s: READING,
        current_a: READING,
        voltage_v: READING,
        motor_temperature_c: READING,
        driver_temperature_c: READING,
        faults: Some(FaultReading { word: u16::MAX, warnings: u16::MAX, age_us: u32::MAX }),
    };
    let length = event.encode_frame(u16::MAX, u32::MAX, u64::MAX, &mut out).unwrap();
    // Dropped 5, time 10, axis 1, state 2, six readings of 10, fault word 12.
    assert_eq!(body_length(&out[..length]), 90);
}
