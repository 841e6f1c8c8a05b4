use gateway::{Outgoing, Then};

use super::*;

fn at(us: u64) -> Instant {
    Instant::from_micros(us)
}

fn told<'a>(us: u64, event: Event<'a>) -> Played<'a> {
    Played { at: at(us), call: Call::Handle(event), transmit: None }
}

fn frame(id: u16) -> CanFrame {
    CanFrame::standard(id, &[0; 8]).expect("a frame")
}

fn serial(us: u64, bytes: &[u8]) -> Played<'_> {
    told(us, Event::SerialReceived { bus: 0, bytes, then: Then::Bytes })
}

/// The gateway sends this on an RS485 bus, and hears it.
fn sends(us: u64, bytes: &[u8]) -> Played<'static> {
    let frame = Outgoing::Serial(bytes.iter().copied().collect());
    let transmit = Some(Transmit { slot: 0, frame, is_alone: true, behind_reply: false });
    Played { at: at(us), call: Call::PollTransmit { bus: 0 }, transmit }
}

fn causes(calls: &[Played<'_>]) -> Vec<(u64, Cause)> {
    let causes = outside(calls, 1).causes.into_iter();
    causes.map(|Stimulus { told, cause, .. }| (told.as_micros(), cause)).collect()
}

#[test]
fn the_gateways_own_bytes_come_back_by_themselves() {
    let calls = [sends(0, &[1, 2, 3]), serial(300, &[1, 2]), serial(400, &[3, 0x55])];
    let noise = Cause::Bytes { bus: 0, bytes: vec![0x55], damaged: false };
    assert_eq!(causes(&calls), [(400, noise)]);
}

#[test]
fn bytes_that_count_as_lost_come_damaged() {
    let lost = || told(100, Event::ReceiveOverflow { bus: 0, lost: 1 });
    let noise = Cause::Bytes { bus: 0, bytes: vec![0x55], damaged: true };
    assert_eq!(causes(&[serial(100, &[0x55]), lost()]), [(100, noise)]);
    let alone = outside(&[lost()], 1);
    assert_eq!((alone.causes.len(), alone.left_out.len()), (0, 1));
}

#[test]
fn a_cable_is_broken_between_the_frames_that_passed() {
    let state = |us, state| {
        told(us, Event::BusState { bus: 0, state, transmit_errors: 0, receive_errors: 0 })
    };
    let passed = |us| told(us, Event::CanReceived { bus: 0, frame: frame(0x7FF) });
    let cable = |us, cable| (us, Cause::Cable { bus: 0, cable });
    let comes = |us| (us, Cause::Frame { bus: 0, frame: frame(0x7FF) });
    // Off in the end: shorted, whatever a start in between says.
    let calls = [
        passed(100),
        state(900, BusState::Passive),
        state(1_500, BusState::BusOff),
        state(9_000, BusState::Active),
        state(9_500, BusState::BusOff),
        passed(20_000),
    ];
    let whole = cable(19_000, Wiring::Connected);
    assert_eq!(causes(&calls), [comes(100), cable(100, Wiring::Shorted), whole, comes(20_000)]);
    // Never off: nobody acknowledges.
    let calls = [passed(100), state(900, BusState::Passive)];
    assert_eq!(causes(&calls), [comes(100), cable(100, Wiring::Cut)]);
    // Frames go on passing: what disturbs some is not known.
    let calls = [passed(100), state(900, BusState::Warning), passed(2_000)];
    assert_eq!(causes(&calls), [comes(100), comes(2_000)]);
    assert_eq!(outside(&calls, 1).left_out.len(), 1);
}

const BIT: Duration = Duration::from_micros(1);

/// Begin and number of each host message or frame, µs.
fn begin(stimuli: &[(u64, Cause)]) -> Vec<i64> {
    let stimuli = stimuli
        .iter()
        .map(|(us, cause)| Stimulus { told: at(*us), cause: cause.clone(), at_once: false })
        .collect();
    begins_us(stimuli)
}

fn begins_us(stimuli: Vec<Stimulus>) -> Vec<i64> {
    begins(stimuli, |_| Pace { bit: BIT, noticed: NOTICED })
        .iter()
        .map(|(ns, _)| ns / 1_000)
        .collect()
}

fn host(bytes: usize) -> Cause {
    Cause::Host { link: 0, bytes: vec![7; bytes] }
}

#[test]
fn who_was_busy_was_told_late() {
    // Ten bytes last 100 µs, and an interrupt 8.
    assert_eq!(begin(&[(1_000, host(10))]), [892]);
    // Both were on the line before the first was told of.
    assert_eq!(begin(&[(1_000, host(10)), (1_010, host(10))]), [802, 902]);
    assert_eq!(begin(&[(1_000, host(10)), (2_000, host(10))]), [892, 1_892]);
}

#[test]
fn a_frame_follows_at_once_where_one_of_the_gateways_waited_for_a_gap() {
    let transmit = Some(Transmit {
        slot: 0,
        frame: Outgoing::Can(frame(5)),
        is_alone: true,
        behind_reply: false,
    });
    let polled =
        |us| Played { at: at(us), call: Call::PollTransmit { bus: 0 }, transmit: transmit.clone() };
    let comes = |us| told(us, Event::CanReceived { bus: 0, frame: frame(1) });
    let left = |us, event| told(us, event);
    let (sent, cancelled) =
        (Event::Transmitted { bus: 0, slot: 0 }, Event::Cancelled { bus: 0, slot: 0 });
    for (calls, at_once) in [
        (vec![comes(100), comes(300)], [false, false]),
        // It may have come in between.
        (vec![comes(100), polled(200), comes(300)], [false, false]),
        (vec![polled(0), comes(100), comes(300)], [false, true]),
        (vec![polled(0), comes(100), left(250, sent), comes(300)], [false, false]),
        (vec![polled(0), comes(100), left(250, cancelled), comes(300)], [false, false]),
    ] {
        let causes = outside(&calls, 1).causes;
        assert_eq!(causes.iter().map(|cause| cause.at_once).collect::<Vec<_>>(), at_once);
    }
    let cause = Cause::Frame { bus: 0, frame: frame(1) };
    let lasts = i64::from(crate::nodes::to_bus(&frame(1)).bits_until_valid());
    for (at_once, waited) in [(false, 0), (true, 40)] {
        let stimulus = Stimulus { told: at(1_000), cause: cause.clone(), at_once };
        assert_eq!(begins_us(vec![stimulus]), [992 - lasts - waited]);
    }
}

#[test]
fn a_button_counts_when_it_has_been_pressed_for_a_millisecond() {
    assert_eq!(begin(&[(5_000, Cause::EStop { open: true })]), [3_992]);
    assert_eq!(begin(&[(5_000, Cause::EStop { open: false })]), [4_992]);
}
