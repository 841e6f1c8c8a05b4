//! Another firmware on a simulated board: what runs after a start, an end of the trial, a reset in
//! it.

use firmware_image::{CHECKSUM, FirmwareVersion, Header, NO_KEY};
use host_protocol::{BootReason, Error, ImageState};
use mgw_client::ClientError;
use mgw_sim::images::{ImageSlots, image};
use mgw_sim::{BOARD, Wiring};

use crate::four_motors::Rig;

const NEWER: FirmwareVersion = FirmwareVersion { major: 0, minor: 9, patch: 0 };

/// A gateway that was sent another firmware, with which it is about to start.
fn sent() -> Rig {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.world.borrow_mut().set_images(ImageSlots::new(&BOARD));
    rig.client.reconnect().unwrap();
    let image = image(&Header::new(NEWER, BOARD.name, NO_KEY), &[7; 1_000]);
    let (length, checksum) = (u32::try_from(image.len()).unwrap(), CHECKSUM.checksum(&image));
    rig.client.begin_image(BOARD.name, NEWER, length, checksum, false).unwrap();
    for (offset, bytes) in (0u32..).step_by(128).zip(image.chunks(128)) {
        rig.client.write_image(offset, bytes).unwrap();
    }
    rig.client.finish_image(&[]).unwrap();
    assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::Kept));
    rig
}

fn runs(rig: &mut Rig) -> (String, ImageState) {
    let report = rig.client.image().unwrap();
    assert_eq!(rig.client.hello().firmware.as_str(), report.version.to_string());
    (report.version.to_string(), report.state)
}

fn starts(rig: &mut Rig, boot: BootReason) {
    rig.world.borrow_mut().reset(boot, "");
    rig.silence(200);
    rig.client.reconnect().unwrap();
}

/// The same after that start: it runs on trial.
fn on_trial() -> Rig {
    let mut rig = sent();
    rig.silence(500);
    rig.client.reconnect().unwrap();
    assert_eq!(rig.client.hello().boot, BootReason::Software);
    let (version, state) = runs(&mut rig);
    assert_eq!(version, "0.9.0");
    assert!(matches!(state, ImageState::OnTrial { .. }), "{state:?}");
    let refused = rig.client.arm(0).unwrap_err();
    assert!(matches!(refused, ClientError::Gateway(Error::ImageOnTrial {})), "{refused:?}");
    rig
}

#[test]
fn what_is_confirmed_stays_over_every_start() {
    let mut rig = on_trial();
    rig.client.confirm_image().unwrap();
    for boot in [BootReason::Watchdog, BootReason::PowerOn, BootReason::Pin] {
        starts(&mut rig, boot);
        assert_eq!(runs(&mut rig), ("0.9.0".to_owned(), ImageState::Kept));
    }
    rig.silence(61_000);
    assert_eq!(runs(&mut rig), ("0.9.0".to_owned(), ImageState::Kept));
}

#[test]
fn what_nobody_confirms_in_60_s_is_taken_back() {
    let mut rig = on_trial();
    rig.silence(59_000);
    assert_eq!(runs(&mut rig).0, "0.9.0");
    rig.silence(1_500);
    rig.client.reconnect().unwrap();
    assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::RolledBack));
    // It stays so.
    starts(&mut rig, BootReason::PowerOn);
    assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::RolledBack));
}

#[test]
fn a_new_firmware_that_does_not_last_is_taken_back() {
    for boot in [BootReason::Watchdog, BootReason::PowerOn, BootReason::Pin] {
        let mut rig = on_trial();
        starts(&mut rig, boot);
        assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::RolledBack), "{boot:?}");
    }
}

#[test]
fn what_was_sent_in_part_never_runs() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.world.borrow_mut().set_images(ImageSlots::new(&BOARD));
    rig.client.reconnect().unwrap();
    rig.client.begin_image(BOARD.name, NEWER, 256, 0, false).unwrap();
    rig.client.write_image(0, &[1; 128]).unwrap();
    starts(&mut rig, BootReason::Watchdog);
    assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::Kept));
    let refused = rig.client.write_image(128, &[1; 128]).unwrap_err();
    assert!(matches!(refused, ClientError::Gateway(Error::ImageIncomplete { missing: 0 })));
    // What is not the image that was announced neither.
    rig.client.begin_image(BOARD.name, NEWER, 128, 0, false).unwrap();
    rig.client.write_image(0, &[1; 128]).unwrap();
    let refused = rig.client.finish_image(&[]).unwrap_err();
    assert!(matches!(refused, ClientError::Gateway(Error::ImageDamaged {})), "{refused:?}");
    starts(&mut rig, BootReason::Watchdog);
    assert_eq!(runs(&mut rig), ("0.1.0".to_owned(), ImageState::Kept));
}
