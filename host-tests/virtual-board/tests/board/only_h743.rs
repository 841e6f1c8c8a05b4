//! What only the STM32H743 has: revisions, a RAM that DMA does not reach, a USB controller with two
//! ways out.

use std::ops::Range;
use std::time::Duration;

use host_protocol::{BusLimit, CanFrame, RawFrame};
use mgw_client::ClientError;
use rigless::emulator::Watch;
use rigless::soc::stm32h743::generated::rcc::{Register as Clocks, ahb1enr, ahb1lpenr};
use virtual_board::machine::{CanPort, Machine};
use virtual_stm32::crs::Source;
use virtual_stm32::revision::Revision;

use crate::bench::{Bench, data_frame};
use crate::dma;
use crate::log;
use crate::silicon::START;

/// The RAM that revision Y reads wrong unless it is told otherwise.
const AXI_SRAM: Watch = Watch::Writes { address: 0x2400_0000, length: 512 << 10 };
/// The buffers of DMA lie there, the data behind the stack in the DTCM.
const DMA_REGION: Range<u32> = 0x2400_0000..0x2404_0000;
const DATA: Range<u64> = 0x2000_C000..0x2002_0000;
/// Of the stack, where it never reaches.
const IN_DTCM: u32 = 0x2000_0100;

impl Bench {
    /// How many of a hundred frames on bus 0 arrive with another id or other data.
    fn wrong_frames(&mut self) -> usize {
        self.client.raw_open_unsafe(0).expect("open");
        let mut wrong = 0;
        for number in 0..100 {
            let data = [number, !number, 3, 4, 5, 6, 7, 8];
            self.offer([data_frame(0x241, &data)]);
            self.run_for(Duration::from_millis(1));
            let sent = RawFrame::Can(CanFrame::standard(0x241, &data).expect("a frame"));
            let received = self.client.raw_receive(0).expect("frames").frames;
            assert_eq!(received.len(), 1, "frame {number}");
            wrong += received.iter().filter(|received| received.frame != sent).count();
        }
        wrong
    }

    fn is_on_bus(&self, port: CanPort) -> bool {
        self.machine.borrow().can(port).is_on_bus()
    }

    fn wrong_reads(&self) -> u64 {
        self.machine.borrow().part().h743().window.wrong_reads()
    }
}

#[test]
fn revision_y_offers_one_can_bus_and_says_why() {
    let mut bench = Bench::of(Machine::builder().revision(Revision::Y));
    let offered: Vec<bool> =
        bench.client.hello().buses.iter().map(|bus| !bus.bitrates.is_empty()).collect();
    assert_eq!(offered, [true, false, true]);
    assert_eq!(
        bench.client.gateway_status().expect("a status").bus_limit,
        Some(BusLimit::ChipRevision)
    );
    bench.configure(0).expect("bus 0 runs");
    assert!(matches!(bench.configure(1), Err(ClientError::Gateway(_))), "bus 1 is refused");
    assert_eq!(bench.wrong_frames(), 0);
    assert!(bench.is_on_bus(CanPort::Bus0) && !bench.is_on_bus(CanPort::Bus1));
    assert_eq!(bench.wrong_reads(), 0);
    let lines = log::take(&mut bench.machine.borrow_mut());
    let line = "ERROR bus 1 is off: a chip of revision 0x1003 can read wrong frames with two";
    assert!(lines.iter().any(|logged| logged == line), "{lines:?}");
}

#[test]
fn revisions_x_and_v_offer_both_can_buses() {
    for revision in [Revision::X, Revision::V] {
        let mut bench = Bench::of(Machine::builder().revision(revision));
        assert_eq!(bench.client.gateway_status().expect("a status").bus_limit, None);
        bench.configure(0).expect("bus 0 runs");
        bench.configure(1).expect("bus 1 runs");
        assert_eq!(bench.wrong_frames(), 0, "{revision:?}");
        assert!(bench.is_on_bus(CanPort::Bus1));
    }
}

/// What the limit is for: with the chip in disguise both run.
#[test]
fn two_can_buses_on_revision_y_would_give_wrong_frames() {
    let mut bench = Bench::of(Machine::builder().disguised(Revision::Y, Revision::V));
    bench.configure(0).expect("bus 0 runs");
    assert_eq!(bench.wrong_frames(), 0, "one alone is right");
    bench.client.raw_close(0).expect("closed");
    bench.configure(1).expect("bus 1 runs");
    assert!(bench.wrong_frames() > 0);
    assert!(bench.wrong_reads() > 0);
}

#[test]
fn the_ram_of_revision_y_is_set_before_it_is_used_after_every_reset() {
    let mut machine = Machine::builder().revision(Revision::Y).power_on();
    for start in ["power", "pin"] {
        machine.watch(AXI_SRAM);
        machine.run_for(START);
        machine.unwatch(AXI_SRAM);
        let set = machine
            .part()
            .h743()
            .interconnect
            .sram_set()
            .unwrap_or_else(|| panic!("{start}: not set"));
        let used = machine.take_hits().first().unwrap_or_else(|| panic!("{start}: not used")).at;
        assert!(set < used, "{start}: set at {set:?}, used at {used:?}");
        machine.reset_by_pin();
        machine.run_for(Duration::ZERO);
    }
}

#[test]
fn the_ram_of_revision_v_is_left_as_it_is() {
    let mut machine = Machine::builder().revision(Revision::V).power_on();
    machine.run_for(START);
    assert_eq!(machine.part().h743().interconnect.sram_set(), None);
}

/// DMA1 and DMA2 do not reach the DTCM (RM0433 2.1.6), and the driver panics at their error: a
/// buffer in the wrong place ends the run.
#[test]
fn a_message_in_memory_that_dma_does_not_reach_ends_the_run() {
    let mut bench = Bench::of(Machine::builder());
    dma::misplace_messages(&mut bench.machine.borrow_mut(), DATA, DMA_REGION, IN_DTCM);
    bench.client.gateway_status().expect("the run after it answers");
    let mut machine = bench.machine.borrow_mut();
    machine.run_for(START);
    assert_eq!(machine.reports().resets.len(), 1);
    let lines = log::take(&mut machine);
    assert!(lines.iter().any(|line| line.contains("DMA: error on DMA@40020000")), "{lines:?}");
}

#[test]
fn the_clock_of_usb_is_trimmed_by_the_controller_that_has_the_pins() {
    let mut machine = Machine::builder().power_on();
    machine.run_for(START);
    assert_eq!(machine.part().h743().crs.source(), Some(Source::Usb2));
}

#[test]
fn usb_starts_without_the_clock_of_an_external_transceiver() {
    let mut machine = Machine::builder().power_on();
    machine.run_for(START);
    let lines = log::take(&mut machine);
    assert!(
        lines.iter().any(|line| line.starts_with("INFO host link 2: USB, serial number")),
        "{lines:?}"
    );
    let clocks = machine.part().bus().registers("RCC").expect("the part has one");
    assert!(!ahb1enr::USB2OTGHSULPIEN.is_set(clocks.get(Clocks::Ahb1enr)));
    assert!(!ahb1lpenr::USB2OTGHSULPILPEN.is_set(clocks.get(Clocks::Ahb1lpenr)));
}
