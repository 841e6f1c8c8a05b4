//! Reset, suspend, and the clock.

use super::bench::{Bench, EPR};
use super::*;

/// The clock that it needs; how long idle is a suspend.
const HZ: u64 = 48_000_000;
const IDLE_NANOS: u64 = 3_000_000;
/// CRS: CR and its bits.
const CRS_CR: u64 = 0x4000_2000;
const CRS_CFGR: u64 = 0x4000_2004;
const CEN_AND_AUTOTRIMEN: u64 = 0x4060;
const WORD: rigless::soc::Width = rigless::soc::Width::W32;

#[test]
fn it_shows_itself_once_it_is_on() {
    let mut bench = Bench::new();
    assert!(!bench.at_cable(|usb| usb.is_pulled_up()));
    bench.write(BCDR, DPPU);
    assert!(!bench.at_cable(|usb| usb.is_pulled_up()), "switched off");
    bench.write(CNTR, 0);
    assert!(bench.at_cable(|usb| usb.is_pulled_up()));
}

#[test]
fn a_reset_on_the_bus_forgets_address_and_endpoints() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    bench.write(DADDR, EF | 5);
    bench.at_cable(|usb| usb.out(5, 1, Toggle::Data0, &[1]));
    bench.at_cable(|usb| usb.bus_reset());
    assert!(bench.interrupt_is_up());
    assert_eq!(
        [bench.read(EPR + 4), bench.read(DADDR)],
        [CTR_RX, 0],
        "what was received stays known"
    );
    bench.write(DADDR, EF);
    bench.bulk_endpoint(1);
    let out = |usb: &mut Function<'_, '_>| usb.out(0, 1, Toggle::Data0, &[1]);
    assert_eq!(bench.at_cable(out), Handshake::NoResponse, "not before RESET is cleared");
    bench.write(ISTR, !RESET);
    assert_eq!(bench.at_cable(out), Handshake::Ack);
}

#[test]
fn held_in_reset_it_keeps_no_endpoint() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    bench.write(CNTR, FRES);
    assert_eq!(bench.read(ISTR) & RESET, RESET);
    bench.bulk_endpoint(1);
    assert_eq!(bench.read(EPR + 4), 0);
    bench.write(ISTR, 0);
    assert_eq!(bench.read(ISTR) & RESET, RESET, "as long as it is held");
}

#[test]
fn three_milliseconds_without_a_frame_are_a_suspend() {
    let mut bench = Bench::enumerated();
    bench.frames(5);
    bench.wait(1_999_999);
    assert_eq!(bench.read(ISTR) & SUSP, 0);
    bench.wait(1);
    assert_eq!(bench.read(ISTR) & SUSP, SUSP);
    assert!(bench.interrupt_is_up());
}

#[test]
fn suspended_it_takes_nothing_and_wakes_on_resume_and_reset() {
    let mut bench = Bench::enumerated();
    bench.bulk_endpoint(1);
    bench.wait(IDLE_NANOS);
    let enables = RESET | SUSP | WKUP | CTR;
    bench.write(CNTR, enables | FSUSP | LPMODE);
    bench.write(ISTR, !SUSP);
    bench.wait(10 * IDLE_NANOS);
    assert_eq!(bench.read(ISTR) & SUSP, 0, "once");
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[1])), Handshake::NoResponse);
    bench.at_cable(|usb| usb.resume());
    assert_eq!(bench.read(ISTR) & (WKUP | RESET), WKUP);
    assert_eq!(
        bench.read(CNTR),
        enables | FSUSP,
        "LPMODE is cleared at once, FSUSP by the firmware"
    );
    bench.write(CNTR, enables);
    bench.write(ISTR, 0);
    assert_eq!(bench.at_cable(|usb| usb.out(0, 1, Toggle::Data0, &[1])), Handshake::Ack);
    bench.write(CNTR, enables | FSUSP | LPMODE);
    bench.at_cable(|usb| usb.bus_reset());
    assert_eq!(bench.read(ISTR) & (WKUP | RESET), WKUP | RESET);
}

#[test]
fn an_oscillator_that_is_off_is_trimmed_by_the_frames() {
    for error in [-9_000, 9_000] {
        let mut bench = Bench::enumerated();
        bench.part.crs.set_error(error);
        bench.bulk_endpoint(1);
        bench.write_at(CRS_CR, WORD, CEN_AND_AUTOTRIMEN);
        let out = |usb: &mut Function<'_, '_>| usb.out(0, 1, Toggle::Data0, &[1]);
        assert_eq!(bench.at_cable(out), Handshake::NoResponse, "{error}");
        assert_eq!(bench.told(), ["CNTR"]);
        bench.frames(10);
        assert_eq!(bench.at_cable(out), Handshake::Ack, "{error}");
        let off = bench.part.crs.hsi48_hz().abs_diff(HZ);
        assert!(off < 100_000, "{off} Hz");
    }
}

#[test]
fn without_the_frames_of_this_controller_it_is_not() {
    // The LSE; and switched off.
    for (configuration, control) in [(0x1022_BB7F, CEN_AND_AUTOTRIMEN), (0x2022_BB7F, 0x4000)] {
        let mut bench = Bench::enumerated();
        bench.part.crs.set_error(9_000);
        bench.bulk_endpoint(1);
        bench.write_at(CRS_CFGR, WORD, configuration);
        bench.write_at(CRS_CR, WORD, control);
        bench.frames(20);
        let out = |usb: &mut Function<'_, '_>| usb.out(0, 1, Toggle::Data0, &[1]);
        assert_eq!(bench.at_cable(out), Handshake::NoResponse);
    }
}
