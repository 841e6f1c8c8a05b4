//! Changes of the configuration that are made together: what a reset in the middle leaves of them,
//! and how much fits.

use crate::bench::{self, run_with_host};
use crate::rig::{BOARD_AGAIN, Rig};
use gateway::Event;
use host_protocol::{
    AxisParameter, AxisState, BusState, Change, Error, Event as HostEvent, GatewayParameter,
    Protocol, Reply, Request, Setting, StopAction, Subject, Text, Value, replies, requests,
};

const LIMIT: u16 = AxisParameter::VelocityLimitRadS.number();

fn limit(axis: u8, value: Option<f32>) -> Change {
    Change::Axis { axis, parameter: LIMIT, value: value.map(Value::Float) }
}

fn add(rig: &mut Rig, changes: &[Change]) -> Result<Reply, Error> {
    let changes = changes.iter().cloned().collect();
    rig.ask(Request::AddChanges(requests::AddChanges { changes }))
}

fn begin(rig: &mut Rig) {
    rig.ask(Request::BeginChanges(requests::BeginChanges {})).unwrap();
}

fn apply(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::ApplyChanges(requests::ApplyChanges {}))
}

const SILENCE: u16 = GatewayParameter::LinkSilenceUs.number();
const LONGER: Value = Value::Unsigned(900_000);

/// A longer link silence.
fn longer() -> Change {
    Change::Gateway { parameter: SILENCE, value: LONGER }
}

/// Whether it is in force.
fn is_longer(rig: &mut Rig) -> bool {
    let read = requests::ReadGatewayParameter { parameter: SILENCE };
    match rig.ask(Request::ReadGatewayParameter(read)) {
        Ok(Reply::ReadGatewayParameter(reply)) => reply.value == Some(LONGER),
        other => panic!("{other:?}"),
    }
}

fn settings(rig: &mut Rig, axis: u8, first: u16) -> replies::AxisSettings {
    match rig.ask(Request::ReadAxisSettings(requests::ReadAxisSettings { axis, first })) {
        Ok(Reply::ReadAxisSettings(settings)) => settings,
        other => panic!("{other:?}"),
    }
}

/// A list takes milliseconds, in which no first stop of an axis that has just tripped could leave.
#[test]
fn a_list_that_comes_with_an_e_stop_waits_for_its_first_stops() {
    let mut rig = bench::rmd_axes(8);
    for axis in 0..8 {
        bench::arm_axis(&mut rig, axis);
    }
    let rows = [longer(), limit(9, Some(5.0))];
    begin(&mut rig);
    add(&mut rig, &rows).unwrap();
    rig.send(&Request::EStop(requests::EStop {}));
    let list = rig.send(&Request::ApplyChanges(requests::ApplyChanges {}));
    rig.run(5_000);
    let answer = rig.answer(list);
    assert!(matches!(answer, Some(Err(Error::NotIdle { .. }))), "{answer:?}");
    // Then they have left.
    begin(&mut rig);
    add(&mut rig, &rows).unwrap();
    apply(&mut rig).unwrap();
}

/// Three axes and the link silence change together, and the board is reset behind each word of what
/// is stored for it.
#[test]
fn a_reset_that_leaves_some_of_the_changes_as_before_latches_the_e_stop() {
    let mut rig = bench::rmd_axes(3);
    begin(&mut rig);
    add(&mut rig, &[limit(0, Some(5.0)), limit(1, Some(5.0)), limit(2, Some(5.0))]).unwrap();
    add(&mut rig, &[longer()]).unwrap();
    let mut latched = 0;
    let words = rig.apply_and_reset_behind_each_word(|rig, cut| {
        let status = match rig.ask(Request::GatewayStatus(requests::GatewayStatus {})) {
            Ok(Reply::GatewayStatus(status)) => status,
            other => panic!("{other:?}"),
        };
        let is_new = is_longer(rig);
        let is_limited = |axis| {
            let settings = settings(rig, axis, LIMIT).settings;
            settings.first().is_some_and(|setting| setting.parameter == LIMIT)
        };
        let limited: Vec<bool> = (0..3).map(is_limited).collect();
        if status.e_stop_latched {
            assert!(status.memory_damaged, "behind {cut} words");
            latched += 1;
        } else {
            assert_eq!(limited, [is_new; 3], "behind {cut} words");
        }
        assert!(cut > 0 || !status.e_stop_latched && !is_new);
    });
    assert!(latched > words / 2, "{latched} of {}", words);
}

/// The gateway's link silence and its name lie apart.
#[test]
fn a_reset_leaves_silence_and_name_of_the_gateway_both_as_before_or_both_new_or_says_so() {
    let mut rig = bench::rmd_axes(1);
    begin(&mut rig);
    let name = Some(Text::try_from("new").unwrap());
    add(&mut rig, &[longer(), Change::Name { of: Subject::Gateway, name }]).unwrap();
    let (mut told, mut whole) = (0, [0; 2]);
    rig.apply_and_reset_behind_each_word(|rig, cut| {
        let is_longer = is_longer(rig);
        let first = requests::ReadNames { first: Subject::Gateway };
        let is_named = match rig.ask(Request::ReadNames(first)) {
            Ok(Reply::ReadNames(list)) => !list.names.is_empty(),
            other => panic!("{other:?}"),
        };
        match rig.ask(Request::GatewayStatus(requests::GatewayStatus {})) {
            Ok(Reply::GatewayStatus(status)) if status.e_stop_latched => told += 1,
            _ => {
                assert_eq!(is_longer, is_named, "behind {cut} words");
                whole[usize::from(is_named)] += 1;
            }
        }
    });
    assert!(told > 0 && whole.iter().all(|count| *count > 0), "{told} told, {whole:?}");
}

/// What is refused leaves the list as it was: neither lost nor half of another.
#[test]
fn an_axis_that_cannot_be_removed_costs_no_list() {
    let mut rig = bench::rmd_axes(2);
    let no_axis = Err(Error::UnknownAxis { axis: 40, max_axes: 32 });
    let remove = || Request::RemoveAxis(requests::RemoveAxis { axis: 40 });
    assert_eq!(rig.ask(remove()), no_axis);
    assert_eq!(add(&mut rig, &[limit(0, Some(5.0))]), Err(Error::NoChangesBegun {}));
    begin(&mut rig);
    add(&mut rig, &[limit(0, Some(5.0))]).unwrap();
    assert_eq!(rig.ask(remove()), no_axis);
    add(&mut rig, &[limit(1, Some(6.0))]).unwrap();
    apply(&mut rig).unwrap();
    let limited = |axis| settings(&mut rig, axis, LIMIT).settings.first().map(|set| set.value);
    assert_eq!([0, 1].map(limited), [5.0, 6.0].map(|value| Some(Value::Float(value))));
}

#[test]
fn a_list_holds_352_changes_of_axes_and_no_more() {
    let mut rig = bench::rmd_axes(1);
    begin(&mut rig);
    for _ in 0..88 {
        add(&mut rig, &[0; 4].map(|axis| limit(axis, Some(5.0)))).unwrap();
    }
    // The last but one of a parameter is not the one that counts.
    let refused = add(&mut rig, &[limit(0, Some(6.0))]);
    assert_eq!(refused, Err(Error::TooManyChanges { most: 352 }));
    assert_eq!(apply(&mut rig), Err(Error::NoChangesBegun {}));
    assert_eq!(settings(&mut rig, 0, LIMIT).settings.first().map(|s| s.parameter), Some(21));
}

/// All that can be set, over more than one page, without a gap and in order.
#[test]
fn settings_are_read_page_by_page() {
    let mut rig = bench::rmd_axes(1);
    for parameter in AxisParameter::ALL.iter().copied().skip(5).take(28) {
        let value = parameter.info().default.unwrap_or(parameter.info().max);
        let request = requests::ConfigureAxis { axis: 0, parameter: parameter.number(), value };
        // Some mean nothing to this motor.
        let _ = rig.ask(Request::ConfigureAxis(request));
    }
    let (mut all, mut first) = (Vec::<Setting>::new(), Some(0));
    let mut pages = 0;
    while let Some(from) = first {
        let page = settings(&mut rig, 0, from);
        assert!(page.next.is_none() || page.settings.is_full());
        all.extend(page.settings);
        first = page.next;
        pages += 1;
    }
    let numbers: Vec<u16> = all.iter().map(|setting| setting.parameter).collect();
    assert!(pages == 2 && numbers.is_sorted_by(|a, b| a < b), "{pages}: {numbers:?}");
    for setting in &all {
        let known = AxisParameter::from_number(setting.parameter).unwrap();
        let read = requests::ReadAxisParameter { axis: 0, parameter: known.number() };
        let value = Some(setting.value);
        let reply = Reply::ReadAxisParameter(replies::ParameterValue { value });
        assert_eq!(rig.ask(Request::ReadAxisParameter(read)), Ok(reply), "{known}");
    }
}

/// A bus that is no longer configured says so, is given no frame and no setup, and its controller's
/// late words are not believed.
#[test]
fn a_bus_that_is_no_longer_configured_is_silent() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    begin(&mut rig);
    add(&mut rig, &[Change::Bus { bus: 0, config: None }]).unwrap();
    apply(&mut rig).unwrap();
    assert_eq!(rig.gateway.bus_setup(0), None);
    let told = HostEvent::BusStateChanged { bus: 0, state: BusState::Unconfigured };
    run_with_host(&mut rig, 10_000);
    assert!(rig.events().contains(&&told), "{:?}", rig.events());
    let since = rig.now_us;
    rig.handle(Event::BusState {
        bus: 0,
        state: BusState::BusOff,
        transmit_errors: 255,
        receive_errors: 0,
    });
    assert_eq!(
        rig.ask(Request::Arm(requests::Arm { axis: 0 })),
        Err(Error::BusNotConfigured { bus: 0 })
    );
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 200_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[host_protocol::Protocol::Rmd]);
    assert!(rig.gateway.bus_setup(0).is_some());
}

/// A host that only looks on, at a motor that does not answer.
fn look_on(rig: &mut Rig) {
    rig.send_as(1, &Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(1_000);
}

#[test]
fn questions_keep_nobody_from_changing_and_saving_the_configuration() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    let rows = rig.rows();
    rig.power_on_as(&BOARD_AGAIN, &rows);
    rig.handle(Event::EStopInput { open: false });
    bench::hello(&mut rig);
    run_with_host(&mut rig, 100_000);
    bench::output_off(&mut rig).unwrap();
    play.borrow_mut().mute = true;
    look_on(&mut rig);
    bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(5.0));
    // Who looked on is told what is known.
    let ping = Request::Ping(requests::Ping {});
    assert!(matches!(rig.ask_as(1, &ping), Ok(Reply::ReadState(_))));
    look_on(&mut rig);
    bench::configure_bus(&mut rig, 0, 500_000, &[Protocol::Rmd]);
    look_on(&mut rig);
    let saved = rig.send(&Request::SaveConfiguration(requests::SaveConfiguration {}));
    rig.run(100);
    assert!(rig.gateway.take_save().is_some(), "{:?}", rig.answer(saved));
    rig.handle(Event::Saved { result: Ok(()) });
    rig.run(100);
    assert!(matches!(rig.answer(saved), Some(Ok(Reply::SaveConfiguration(_)))));
    look_on(&mut rig);
    let removed = rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 }));
    assert_eq!(removed, Ok(Reply::RemoveAxis(replies::Done {})));
}
