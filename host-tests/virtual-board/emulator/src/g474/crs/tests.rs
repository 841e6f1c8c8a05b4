use rigless::mcu::Operate;
use rigless::soc::Width;

use super::*;
use crate::g474::Stm32g474;

const CR: u64 = 0x4000_2000;
const CFGR: u64 = 0x4000_2004;
const ISR: u64 = 0x4000_2008;
const ICR: u64 = 0x4000_200C;
const RCC_APB1ENR1: u64 = 0x4002_1058;
const CRSEN: u64 = 1 << 8;

fn part(error_ppm: i64) -> Stm32g474 {
    let mut part = Stm32g474::new().expect("a part");
    part.crs.set_error(error_ppm);
    write(&mut part, RCC_APB1ENR1, CRSEN);
    write(&mut part, CR, 0x4000 | CEN | AUTOTRIMEN);
    part
}

fn write(part: &mut Stm32g474, address: u64, value: u64) {
    part.write(VirtualNanos(0), address, Width::W32, value).expect("a register");
}

fn read(part: &mut Stm32g474, address: u64) -> u64 {
    part.read(VirtualNanos(0), address, Width::W32).expect("a register")
}

/// A frame starts at that instant.
fn frame(part: &mut Stm32g474, at: u64) {
    let slot = part.bus.slot(NAME).expect("it is there");
    let (registers, mut context) = part.bus.drive(VirtualNanos(at), slot);
    let request =
        RequestChange { instance: usb::NAME, request: usb::START_OF_FRAME, level: Level::High };
    part.crs.on_request(request, registers, &mut context);
}

#[test]
fn its_registers_are_as_described() {
    let mut part = Stm32g474::new().expect("a part");
    write(&mut part, RCC_APB1ENR1, CRSEN);
    assert_eq!([read(&mut part, CR), read(&mut part, CFGR)], [0x4000, 0x2022_BB7F]);
    let table = tables::named(NAME).registers;
    let bits = |register, name| tables::field(table, register, name).mask();
    assert_eq!(
        [bits("CR", "CEN"), bits("CR", "AUTOTRIMEN"), bits("CR", "SWSYNC")],
        [CEN, AUTOTRIMEN, SWSYNC]
    );
    assert_eq!(bits("CR", "TRIM") | TRIM_6.mask(), TRIM);
    assert_eq!(bits("CFGR", "SYNCSRC") | bits("CFGR", "SYNCDIV"), SYNCSRC_AND_DIV);
    let flags =
        ["SYNCOKF", "SYNCWARNF", "ERRF", "ESYNCF", "SYNCERR", "SYNCMISS", "TRIMOVF", "FEDIR"];
    let mine = [SYNCOKF, SYNCWARNF, ERRF, ESYNCF, SYNCERR, SYNCMISS, TRIMOVF, FEDIR];
    assert_eq!(flags.map(|name| bits("ISR", name)), mine);
    assert_eq!(bits("ISR", "FECAP"), 0xFFFF << FECAP_SHIFT);
}

/// Millionths off, then what a frame finds and does: 48 counts are a thousandth.
#[test]
fn a_frame_trims_by_none_one_or_two_steps() {
    for (error, flag, captured, trim) in [
        (0, SYNCOKF, 0, 64),
        (700, SYNCOKF, 33, 64),
        (800, SYNCOKF, 38, 63),
        (-800, SYNCOKF | FEDIR, 39, 65),
        (2_200, SYNCWARNF, 105, 62),
        (-2_200, SYNCWARNF | FEDIR, 106, 66),
        (95_000, ERRF | SYNCMISS, 4_560, 64),
        (-95_000, ERRF | SYNCERR | FEDIR, 4_560, 64),
    ] {
        let mut part = part(error);
        frame(&mut part, 0);
        assert_eq!(read(&mut part, ISR), 0, "the first frame has nothing to be compared with");
        frame(&mut part, 1_000_000);
        let status = read(&mut part, ISR);
        assert_eq!(status & !ESYNCF, flag | captured << FECAP_SHIFT, "{error}");
        assert_eq!(read(&mut part, CR) >> TRIM_SHIFT, trim, "{error}");
        write(&mut part, ICR, 0xF);
        assert_eq!(read(&mut part, ISR) & 0xFFFF & !FEDIR, 0);
    }
}

#[test]
fn a_frame_that_is_missing_trims_nothing() {
    let mut part = part(0);
    frame(&mut part, 0);
    frame(&mut part, 2_000_000);
    assert_eq!(read(&mut part, ISR) & (ERRF | SYNCMISS), ERRF | SYNCMISS);
    assert_eq!(read(&mut part, CR) >> TRIM_SHIFT, 64);
}

/// 64 steps of 0.14 % are 8.96 %.
#[test]
fn trimming_ends_at_its_limit() {
    for (error, overflow) in [(90_000, 0), (90_600, ERRF | TRIMOVF)] {
        let mut part = part(error);
        for millisecond in 0..40 {
            frame(&mut part, millisecond * 1_000_000);
        }
        assert_eq!(read(&mut part, CR) >> TRIM_SHIFT, 0);
        assert_eq!(read(&mut part, ISR) & (ERRF | TRIMOVF), overflow, "{error}");
    }
}
