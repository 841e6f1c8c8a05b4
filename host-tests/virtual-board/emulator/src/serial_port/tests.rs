//! The port, driven through its registers as the firmware's drivers do.

use std::collections::VecDeque;

use rigless::mcu::Operate;
use serde::{Deserialize, Serialize};

use super::bench::{BRR_115200, Bench, ON};
use super::*;

/// Offers words, each with or without damage.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Talker {
    words: VecDeque<(u16, bool)>,
    damages: bool,
    settings: Settings,
    restarts: u32,
}

store!(Talker);

impl Talker {
    fn on_a_port() -> SerialPort {
        let mut port = SerialPort::new();
        port.attach(Self::default());
        port
    }
}

impl Bench {
    /// The interrupt's level, as last driven.
    fn interrupt(&mut self) -> Option<Level> {
        self.part.drain_interrupts().last().map(|change| change.level)
    }

    /// Lets the far end say these words now, one after the other.
    fn say(&mut self, words: &[(u16, bool)]) {
        self.part.model.peer_mut::<Talker>().expect("a talker").words.extend(words);
    }
}

impl Peer for Talker {
    fn receive(&mut self, _word: u16, _context: &mut Timeline<'_, '_>) {}

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        let (word, damages) = self.words.pop_front()?;
        self.damages = damages;
        Some(word)
    }

    fn restarted(&mut self, _context: &mut Timeline<'_, '_>) {
        self.restarts += 1;
    }
}

impl FarEnd for Talker {
    fn port_set_up(&mut self, settings: Settings) {
        self.settings = settings;
    }

    fn damages(&mut self) -> bool {
        self.damages
    }
}

#[test]
fn the_far_end_learns_rate_and_driver_enable() {
    let mut bench = Bench::new(Talker::on_a_port());
    bench.write(Register::Brr, BRR_115200);
    // One bit of lead and of tail, as the firmware sets them.
    bench.write(Register::Cr3, cr3::DEM.mask());
    bench.write(Register::Cr1, ON | cr1::DEAT4.mask() | cr1::DEDT4.mask());
    let settings = bench.part.model.peer_mut::<Talker>().unwrap().settings;
    let driver_enable = DriverEnable { assertion: 16, deassertion: 16, active_low: false };
    assert_eq!(settings, Settings { bit_ps: 8_680_000, driver_enable: Some(driver_enable) });
    assert_eq!(settings.bits_per_second(), 115_207);
    bench.write(Register::Cr1, 0);
    assert_eq!(bench.part.model.peer_mut::<Talker>().unwrap().settings, Settings::default());
}

/// USARTDIV 0x198 is BRR 0x194 with OVER8, whose lowest nibble is shifted right: 0x198 / 2 = 204
/// clocks a bit.
#[test]
fn oversampling_by_8_and_the_prescaler_count() {
    let mut bench = Bench::new(Talker::on_a_port());
    bench.write(Register::Brr, 0x0194);
    bench.write(Register::Presc, 1);
    bench.write(Register::Cr1, ON | cr1::OVER8.mask());
    // Divided by 2: 408 clocks of 10 ns.
    assert_eq!(bench.part.model.settings().bit_ps, 4_080_000);
}

#[test]
fn the_delimiter_raises_the_flag_and_the_interrupt_until_it_is_cleared() {
    let mut bench = Bench::switched_on(Talker::on_a_port(), BRR_115200, cr1::CMIE.mask());
    assert_eq!(bench.interrupt(), None);
    bench.say(&[(0x41, false), (0x00, false), (0x42, false)]);
    let mut seen = Vec::new();
    for _ in 0..3 {
        bench.run(90_000);
        bench.take_words();
        seen.push((isr::CMF.is_set(bench.read(Register::Isr)), bench.interrupt()));
        bench.write(Register::Icr, icr::CMCF.mask());
        assert!(!isr::CMF.is_set(bench.read(Register::Isr)));
    }
    assert_eq!(seen.iter().map(|(flag, _)| *flag).collect::<Vec<_>>(), [false, true, false]);
    assert_eq!(seen[1].1, Some(Level::High));
    assert_eq!(seen[2].1, Some(Level::Low), "cleared since");
}

#[test]
fn without_its_enable_the_flag_raises_no_interrupt() {
    let mut bench = Bench::switched_on(Talker::on_a_port(), BRR_115200, 0);
    bench.say(&[(0x00, false)]);
    bench.run(90_000);
    bench.take_words();
    assert!(isr::CMF.is_set(bench.read(Register::Isr)));
    assert_eq!(bench.interrupt(), None);
}

/// Clearing the flag must not lower the interrupt under the feet of another source.
#[test]
fn the_interrupt_stays_up_for_another_source() {
    let control = cr1::CMIE.mask() | cr1::TCIE.mask();
    let mut bench = Bench::switched_on(Talker::on_a_port(), BRR_115200, control);
    bench.say(&[(0x00, false)]);
    bench.run(90_000);
    bench.take_words();
    bench.write(Register::Icr, icr::CMCF.mask());
    assert_eq!(bench.interrupt(), Some(Level::High), "transmission is complete");
}

#[test]
fn only_the_word_that_the_far_end_damages_has_a_framing_error() {
    let mut bench = Bench::switched_on(Talker::on_a_port(), BRR_115200, 0);
    bench.say(&[(0x41, false), (0x42, true), (0x43, false)]);
    let mut seen = Vec::new();
    for _ in 0..3 {
        bench.run(87_000);
        let damaged = isr::FE.is_set(bench.read(Register::Isr));
        seen.extend(bench.take_words().into_iter().map(|word| (word, damaged)));
        bench.write(Register::Icr, icr::FECF.mask());
    }
    let [(0x41, false), (garbled, true), (0x43, false)] = seen[..] else { panic!("{seen:02X?}") };
    assert_ne!(garbled, 0x42);
}

#[test]
fn the_far_end_hears_of_a_reset_of_the_port_alone() {
    let mut bench = Bench::switched_on(Talker::on_a_port(), BRR_115200, 0);
    bench.drive(|port, registers, context| {
        registers.reset();
        port.reset_line(registers, context);
    });
    let talker = bench.part.model.peer_mut::<Talker>().unwrap();
    assert_eq!((talker.restarts, talker.settings), (1, Settings::default()));
}
