//! Another firmware: who may send it when, what waits for its confirmation, and when the gateway
//! starts anew.

use crate::bench;
use crate::rig::{Instead, Rig};
use gateway::{Duration, Event, FoundImage, Gateway, ImageJob, Images, Instant, Save, SaveError};
use host_protocol::{
    AxisState, BusMode, Bytes, ClearTarget, Error, FirmwareVersion, ImageState, MAX_FRAME,
    Protocol, ProtocolSet, Reply, Request, StopTarget, Text, replies, requests,
};
use std::cell::Cell;
use std::rc::Rc;

const RUNS: FirmwareVersion = FirmwareVersion { major: 0, minor: 2, patch: 0 };
const NEWER: FirmwareVersion = FirmwareVersion { major: 0, minor: 2, patch: 1 };
const ROOM: u32 = 1024;

/// One axis that may be armed, on a board with room for images.
fn rig(found: FoundImage) -> Rig {
    let mut rig = bench::rmd_axes(1);
    let images = Images { version: RUNS, room: ROOM, needs_signature: false, found };
    rig.gateway.set_images(rig.now(), images);
    rig
}

fn announced() -> requests::BeginImage {
    requests::BeginImage {
        board: Text::try_from("rig").unwrap(),
        version: NEWER,
        length: 160,
        checksum: 0x1234_5678,
        allow_older: false,
    }
}

fn begin(rig: &mut Rig) {
    assert!(matches!(rig.ask(announced().into()), Ok(Reply::BeginImage(_))));
}

fn write(offset: u32, length: usize) -> Request {
    let bytes = (0..).take(length).collect();
    requests::WriteImage { offset, bytes }.into()
}

fn finish() -> Request {
    requests::FinishImage { signature: Bytes::new() }.into()
}

fn arm() -> Request {
    requests::Arm { axis: 0 }.into()
}

/// Asks for what the flash is needed for, which then ends so.
fn store(rig: &mut Rig, request: Request, ends: Result<(), SaveError>) -> Result<Reply, Error> {
    let sequence = rig.send(&request);
    rig.run(50_000);
    assert_eq!(rig.answer(sequence), None, "not before it is stored");
    assert!(matches!(rig.gateway.take_save(), Some(Save::Image(_))), "once");
    assert_eq!(rig.gateway.take_save(), None);
    // Meanwhile nothing begins to move, and nothing else is stored.
    for other in [arm(), write(0, 32), requests::SaveConfiguration {}.into(), announced().into()] {
        let refused = rig.ask(other).unwrap_err();
        assert!(matches!(refused, Error::Saving {} | Error::ImageOnTrial {}), "{refused:?}");
    }
    rig.handle(Event::Saved { result: ends });
    rig.run(1_000);
    rig.answer(sequence).expect("it is answered")
}

fn state(rig: &mut Rig) -> replies::ImageReport {
    match rig.ask(requests::ReadImage {}.into()) {
        Ok(Reply::ReadImage(report)) => report,
        other => panic!("{other:?}"),
    }
}

/// Whether the gateway wants to start anew at this time.
fn restarts(rig: &mut Rig, at: Instant) -> bool {
    rig.gateway.handle(at, Event::Tick, &mut |_, _| {}).restart
}

#[test]
fn an_image_is_written_in_its_order_and_finished_when_it_is_whole() {
    let mut rig = rig(FoundImage::Kept);
    assert_eq!(rig.ask(write(0, 32)), Err(Error::ImageIncomplete { missing: 0 }), "not begun");
    assert_eq!(rig.ask(finish()), Err(Error::ImageIncomplete { missing: 0 }));
    begin(&mut rig);
    for (offset, length) in [(32, 32), (0, 0), (0, 31), (0, 33)] {
        assert_eq!(rig.ask(write(offset, length)), Err(Error::ImageGap { next: 0 }), "{offset}");
    }
    let sequence = rig.send(&write(0, 128));
    rig.run(1_000);
    let bytes: Bytes<128> = (0..128).collect();
    let job = Save::Image(ImageJob::Write { offset: 0, bytes });
    assert_eq!(rig.gateway.take_save(), Some(job));
    rig.handle(Event::Saved { result: Ok(()) });
    rig.run(1_000);
    assert!(matches!(rig.answer(sequence), Some(Ok(Reply::WriteImage(_)))));
    assert_eq!(rig.ask(finish()), Err(Error::ImageIncomplete { missing: 32 }));
    // What was written already, and more than was announced.
    for (offset, length) in [(0, 32), (128, 64)] {
        assert_eq!(rig.ask(write(offset, length)), Err(Error::ImageGap { next: 128 }));
    }
    assert!(store(&mut rig, write(128, 32), Ok(())).is_ok());
    assert_eq!(rig.ask(write(160, 32)), Err(Error::ImageGap { next: 160 }));
    assert!(matches!(store(&mut rig, finish(), Ok(())), Ok(Reply::FinishImage(_))));
    assert_eq!(rig.ask(finish()), Err(Error::Restarting {}), "once");
    assert_eq!(state(&mut rig).state, ImageState::Kept, "it runs from the next start on");
}

#[test]
fn what_does_not_fit_is_refused_before_a_byte_is_written() {
    let mut rig = rig(FoundImage::Kept);
    let mut ask = |change: &dyn Fn(&mut requests::BeginImage)| {
        let mut image = announced();
        change(&mut image);
        rig.ask(image.into())
    };
    let other = |image: &mut requests::BeginImage| image.board = Text::try_from("other").unwrap();
    assert_eq!(ask(&other), Err(Error::ImageForAnotherBoard {}));
    for length in [0, 31, 33, ROOM + 32, u32::MAX] {
        let refused = ask(&|image| image.length = length);
        assert_eq!(refused, Err(Error::ImageLength { room: ROOM }), "{length}");
    }
    let older = FirmwareVersion { major: 0, minor: 1, patch: 9 };
    assert_eq!(ask(&|image| image.version = older), Err(Error::OlderImage { running: RUNS }));
    assert!(ask(&|image| (image.version, image.allow_older) = (older, true)).is_ok());
    assert!(ask(&|image| image.version = RUNS).is_ok(), "the same again");
    assert!(ask(&|image| image.length = ROOM).is_ok());
}

#[test]
fn a_board_without_room_takes_none() {
    let mut rig = bench::rmd_axes(1);
    assert_eq!(rig.ask(announced().into()), Err(Error::NoImageRoom {}));
    assert_eq!(state(&mut rig).room, 0);
    assert_eq!(rig.ask(requests::ConfirmImage {}.into()), Err(Error::NoImageOnTrial {}));
}

#[test]
fn what_fails_is_begun_anew() {
    for (ends, error) in [
        (SaveError::Failed, Error::ImageNotWritten {}),
        (SaveError::Full, Error::ImageNotWritten {}),
        (SaveError::Damaged, Error::ImageDamaged {}),
        (SaveError::NotSigned, Error::ImageNotSigned {}),
    ] {
        let mut rig = rig(FoundImage::Kept);
        begin(&mut rig);
        assert!(store(&mut rig, write(0, 128), Ok(())).is_ok());
        assert!(store(&mut rig, write(128, 32), Ok(())).is_ok());
        assert_eq!(store(&mut rig, finish(), Err(ends)), Err(error));
        assert_eq!(rig.ask(finish()), Err(Error::ImageIncomplete { missing: 0 }));
        assert_eq!(rig.ask(write(0, 32)), Err(Error::ImageIncomplete { missing: 0 }));
        begin(&mut rig);
        assert_eq!(store(&mut rig, write(0, 32), Err(ends)), Err(error));
        assert_eq!(rig.ask(write(32, 32)), Err(Error::ImageIncomplete { missing: 0 }));
    }
}

#[test]
fn nothing_of_it_happens_while_an_axis_may_move() {
    let mut rig = rig(FoundImage::Kept);
    begin(&mut rig);
    let epoch = bench::arm(&mut rig);
    assert_ne!(epoch, 0);
    let armed = Err(Error::NotIdle { axis: 0, state: AxisState::Armed });
    for request in [announced().into(), write(0, 32)] {
        assert_eq!(rig.ask(request), armed);
    }
    assert!(rig.gateway.take_save().is_none());
    let at = rig.now() + Duration::from_millis(1_000);
    assert!(!restarts(&mut rig, at));
}

#[test]
fn a_start_comes_100_ms_after_the_image_is_finished_and_nothing_is_armed_before() {
    let mut rig = rig(FoundImage::Kept);
    begin(&mut rig);
    assert!(store(&mut rig, write(0, 128), Ok(())).is_ok());
    assert!(store(&mut rig, write(128, 32), Ok(())).is_ok());
    let at = rig.now() + Duration::from_millis(10_000);
    assert!(!rig.gateway.clone().handle(at, Event::Tick, &mut |_, _| {}).restart);
    assert!(store(&mut rig, finish(), Ok(())).is_ok());
    for request in [arm(), announced().into(), requests::SaveConfiguration {}.into()] {
        assert_eq!(rig.ask(request), Err(Error::Restarting {}));
    }
    let due = rig.gateway.next_deadline().unwrap();
    assert!(due.since(rig.now()) <= Duration::from_millis(100));
    assert!(!restarts(&mut rig, Instant::from_micros(due.as_micros() - 1)));
    assert!(restarts(&mut rig, due));
}

/// An image was finished, and the start comes in 100 ms.
fn finished() -> Rig {
    let mut rig = rig(FoundImage::Kept);
    begin(&mut rig);
    assert!(store(&mut rig, write(0, 128), Ok(())).is_ok());
    assert!(store(&mut rig, write(128, 32), Ok(())).is_ok());
    assert!(store(&mut rig, finish(), Ok(())).is_ok());
    rig
}

/// Nobody watches a motor while images are exchanged, and the next one may not know the words that
/// keep the e-stop.
#[test]
fn the_start_of_another_image_waits_for_rest_and_for_the_e_stop_to_be_cleared() {
    let stop = requests::Stop { target: StopTarget::Axis(0) }.into();
    for (request, clears) in [(stop, false), (requests::EStop {}.into(), true)] {
        let mut rig = finished();
        let is_mute = Rc::new(Cell::new(true));
        let mute = is_mute.clone();
        rig.instead(move |_| if mute.get() { Instead::Nothing } else { Instead::AsUsual });
        rig.send(&request);
        rig.run(200_000);
        is_mute.set(false);
        bench::run_with_host(&mut rig, 1_000_000);
        assert!(!rig.gateway.all_at_rest() && !rig.starts_anew, "{request:?}");
        // Who is tripped is cleared, and who holds is let go: that is possible all the same.
        if clears {
            rig.ask(requests::Clear { target: ClearTarget::Gateway }.into()).unwrap();
        }
        bench::clear(&mut rig).unwrap();
        assert!(!rig.starts_anew, "{request:?}");
        rig.send(&requests::OutputOff { axis: 0 }.into());
        bench::run_with_host(&mut rig, 200_000);
        assert!(rig.starts_anew, "{request:?}: {:?}", bench::listed(&mut rig, 0));
    }
}

#[test]
fn an_image_is_not_sent_while_the_e_stop_is_latched() {
    let mut rig = rig(FoundImage::Kept);
    begin(&mut rig);
    assert!(store(&mut rig, write(0, 128), Ok(())).is_ok());
    assert!(store(&mut rig, write(128, 32), Ok(())).is_ok());
    rig.send(&requests::EStop {}.into());
    bench::run_with_host(&mut rig, 200_000);
    for request in [announced().into(), finish()] {
        assert_eq!(rig.ask(request), Err(Error::EStopped {}));
    }
}

#[test]
fn the_bootloader_of_the_chip_takes_no_board_that_takes_signed_images_or_exchanges_some() {
    let mut at_rest = rig(FoundImage::Kept);
    assert!(at_rest.gateway.may_detach());
    bench::arm(&mut at_rest);
    assert!(!at_rest.gateway.may_detach(), "armed");
    assert!(!rig(FoundImage::OnTrial).gateway.may_detach());
    let mut latched = rig(FoundImage::Kept);
    bench::e_stop(&mut latched);
    assert!(!latched.gateway.may_detach(), "another image may not know that");
    assert!(!finished().gateway.may_detach());
    let mut signed = rig(FoundImage::Kept);
    let (now, found) = (signed.now(), FoundImage::Kept);
    let images = Images { version: RUNS, room: ROOM, needs_signature: true, found };
    signed.gateway.set_images(now, images);
    assert!(!signed.gateway.may_detach());
}

#[test]
fn on_trial_nothing_is_armed_stored_or_sent_until_it_is_confirmed() {
    let mut rig = rig(FoundImage::OnTrial);
    begin_is_refused(&mut rig);
    let ImageState::OnTrial { left_ms } = state(&mut rig).state else { panic!("on trial") };
    assert!((59_000..=60_000).contains(&left_ms), "{left_ms}");
    // What only reads is free.
    let protocols = ProtocolSet::of(&[Protocol::Rmd]);
    let (bus, bitrate, reply_window_us) = (1, 500_000, 5_000);
    let mode = BusMode::ListenOnly;
    let open = requests::RawOpenAt { bus, bitrate, protocols, reply_window_us, mode };
    assert!(rig.ask(open.into()).is_ok());
    assert!(rig.ask(requests::RawClose { bus }.into()).is_ok());

    // The flash does not take the confirmation: it can be asked for again.
    let confirm = || requests::ConfirmImage {}.into();
    let failed = store(&mut rig, confirm(), Err(SaveError::Failed));
    assert_eq!(failed, Err(Error::ImageNotWritten {}));
    begin_is_refused(&mut rig);
    assert!(matches!(store(&mut rig, confirm(), Ok(())), Ok(Reply::ConfirmImage(_))));
    assert_eq!(state(&mut rig).state, ImageState::Kept);
    assert_eq!(rig.ask(confirm()), Err(Error::NoImageOnTrial {}));
    bench::arm(&mut rig);
    let later = rig.now() + Duration::from_millis(120_000);
    assert!(!restarts(&mut rig, later), "it is kept");
}

fn begin_is_refused(rig: &mut Rig) {
    let together = requests::ArmTogether { axes: 1 };
    let raw = requests::RawOpen { bus: 1, unsafe_access: true };
    for request in [
        arm(),
        together.into(),
        raw.into(),
        requests::SaveConfiguration {}.into(),
        requests::ForgetStored {}.into(),
        announced().into(),
        write(0, 32),
        finish(),
    ] {
        assert_eq!(rig.ask(request.clone()), Err(Error::ImageOnTrial {}), "{request:?}");
    }
}

#[test]
fn a_trial_ends_after_60_s_and_not_while_its_confirmation_is_being_stored() {
    let mut rig = bench::rmd_axes(1);
    let (found, begun) = (FoundImage::OnTrial, rig.now());
    let images = Images { version: RUNS, room: ROOM, needs_signature: true, found };
    rig.gateway.set_images(begun, images);
    let end = begun + Duration::from_millis(60_000);
    let mut other = rig.gateway.clone();
    assert!(!other.handle(just_before(end), Event::Tick, &mut |_, _| {}).restart);
    assert!(other.handle(end, Event::Tick, &mut |_, _| {}).restart);

    rig.send(&requests::ConfirmImage {}.into());
    rig.run(1_000);
    assert_eq!(rig.gateway.take_save(), Some(Save::Image(ImageJob::Confirm)));
    assert!(!restarts(&mut rig, end), "its flash is being written");
    let failed = Event::Saved { result: Err(SaveError::Failed) };
    assert!(rig.gateway.handle(end, failed, &mut |_, _| {}).restart, "it was not confirmed");
}

#[test]
fn a_trial_does_not_end_while_something_is_stopped_or_latched() {
    let mut rig = rig(FoundImage::OnTrial);
    rig.run(1_000);
    let end = rig.now() + Duration::from_millis(61_000);
    let ends = |gateway: &Gateway| {
        let mut gateway = gateway.clone();
        // The host has been silent until then.
        gateway.handle(just_before(end), Event::Tick, &mut |_, _| {});
        gateway.handle(end, Event::Tick, &mut |_, _| {}).restart
    };
    assert!(ends(&rig.gateway));
    // In the same instant, before a frame of it has left.
    let mut frame = [0; MAX_FRAME];
    let stop: Request = requests::Stop { target: StopTarget::All }.into();
    let length = stop.encode_frame(1, &mut frame).unwrap();
    let asked = Event::HostBytes { link: 0, bytes: &frame[..length] };
    assert!(!rig.gateway.clone().handle(end, asked, &mut |_, _| {}).restart);

    bench::e_stop(&mut rig);
    bench::run_with_host(&mut rig, 500_000);
    assert!(!ends(&rig.gateway), "latched");
    rig.ask(requests::Clear { target: ClearTarget::Gateway }.into()).unwrap();
    assert!(ends(&rig.gateway));

    rig.instead(|_| Instead::Nothing);
    bench::stop(&mut rig);
    bench::run_with_host(&mut rig, 2_000_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    assert!(!ends(&rig.gateway), "its motor may be turning");
}

fn just_before(at: Instant) -> Instant {
    Instant::from_micros(at.as_micros() - 1)
}

#[test]
fn an_image_that_was_not_confirmed_is_told() {
    let mut rig = rig(FoundImage::RolledBack);
    assert_eq!(state(&mut rig).state, ImageState::RolledBack);
    begin(&mut rig);
    bench::arm(&mut rig);
}

#[test]
fn questions_put_off_no_start_into_another_image() {
    let mut rig = rig(FoundImage::Kept);
    begin(&mut rig);
    for (offset, length) in [(0, 128), (128, 32)] {
        assert!(store(&mut rig, write(offset, length), Ok(())).is_ok());
    }
    assert!(matches!(store(&mut rig, finish(), Ok(())), Ok(Reply::FinishImage(_))));
    rig.instead(|_| Instead::Nothing);
    rig.send_as(1, &requests::ReadState { axis: 0 }.into());
    rig.run(1_000);
    let later = rig.now() + Duration::from_millis(100);
    assert!(restarts(&mut rig, later));
}
