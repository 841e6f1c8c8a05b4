//! A board with a node on bus 0 and a computer on host link 0.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::replies::BusReport;
use host_protocol::{CanFrame, RawFrame};
use mgw_client::{Client, ClientError};
use rigless::chip::can::{Frame, Id, Offer, Pattern};
use virtual_board::host_uart::HostUart;
use virtual_board::machine::{Builder, CanNode, CanPort, Line, Machine, UartPort};
use virtual_board::nodes::instant;
use virtual_board::transport::BoardTransport;
use virtual_board::usual;
use virtual_stm32::fdcan::{FrameEnd, Wiring};

pub const BITRATE: u32 = 1_000_000;

pub struct Bench {
    pub machine: Rc<RefCell<Machine>>,
    pub node: CanNode<Pattern>,
    pub client: Client<BoardTransport>,
}

pub fn data_frame(id: u16, data: &[u8]) -> Frame {
    Frame::data_frame(Id::Standard(id), data)
}

/// The board before it is switched on.
pub fn wired(
    mut builder: Builder,
    pattern: Pattern,
    bitrate: u32,
) -> (Builder, CanNode<Pattern>, Line<HostUart>) {
    let node = builder.can_node(CanPort::Bus0, pattern, Some(bitrate));
    let host = builder.line(UartPort::Host0, HostUart::new());
    (builder, node, host)
}

impl Bench {
    pub fn of(builder: Builder) -> Self {
        Self::with(builder, Pattern::default(), BITRATE)
    }

    pub fn with(builder: Builder, pattern: Pattern, bitrate: u32) -> Self {
        let (builder, node, host) = wired(builder, pattern, bitrate);
        let machine = Rc::new(RefCell::new(builder.power_on()));
        let client = Client::connect_as(BoardTransport::new(&machine, host), 1, 1).expect("hello");
        Self { machine, node, client }
    }

    /// With bus 0 open for raw frames.
    pub fn opened(mut self) -> Self {
        self.configure(0).expect("bus 0 runs");
        self.client.raw_open_unsafe(0).expect("open");
        self
    }

    pub fn configure(&mut self, bus: u8) -> Result<(), ClientError> {
        usual::start_rmd_bus(&mut self.client, bus, BITRATE)
    }

    pub fn run_for(&self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    pub fn wire(&self, wiring: Wiring) {
        self.machine.borrow_mut().wire_can(CanPort::Bus0, wiring);
    }

    /// Runs until the controller of bus 0 is on its bus, or is not.
    pub fn run_until_on_bus(&self, on: bool, at_most: Duration) {
        let there = |machine: &mut Machine| machine.can(CanPort::Bus0).is_on_bus() == on;
        assert!(self.machine.borrow_mut().run_until(at_most, there), "on bus: {}", !on);
    }

    pub fn send(&mut self, bus: u8, id: u16, data: &[u8]) {
        let frame = CanFrame::standard(id, data).expect("a frame");
        self.client.raw_send(bus, RawFrame::Can(frame)).expect("taken over");
    }

    /// Has the node send frames from now on.
    pub fn offer(&self, frames: impl IntoIterator<Item = Frame>) {
        let mut machine = self.machine.borrow_mut();
        let since = instant(machine.now());
        for frame in frames {
            machine.node(self.node).queue(Offer { since, frame, fault: None });
        }
    }

    pub fn status(&mut self) -> BusReport {
        self.client.bus_status(0).expect("status")
    }

    pub fn heard(&self) -> Vec<u16> {
        let mut machine = self.machine.borrow_mut();
        let heard = machine.node(self.node).heard();
        heard.iter().map(|(_, frame)| u16::try_from(frame.id.value()).expect("11 bits")).collect()
    }

    pub fn ends(&self) -> Vec<FrameEnd> {
        self.machine.borrow().can(CanPort::Bus0).log().iter().map(|record| record.outcome).collect()
    }
}
