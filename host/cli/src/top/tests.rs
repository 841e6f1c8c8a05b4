//! The screen as it is, character by character.

use std::time::Duration;

use host_protocol::replies::{BusReport, GatewayReport};
use host_protocol::{
    AxisState, AxisSummary, BusConfig, BusCounters, BusKind, BusState, Event, EventMessage,
    FaultReading, Protocol, ProtocolSet, Reading, Trip, TripReason,
};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier};
use ratatui::widgets::Paragraph;

use super::screen;
use super::view::{Message, View};
use crate::live::{Bus, Live};

const NOW: Duration = Duration::from_secs(3);

fn reading(value: f32) -> Option<Reading> {
    Some(Reading { value, age_us: 12_000 })
}

fn event(event: Event) -> EventMessage {
    EventMessage { dropped: 0, time_us: 2_500_000, event }
}

fn sample(axis: u8, state: AxisState) -> EventMessage {
    event(Event::Sample {
        axis,
        state,
        position_rad: reading(1.25),
        velocity_rad_s: reading(-2.0),
        current_a: Some(Reading { value: 0.5, age_us: 1_500_000 }),
        voltage_v: reading(24.0),
        motor_temperature_c: reading(31.0),
        driver_temperature_c: None,
        faults: Some(FaultReading { word: 0, warnings: 0, age_us: 12_000 }),
    })
}

fn bus(state: BusState, bus_offs: u32) -> BusReport {
    BusReport {
        config: Some(BusConfig {
            bitrate: 1_000_000,
            protocols: ProtocolSet::of(&[Protocol::Rmd]),
            exclusive: false,
            reply_window_us: 2_000,
        }),
        state,
        transmit_errors: 0,
        receive_errors: 0,
        counters: BusCounters { transmitted: 0, received: 0, bus_offs, ..BusCounters::default() },
        raw_open: false,
    }
}

/// A gateway with an axis that is active, one that has tripped, and one that nobody has heard of.
fn live() -> Live {
    let mut live = Live::of("/dev/ttyACM0");
    let summary = |axis, state| AxisSummary {
        axis,
        bus: Some(0),
        protocol: Some(if axis == 1 { Protocol::Thruster } else { Protocol::Rmd }),
        node: Some(1),
        state,
        missing: None,
    };
    live.list(&[
        summary(0, AxisState::Idle),
        summary(1, AxisState::Armed),
        summary(12, AxisState::Idle),
    ]);
    live.name = Some("rig".to_owned());
    live.axes[0].name = Some("left-shoulder".to_owned());
    live.status = Some(GatewayReport {
        time_us: 3_000_000,
        starts: 1,
        holder: Some(2),
        e_stop_latched: false,
        e_stop_input_open: Some(false),
        enable_output: Some(true),
        random_number: true,
        memory_damaged: false,
        bus_limit: None,
    });
    live.buses = vec![Bus::new(0, BusKind::Can), Bus::new(1, BusKind::Rs485)];
    live.bus(0, bus(BusState::Active, 0), Duration::from_secs(1));
    let mut later = bus(BusState::Active, 0);
    (later.counters.transmitted, later.counters.received) = (1_000, 1_000);
    live.bus(0, later, Duration::from_secs(2));
    live.bus(1, bus(BusState::BusOff, 3), Duration::from_secs(2));
    live.event(&sample(0, AxisState::Active), NOW);
    let trip = Trip {
        reason: TripReason::SetpointExpired,
        time_us: 2_500_000,
        velocity_rad_s: None,
        position_rad: None,
        current_a: None,
        unreachable: false,
    };
    live.event(&event(Event::Tripped { axis: 1, trip }), NOW);
    live.event(&event(Event::EnableOutputChanged { active: true }), NOW);
    live
}

fn view() -> View {
    View { chosen: Some(1), ..View::default() }
}

/// What ratatui makes of it on a terminal of this size.
fn drawn(live: &Live, view: &View, width: u16, height: u16) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal
        .draw(|frame| {
            let lines = screen::lines(live, view, NOW, width, height);
            assert!(lines.len() <= usize::from(height), "{} lines", lines.len());
            frame.render_widget(Paragraph::new(lines), frame.area());
        })
        .unwrap();
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> Vec<String> {
    let row = |row: &[ratatui::buffer::Cell]| {
        row.iter().map(|cell| cell.symbol()).collect::<String>().trim_end().to_owned()
    };
    buffer.content.chunks(usize::from(buffer.area.width)).map(row).collect()
}

fn shown(live: &Live, view: &View, width: u16, height: u16) -> Vec<String> {
    text(&drawn(live, view, width, height))
}

#[test]
fn a_screen_of_80_by_24() {
    assert_eq!(
        shown(&live(), &view(), 80, 24),
        [
            "rig  /dev/ttyACM0",
            "command: host link 2  e-stop: not latched, input closed  enable: active",
            " axis name       protocol state              rad    rad/s       A   °C    age",
            "    0 left-shou… rmd      active           1.250    -2.00   0.50*   31  12 ms",
            ">   1            thruster TRIPPED              -        -       -    -      -",
            "      STOP NOT CONFIRMED: the setpoint expired [E-setpoint-expired]",
            "   12            rmd      idle                 -        -       -    -      -",
            "  bus name       kind    bit/s state          load sent/s recv/s errors",
            "    0            CAN   1000000 active        ≤27 %   1000   1000 none",
            "    1            RS485 1000000 bus-off           -      -      - bus-off 3",
            "trips and starts",
            "t=2.500000 s  axis 1 tripped: the setpoint expired [E-setpoint-expired]",
            "events",
            "t=2.500000 s  the enable output is active",
            "",
            "",
            "",
            "",
            "",
            "",
            "",
            "",
            "",
            "space stop all  ↑↓ choose axis  c clear its trip  q quit",
        ]
    );
}

#[test]
fn a_narrow_screen_leaves_out_what_matters_least() {
    assert_eq!(
        shown(&live(), &view(), 40, 12),
        [
            "rig  /dev/ttyACM0",
            "command: host link 2  e-stop: not latch…",
            " axis state              rad    rad/s",
            "    0 active           1.250    -2.00",
            ">   1 TRIPPED              -        -",
            "      STOP NOT CONFIRMED: the setpoint",
            "      expired [E-setpoint-expired]",
            "   12 idle                 -        -",
            "trips and starts",
            "t=2.500000 s  axis 1 tripped: the setpo…",
            "",
            "space stop all  ↑↓ choose axis  c clear…",
        ]
    );
    assert_eq!(
        shown(&live(), &view(), 24, 5),
        [
            "rig  /dev/ttyACM0",
            "command: host link 2  e…",
            " axis state",
            ">   1 TRIPPED",
            "space stop all  ↑↓ choo…",
        ]
    );
    // However small, it is drawn.
    for (width, height) in [(1, 1), (2, 2), (10, 3), (300, 100)] {
        assert_eq!(shown(&live(), &view(), width, height).len(), usize::from(height));
    }
}

#[test]
fn a_gateway_that_is_lost_and_one_without_axes_say_so() {
    let mut lost = live();
    lost.lost("the other side closed the connection");
    let screen = shown(&lost, &view(), 80, 24);
    assert_eq!(screen[1], "NOT CONNECTED, connecting again: the other side closed the connection");
    let empty = Live::of("tcp:127.0.0.1:7401");
    assert_eq!(
        shown(&empty, &View::default(), 80, 6)[..3],
        ["tcp:127.0.0.1:7401", "", "no axis is configured"]
    );
}

#[test]
fn what_a_key_came_to_stands_above_the_keys() {
    let mut view = view();
    view.ask_to_clear(&live());
    let screen = shown(&live(), &view, 80, 24);
    assert_eq!(screen[22], "clear the trip of axis 1? It stays disarmed. y: yes, else: no");
    assert_eq!(screen[23], "space stop all  ↑↓ choose axis  c clear its trip  q quit");
    view.confirm = None;
    view.message = Message {
        is_bad: true,
        lines: (0..9).map(|axis| format!("axis {axis}: stop confirmed, idle")).collect(),
    };
    let screen = shown(&live(), &view, 80, 12);
    assert_eq!(
        screen[7..11],
        [
            "axis 0: stop confirmed, idle",
            "axis 1: stop confirmed, idle",
            "axis 2: stop confirmed, idle",
            "and 6 lines more",
        ]
    );
}

#[test]
fn colour_adds_to_the_words_and_is_left_out_where_it_is_not_wanted() {
    let row = |buffer: &Buffer| {
        let row = text(buffer).iter().position(|line| line.contains("TRIPPED")).unwrap();
        buffer[(1, u16::try_from(row).unwrap())].clone()
    };
    let plain = row(&drawn(&live(), &view(), 80, 24));
    assert_eq!((plain.fg, plain.modifier), (Color::Reset, Modifier::BOLD));
    let coloured = View { colour: true, ..view() };
    let cell = row(&drawn(&live(), &coloured, 80, 24));
    assert_eq!(cell.fg, Color::Red);
    let uncoloured = drawn(&live(), &view(), 80, 24);
    assert!(uncoloured.content.iter().all(|cell| cell.fg == Color::Reset));
    assert_eq!(text(&uncoloured), text(&drawn(&live(), &coloured, 80, 24)));
}

#[test]
fn the_chosen_axis_is_seen_however_many_there_are() {
    let mut live = Live::of("x");
    let summary = |axis| AxisSummary {
        axis,
        bus: Some(0),
        protocol: Some(Protocol::D5),
        node: Some(1),
        state: AxisState::Idle,
        missing: None,
    };
    live.list(&(0..32).map(summary).collect::<Vec<_>>());
    let mut view = View::default();
    for number in 0..32_u8 {
        view.choose(&live, isize::from(number > 0));
        assert_eq!(view.chosen, Some(number));
        let screen = shown(&live, &view, 60, 10);
        let chosen: Vec<_> = screen.iter().filter(|line| line.starts_with('>')).collect();
        assert!(chosen.len() == 1 && chosen[0].starts_with(&format!(">{number:>4}")), "{screen:?}");
    }
    view.choose(&live, 1);
    assert_eq!(view.chosen, Some(31), "there is no next one");
    view.choose(&live, -1);
    assert_eq!(view.chosen, Some(30));
    view.ask_to_clear(&live);
    assert_eq!((view.confirm, view.message.lines[0].as_str()), (None, "axis 30 is not tripped"));
}
