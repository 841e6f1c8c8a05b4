//! A bus without axes that runs otherwise than it is configured while it is open for raw frames, as
//! a scan needs it: however it is closed, it is as it was.

use crate::bench;
use crate::raw_access::send_text;
use crate::rig::Rig;
use gateway::BusSetup;
use host_protocol::{
    AxisParameter, BusMode, BusState, Error, Event, Protocol, ProtocolSet, Quantity, Reply,
    Request, Value, requests,
};

const STATUS: &str = "141#9A00000000000000";

fn open_at(rig: &mut Rig, bus: u8, bitrate: u32, mode: BusMode) -> Result<Reply, Error> {
    let protocols = ProtocolSet::of(&[Protocol::Rmd]);
    let request = requests::RawOpenAt { bus, bitrate, protocols, reply_window_us: 5_000, mode };
    rig.ask(Request::RawOpenAt(request))
}

fn close(rig: &mut Rig, bus: u8) {
    rig.ask(Request::RawClose(requests::RawClose { bus })).unwrap();
}

/// How the port must run the bus.
fn runs(rig: &Rig, bus: u8) -> Option<(u32, BusMode)> {
    let setup: Option<BusSetup> = rig.gateway.bus_setup(bus);
    setup.map(|setup| (setup.bitrate, setup.mode))
}

fn fresh() -> Rig {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    rig
}

#[test]
fn a_bus_that_is_not_configured_runs_while_it_is_open() {
    let mut rig = fresh();
    open_at(&mut rig, 0, 500_000, BusMode::ListenOnly).unwrap();
    assert_eq!(runs(&rig, 0), Some((500_000, BusMode::ListenOnly)));
    assert_eq!(send_text(&mut rig, 0, STATUS), Err(Error::BusOnlyListens { bus: 0 }));
    rig.receive(0, "241#9C32640000002D00");
    let heard = rig.ask(Request::RawReceive(requests::RawReceive { bus: 0 }));
    assert!(matches!(heard, Ok(Reply::RawReceive(frames)) if frames.frames.len() == 1));

    // At once at another bitrate, without being as it was in between.
    let since = rig.events().len();
    open_at(&mut rig, 0, 1_000_000, BusMode::OneShot).unwrap();
    assert_eq!(runs(&rig, 0), Some((1_000_000, BusMode::OneShot)));
    let unconfigured = Event::BusStateChanged { bus: 0, state: BusState::Unconfigured };
    assert!(!rig.events()[since..].contains(&&unconfigured));
    let since = rig.now_us;
    send_text(&mut rig, 0, STATUS).unwrap();
    rig.run(1_000);
    assert_eq!(rig.sent_since(0, since), [STATUS]);
    // Only what reads.
    let moves = send_text(&mut rig, 0, "141#A200000010270000");
    assert_eq!(moves, Err(Error::RawNotHarmless { bus: 0 }));
    close(&mut rig, 0);
    assert_eq!(runs(&rig, 0), None);
    assert!(rig.events().contains(&&unconfigured));
}

#[test]
fn a_bus_that_is_configured_runs_so_again_however_it_is_closed() {
    type End = fn(&mut Rig);
    let ends: [End; 4] = [
        |rig| close(rig, 0),
        bench::e_stop,
        // The host in command is silent.
        |rig| rig.run(1_000_000),
        |rig| {
            rig.ask(Request::ReleaseAuthority(requests::ReleaseAuthority {})).unwrap();
        },
    ];
    for end in ends {
        let mut rig = fresh();
        bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
        open_at(&mut rig, 0, 210_526, BusMode::OneShot).unwrap();
        assert_eq!(runs(&rig, 0), Some((210_526, BusMode::OneShot)));
        let status = rig.ask(Request::BusStatus(requests::BusStatus { bus: 0 }));
        let Ok(Reply::BusStatus(status)) = status else { panic!("no status") };
        assert_eq!(status.config.map(|config| config.bitrate), Some(1_000_000));
        end(&mut rig);
        assert_eq!(runs(&rig, 0), Some((1_000_000, BusMode::Normal)));
    }
}

#[test]
fn nothing_is_configured_on_it_and_it_is_not_one_with_an_axis() {
    let mut rig = fresh();
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
    open_at(&mut rig, 0, 500_000, BusMode::ListenOnly).unwrap();
    let axis = |parameter: AxisParameter, value| {
        let value = Value::Unsigned(value);
        let parameter = parameter.number();
        Request::ConfigureAxis(requests::ConfigureAxis { axis: 0, parameter, value })
    };
    let refused = Err(Error::RawOpen { bus: 0 });
    assert_eq!(rig.ask(axis(AxisParameter::Bus, 0)), refused);
    let bus = requests::ConfigureBus {
        bus: 0,
        bitrate: 500_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd]),
        exclusive: false,
        reply_window_us: 5_000,
    };
    assert_eq!(rig.ask(Request::ConfigureBus(bus)), refused);
    let other = requests::RawOpen { bus: 0, unsafe_access: true };
    assert_eq!(rig.ask(Request::RawOpen(other)), refused);
    assert_eq!(runs(&rig, 0), Some((500_000, BusMode::ListenOnly)));
    close(&mut rig, 0);
    rig.ask(axis(AxisParameter::Bus, 0)).unwrap();
    let result = open_at(&mut rig, 0, 500_000, BusMode::ListenOnly);
    assert_eq!(result, Err(Error::AxisOnBus { bus: 0, axis: 0 }));

    let result = open_at(&mut rig, 1, 123, BusMode::ListenOnly);
    assert!(matches!(result, Err(Error::BitrateNotOffered { bus: 1, bitrate: 123, .. })));
    let request = requests::RawOpenAt {
        bus: 1,
        bitrate: 500_000,
        protocols: ProtocolSet::of(&[Protocol::Rmd]),
        reply_window_us: 1,
        mode: BusMode::Normal,
    };
    let result = rig.ask(Request::RawOpenAt(request));
    let window = Quantity::ReplyWindow;
    assert!(matches!(result, Err(Error::OutOfRange { quantity, .. }) if quantity == window));
    assert_eq!(runs(&rig, 1), None);
}
