//! The image of the other board, the NUCLEO-G474RE, on its machine.

#[path = "../common/dma.rs"]
mod dma;
#[path = "../common/rtt.rs"]
mod rtt;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{CanFrame, Protocol, ProtocolSet, RawFrame};
use mgw_client::Client;
use rigless::chip::can::{Id, Pattern};
use rigless::device::Level;
use virtual_board::board::Board;
use virtual_board::host_uart::HostUart;
use virtual_board::machine::{Builder, CanPort, Machine, UartPort};
use virtual_board::transport::BoardTransport;
use virtual_stm32::fdcan::FrameEnd;

const BITRATE: u32 = 1_000_000;
const REPLY_WINDOW: Duration = Duration::from_millis(5);
/// Long enough for the start-up.
const STARTED: Duration = Duration::from_millis(20);
const BUSES: [CanPort; 3] = [CanPort::Bus0, CanPort::Bus1, CanPort::Bus2];

/// Registers that the firmware touches and no model answers for: settings that have no effect here.
const KEEP_WHAT_IS_WRITTEN: [&str; 9] = [
    "DBGMCU.CR",
    "FLASH.ACR",
    "FLASH.OPTR",
    "FLASH.SEC1R",
    "PWR.CR1",
    "PWR.CR3",
    "PWR.CR5",
    "SYSCFG.EXTICR1",
    "SYSCFG.MEMRMP",
];

fn image() -> PathBuf {
    std::env::var_os("MOTOR_GATEWAY_G474_ELF").expect("MOTOR_GATEWAY_G474_ELF names the image").into()
}

fn builder() -> Builder {
    Builder::of(Board::NucleoG474re, &image()).unwrap_or_else(|error| panic!("{error}"))
}

/// The lines that the firmware has logged, without their times.
fn log(machine: &mut Machine) -> Vec<String> {
    rtt::take(machine, &image())
}

#[test]
fn it_boots_and_says_so() {
    let mut machine = builder().power_on();
    machine.run_for(STARTED);
    let lines = log(&mut machine);
    let first = lines.first().unwrap_or_else(|| panic!("no log: {:#?}", machine.reports()));
    assert!(first.contains("on nucleo-g474re, started by PowerOn"), "{lines:?}");
    assert!(lines.iter().all(|line| line.starts_with("INFO")), "{lines:?}");
    assert!(machine.part().watchdog_is_started());
    let reports = machine.reports();
    assert!(reports.resets.is_empty(), "{:?}", reports.resets);
    assert!(reports.unmapped.is_empty(), "{:?}", reports.unmapped);
    assert!(reports.refused.is_empty(), "{:?}", reports.refused);
    assert!(reports.told.is_empty(), "{:?}", reports.told);
    assert!(reports.undefined.is_empty(), "{:?}", reports.undefined);
    assert!(reports.unrouted.is_empty(), "{:?}", reports.unrouted);
    let met: BTreeSet<String> =
        reports.unimplemented.values().map(|gap| format!("{}.{}", gap.instance, gap.register)).collect();
    assert_eq!(met, KEEP_WHAT_IS_WRITTEN.map(str::to_owned).into());
}

/// A board with a computer on one of its host links.
fn connected(mut builder: Builder, port: UartPort) -> (Rc<RefCell<Machine>>, Client<BoardTransport>) {
    let host = builder.line(port, HostUart::new());
    let machine = Rc::new(RefCell::new(builder.power_on()));
    let client = Client::connect_as(BoardTransport::new(&machine, host), 1, 1).expect("hello");
    (machine, client)
}

#[test]
fn both_host_links_answer() {
    for port in [UartPort::Host0, UartPort::Host1] {
        let (_, client) = connected(builder(), port);
        assert_eq!(client.hello().board, "nucleo-g474re", "{port:?}");
    }
}

#[test]
fn a_frame_leaves_on_each_can_bus() {
    let mut builder = builder();
    for port in BUSES {
        builder.can_node(port, Pattern::default(), Some(BITRATE));
    }
    let (machine, mut client) = connected(builder, UartPort::Host0);
    for (bus, port) in (0..).zip(BUSES) {
        client
            .configure_bus(bus, BITRATE, ProtocolSet::of(&[Protocol::Rmd]), false, REPLY_WINDOW)
            .expect("configured");
        client.raw_open_unsafe(bus).expect("open");
        let frame = CanFrame::standard(0x123 + u16::from(bus), &[0xAB, bus]).expect("a frame");
        client.raw_send(bus, RawFrame::Can(frame)).expect("taken over");
        machine.borrow_mut().run_for(Duration::from_millis(2));
        let machine = machine.borrow();
        let record = machine.can(port).log().last().unwrap_or_else(|| panic!("nothing on bus {bus}"));
        assert_eq!(record.outcome, FrameEnd::Acknowledged, "bus {bus}");
        assert_eq!(record.frame.id, Id::Standard(0x123 + u16::from(bus)));
        assert_eq!(record.frame.data[..2], [0xAB, bus]);
    }
}

#[test]
fn the_pins_are_the_boards() {
    let mut machine = builder().power_on();
    machine.run_for(STARTED);
    assert_eq!(machine.enable_output().driven(), Some(Level::High), "nobody has pressed an emergency stop");
    assert!(!machine.e_stop().reads_high(), "closed");
    assert!(!machine.light().changes().is_empty(), "it shows a pattern");
    log(&mut machine);
    machine.open_e_stop(true);
    machine.run_for(Duration::from_millis(5));
    assert!(machine.e_stop().reads_high(), "open: the pull-up's level");
    let lines = log(&mut machine);
    assert!(lines.iter().any(|line| line.contains("e-stop")), "{lines:?}");
}

#[test]
fn a_reset_says_why() {
    let mut machine = builder().power_on();
    machine.run_for(STARTED);
    log(&mut machine);
    machine.reset_by_pin();
    machine.run_for(STARTED);
    let lines = log(&mut machine);
    assert!(lines[0].ends_with("started by Pin"), "{lines:?}");
    machine.power_cycle(Duration::from_millis(10));
    machine.run_for(STARTED);
    let lines = log(&mut machine);
    assert!(lines[0].ends_with("started by PowerOn"), "{lines:?}");
}

/// DMA does not reach the CCM SRAM where the stack lies, and the driver panics at its error.
#[test]
fn a_message_in_memory_that_dma_does_not_reach_ends_the_run() {
    let (machine, mut client) = connected(builder(), UartPort::Host0);
    let (data, region) = (0x2000_0000..0x2001_3000, 0x2001_3000..0x2001_4000);
    dma::misplace_messages(&mut machine.borrow_mut(), data, region, 0x1000_0100);
    client.gateway_status().expect("the run after it answers");
    let mut machine = machine.borrow_mut();
    machine.run_for(STARTED);
    assert_eq!(machine.reports().resets.len(), 1);
    let lines = log(&mut machine);
    assert!(lines.iter().any(|line| line.contains("DMA: error on BDMA@40020000")), "{lines:?}");
}

/// RM0440, PWR_CR5: at 168 MHz the core needs the boosted range.
#[test]
fn its_regulator_is_boosted_for_168_mhz() {
    let mut machine = builder().power_on();
    assert!(!machine.part().g474().is_boosted());
    machine.run_for(STARTED);
    assert!(machine.part().g474().is_boosted());
}
