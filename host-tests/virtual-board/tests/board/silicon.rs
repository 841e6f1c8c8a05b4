//! What the emulator's own part hides: revisions of the chip, starts by the ROM, and what the drivers get wrong on this part.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{BusLimit, Bytes, CanFrame, Protocol, ProtocolSet, RawFrame};
use mgw_client::{Client, ClientError};
use rigless::chip::can::{Frame, Id, Offer, Pattern};
use rigless::device::Level;
use rigless::emulator::Watch;
use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::soc::stm32h743::generated::rcc::{Register as Clocks, ahb1enr, ahb1lpenr};
use rigless::time::VirtualNanos;
use virtual_board::host_uart::HostUart;
use virtual_board::machine::{Builder, CanNode, CanPort, Fault, Machine, Place, UartPort};
use virtual_board::transport::BoardTransport;
use virtual_stm32::crs::Source;
use virtual_stm32::fdcan::Wiring;
use virtual_stm32::revision::Revision;

use crate::dma;
use crate::lab::{Lab, RMD, RMD_RS485};
use crate::log;

const BITRATE: u32 = 1_000_000;
/// The RAM that revision Y reads wrong unless it is told otherwise.
const AXI_SRAM: Watch = Watch::Writes { address: 0x2400_0000, length: 512 << 10 };
/// The buffers of DMA lie there, the data behind the stack in the DTCM.
const DMA_REGION: std::ops::Range<u32> = 0x2400_0000..0x2408_0000;
const DATA: std::ops::Range<u64> = 0x2000_C000..0x2002_0000;
/// Of the stack, where it never reaches.
const IN_DTCM: u32 = 0x2000_0100;
/// More than the start takes, USB included.
const START: Duration = Duration::from_millis(60);

/// A board with a node on bus 0 and a computer on host link 0.
struct Bench {
    machine: Rc<RefCell<Machine>>,
    node: CanNode<Pattern>,
    client: Client<BoardTransport>,
}

impl Bench {
    fn of(mut builder: Builder) -> Self {
        let node = builder.can_node(CanPort::Bus0, Pattern::default(), Some(BITRATE));
        let host = builder.line(UartPort::Host0, HostUart::new());
        let machine = Rc::new(RefCell::new(builder.power_on()));
        let client = Client::connect_as(BoardTransport::new(&machine, host), 1, 1).expect("hello");
        Self { machine, node, client }
    }

    fn configure(&mut self, bus: u8) -> Result<(), ClientError> {
        let protocols = ProtocolSet::of(&[Protocol::Rmd]);
        self.client.configure_bus(bus, BITRATE, protocols, false, Duration::from_millis(5))
    }

    /// How many of a hundred frames on bus 0 arrive with another id or other data.
    fn wrong_frames(&mut self) -> usize {
        self.client.raw_open_unsafe(0).expect("open");
        let mut wrong = 0;
        for number in 0..100 {
            let data = [number, !number, 3, 4, 5, 6, 7, 8];
            {
                let mut machine = self.machine.borrow_mut();
                let since = VirtualNanos(u64::try_from(machine.now().as_nanos()).expect("small"));
                let frame = Frame::data_frame(Id::Standard(0x241), &data);
                machine.node(self.node).queue(Offer { since, frame, fault: None });
                machine.run_for(Duration::from_millis(1));
            }
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
    let offered: Vec<bool> = bench.client.hello().buses.iter().map(|bus| !bus.bitrates.is_empty()).collect();
    assert_eq!(offered, [true, false, true]);
    assert_eq!(bench.client.gateway_status().expect("a status").bus_limit, Some(BusLimit::ChipRevision));
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
        let set = machine.part().h743().interconnect.sram_set().unwrap_or_else(|| panic!("{start}: not set"));
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

/// DMA1 and DMA2 do not reach the DTCM (RM0433 2.1.6), and the driver panics at their error: a buffer in the wrong place ends the run.
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
fn a_start_by_the_rom_bootloader_runs_with_its_own_vector_table() {
    let bench = Bench::of(Machine::builder().started_by_rom());
    bench.machine.borrow_mut().run_for(START);
    let resets = bench.machine.borrow_mut().reports().resets;
    assert!(resets.is_empty(), "{resets:?}");
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
    assert!(lines.iter().any(|line| line.starts_with("INFO host link 2: USB, serial number")), "{lines:?}");
    let clocks = machine.part().bus().registers("RCC").expect("the part has one");
    assert!(!ahb1enr::USB2OTGHSULPIEN.is_set(clocks.get(Clocks::Ahb1enr)));
    assert!(!ahb1lpenr::USB2OTGHSULPILPEN.is_set(clocks.get(Clocks::Ahb1lpenr)));
}

/// DMA1's control registers of the streams that take what host link 1 and the RS485 line hear.
const HOST_1_STREAM: u64 = 0x4002_0040;
const RS485_STREAM: u64 = 0x4002_0070;

/// Whether a DMA stream is enabled.
fn runs(machine: &mut Machine, stream: u64) -> bool {
    let at = VirtualNanos(u64::try_from(machine.now().as_nanos()).expect("small"));
    machine.part_mut().read(at, stream, Width::W32).expect("a register") & 1 == 1
}

/// Has a DMA stream take nothing any more, as one of revision Y can lock (ES0392, "DMA stream locked…").
fn lock(machine: &mut Machine, stream: u64) {
    let at = VirtualNanos(u64::try_from(machine.now().as_nanos()).expect("small"));
    let part = machine.part_mut();
    let control = part.read(at, stream, Width::W32).expect("a register");
    assert_eq!(control & 1, 1, "it runs");
    part.write(at, stream, Width::W32, control & !1).expect("a register");
}

/// Asks the motor on RS485 for its speed.
fn ask_motor(lab: &mut Lab) -> bool {
    let read: Bytes<8> = [0x9C, 0, 0, 0, 0, 0, 0, 0].into_iter().collect();
    lab.client.native(RMD_RS485, 0, read, Duration::from_millis(100)).is_ok()
}

#[test]
fn a_receive_ring_of_a_host_link_that_locks_starts_again() {
    let mut lab = Lab::configured();
    let mut second = lab.second_client();
    lock(&mut lab.machine.borrow_mut(), HOST_1_STREAM);
    let host = lab.outside.hosts[1];
    // More than the receiver's FIFO holds.
    lab.machine.borrow_mut().line(host).send(&[1; 40]);
    lab.run_for(Duration::from_millis(50));
    second.gateway_status().expect("heard again");
    assert!(runs(&mut lab.machine.borrow_mut(), HOST_1_STREAM));
    assert_eq!(lab.report(RMD).trip, None);
}

#[test]
fn a_receive_ring_of_rs485_that_locks_starts_again() {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("free");
    assert!(ask_motor(&mut lab));
    lock(&mut lab.machine.borrow_mut(), RS485_STREAM);
    // The frame that is not heard back is sent again, and by then the ring is a new one.
    let answered = (0..3).filter(|_| ask_motor(&mut lab)).count();
    assert!(answered >= 2, "{answered} of 3");
    assert!(runs(&mut lab.machine.borrow_mut(), RS485_STREAM));
}

#[test]
fn frames_that_come_back_to_back_are_all_taken() {
    // An interrupt takes longer than a frame: it must take what came meanwhile.
    let mut bench = Bench::of(Machine::builder().instructions_per_second(10_000_000));
    bench.configure(0).expect("bus 0 runs");
    bench.client.raw_open_unsafe(0).expect("open");
    for burst in 0..10u8 {
        let mut machine = bench.machine.borrow_mut();
        let since = VirtualNanos(u64::try_from(machine.now().as_nanos()).expect("small"));
        // As many as its FIFO holds.
        for number in 0..3 {
            let frame = Frame::data_frame(Id::Standard(0x241), &[burst, number]);
            machine.node(bench.node).queue(Offer { since, frame, fault: None });
        }
        machine.run_for(Duration::from_millis(20));
    }
    let status = bench.client.bus_status(0).expect("a status");
    assert_eq!((status.counters.received, status.counters.receive_overflows), (30, 0));
}

/// Behind bus-off a controller joins again when the line has been recessive for 129 times 11 bits, whether the block was reset with
/// it or not, as while the other bus runs: the pause before the restart is longer at every bitrate.
#[test]
fn a_bus_that_was_off_stays_away_for_129_times_11_bits_whatever_the_other_does() {
    for other_runs in [false, true] {
        let mut bench = Bench::of(Machine::builder());
        let protocols = ProtocolSet::of(&[Protocol::Rmd]);
        let slow = 50_000;
        bench.client.configure_bus(0, slow, protocols, false, Duration::from_millis(5)).expect("bus 0 runs");
        if other_runs {
            bench.configure(1).expect("bus 1 runs");
        }
        bench.client.raw_open_unsafe(0).expect("open");
        bench.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
        let frame = CanFrame::standard(0x141, &[1]).expect("a frame");
        bench.client.raw_send(0, RawFrame::Can(frame)).expect("taken over");
        let mut machine = bench.machine.borrow_mut();
        let off = |machine: &mut Machine| !machine.can(CanPort::Bus0).is_on_bus();
        assert!(machine.run_until(Duration::from_millis(500), off), "off");
        machine.wire_can(CanPort::Bus0, Wiring::Connected);
        let at = machine.now();
        let on = |machine: &mut Machine| machine.can(CanPort::Bus0).is_on_bus();
        assert!(machine.run_until(Duration::from_millis(500), on), "on again");
        let away = machine.now() - at;
        assert!(away >= Duration::from_secs_f64(129.0 * 11.0 / f64::from(slow)), "{away:?}");
    }
}

/// What takes over the configuration of a bus: at a start only where there is one.
const TAKES_CONFIGURATION: &str =
    "gateway::configure::_$LT$impl$u20$gateway..gateway..Gateway$GT$::configure_bus";
/// Starts that fail before one goes without configuration.
const FAILED_STARTS: usize = 5;

#[test]
fn a_fault_that_comes_back_at_each_start_ends_in_a_run_without_configuration() {
    let mut lab = Lab::configured();
    {
        let mut machine = lab.machine.borrow_mut();
        machine.plant(Place::Function(TAKES_CONFIGURATION), &Fault::HardFault);
        machine.reset_by_pin();
        machine.run_for(Duration::from_millis(500));
        assert_eq!(machine.reports().resets.len(), 1 + FAILED_STARTS);
        assert_eq!(machine.enable_output().driven(), Some(Level::Low), "whoever may turn is not known");
    }
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.list_axes().expect("a list"), []);
    let words = lab.client.last_words().expect("a text");
    assert!(
        words.starts_with("started without configuration, as start after start has failed: hard fault at"),
        "{words}"
    );
    // The pin starts the count anew; what was configured is gone.
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(START);
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.last_words().expect("a text"), "");
}
