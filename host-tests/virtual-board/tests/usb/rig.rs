//! A board with a motor on CAN, a computer on a UART, and a USB host that has opened its serial
//! port.

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::LazyLock;
use std::time::Duration;

use host_protocol::{Deframer, Kind, MAX_FRAME, Request, Setpoint, requests};
use mgw_client::Client;
use virtual_board::board::Board;
use virtual_board::machine::{Builder, CanNode, CanPort, Machine, Snapshot, image_path_of};
use virtual_board::nodes::{Probe, since_start};
use virtual_board::outside::Outside;
use virtual_board::transport::BoardTransport;
use virtual_board::usb_session;
use virtual_board::usual::{self, Axis};
use virtual_stm32::fdcan::Sender;

use crate::rtt;

/// Longer than the start takes, USB included.
pub const STARTED: Duration = Duration::from_millis(60);
/// The bus of the motor, its axis and its stop: RMD V3.6 §2.16.
pub const BUS: u8 = 0;
pub const AXIS: u8 = 0;
const STOP_ID: u16 = 0x141;
const STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
const BITRATE: u32 = 1_000_000;
const RATE: u64 = 100_000_000;

static H743: LazyLock<Snapshot> = LazyLock::new(|| connected(Board::NucleoH743zi));
static G474: LazyLock<Snapshot> = LazyLock::new(|| connected(Board::NucleoG474re));

/// The image of a board.
pub fn image(board: Board) -> PathBuf {
    image_path_of(board).unwrap_or_else(|error| panic!("{error}"))
}

/// A board before it is switched on.
pub fn builder(board: Board) -> Builder {
    let builder = Builder::of(board, &image(board)).unwrap_or_else(|error| panic!("{error}"));
    builder.instructions_per_second(RATE).with_bootloader()
}

/// The board and what hangs on it.
pub struct Rig {
    pub board: Board,
    pub machine: Rc<RefCell<Machine>>,
    pub outside: Outside,
    pub probe: CanNode<Probe>,
}

fn wired(board: Board) -> (Builder, Outside, CanNode<Probe>) {
    let motor = usual::rmd(BUS, 1, BITRATE);
    let mut builder = builder(board);
    let outside = Outside::connect(&mut builder, &[motor], 1).expect("a sound wiring");
    let probe = builder.can_node(CanPort::Bus0, Probe::new(), None);
    (builder, outside, probe)
}

/// A board on whose USB a host has opened the serial port, with its bus and its axis configured
/// over it.
fn connected(board: Board) -> Snapshot {
    let (builder, outside, probe) = wired(board);
    let machine = Rc::new(RefCell::new(builder.power_on()));
    machine.borrow_mut().run_for(STARTED);
    usb_session::connect(&mut machine.borrow_mut());
    let rig = Rig { board, machine, outside, probe };
    let mut client = rig.client();
    usual::start_rmd_bus(&mut client, BUS, BITRATE).expect("a bus");
    Axis::rmd(BUS).configure(&mut client, AXIS).expect("parameters");
    client.provision_motor_timeout(AXIS, 1000).expect("the motor's own timeout");
    client.release_authority().expect("released");
    drop(client);
    rig.log();
    rig.machine.borrow_mut().snapshot()
}

impl Rig {
    /// That board.
    pub fn connected(board: Board) -> Self {
        let (builder, outside, probe) = wired(board);
        let snapshot = match board {
            Board::NucleoH743zi => &H743,
            Board::NucleoG474re => &G474,
        };
        Self { board, machine: Rc::new(RefCell::new(builder.resume(snapshot))), outside, probe }
    }

    /// A client over USB.
    pub fn client(&self) -> Client<BoardTransport> {
        self.connect(BoardTransport::usb(&self.machine))
    }

    /// A client on host link 0, a UART.
    pub fn uart(&self) -> Client<BoardTransport> {
        self.connect(BoardTransport::new(&self.machine, self.outside.hosts[0]))
    }

    fn connect(&self, transport: BoardTransport) -> Client<BoardTransport> {
        let session = u32::try_from(self.now().as_micros()).expect("within an hour");
        Client::connect_as(transport, session, 1).expect("hello")
    }

    pub fn run_for(&self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    pub fn now(&self) -> Duration {
        self.machine.borrow().now()
    }

    /// The lines that the firmware has logged, without their times.
    pub fn log(&self) -> Vec<String> {
        rtt::take(&mut self.machine.borrow_mut(), &image(self.board))
    }

    /// Arms the axis and has the motor turn.
    pub fn turn(client: &mut Client<BoardTransport>) {
        let epoch = client.arm(AXIS).expect("armed").epoch;
        let ttl = client.axis_ttl(AXIS).expect("its TTL");
        client
            .set(AXIS, epoch, Setpoint::Velocity { velocity_rad_s: 2.0 }, ttl)
            .expect("taken over");
    }

    /// When the first stop of the motor since an instant began.
    pub fn first_stop(&self, since: Duration) -> Option<Duration> {
        let machine = self.machine.borrow();
        let mut log = machine.can(CanPort::Bus0).log().iter();
        let stop = log.find(|record| {
            since_start(record.start) >= since
                && record.sender == Sender::Controller
                && record.frame.id == rigless::chip::can::Id::Standard(STOP_ID)
                && record.frame.payload() == STOP
        });
        stop.map(|record| since_start(record.start))
    }

    /// The sequence numbers of the requests that have been answered over USB since the last time.
    pub fn answers(&self) -> Vec<u16> {
        let bytes = self.machine.borrow_mut().usb().take();
        let mut deframer = Deframer::new();
        let mut answers = Vec::new();
        for byte in bytes {
            if let Some(frame) = deframer.push(byte) {
                let frame = frame.expect("a sound frame");
                if frame.kind != Kind::Event {
                    answers.push(frame.sequence);
                }
            }
        }
        answers
    }

    /// Whether a ping over USB is answered within 10 ms.
    pub fn is_answered(&self, sequence: u16) -> bool {
        self.machine.borrow_mut().usb().take();
        self.machine.borrow_mut().usb().send(&ping(sequence));
        self.run_for(Duration::from_millis(10));
        // What was asked before the host went away may still be answered.
        self.answers().last() == Some(&sequence)
    }
}

/// A request as it goes over a link.
pub fn frame(request: &Request, sequence: u16) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = request.encode_frame(sequence, &mut bytes).expect("room");
    bytes[..length].to_vec()
}

/// A ping, with its sequence number.
pub fn ping(sequence: u16) -> Vec<u8> {
    frame(&Request::Ping(requests::Ping {}), sequence)
}

/// As many pings as fit into so many bytes, and delimiters; the next sequence number.
pub fn pings(bytes: usize, mut sequence: u16) -> (Vec<u8>, u16) {
    let mut transfer = Vec::new();
    while transfer.len() + ping(sequence).len() <= bytes {
        transfer.extend(ping(sequence));
        sequence = sequence.wrapping_add(1);
    }
    transfer.resize(bytes, 0);
    (transfer, sequence)
}
