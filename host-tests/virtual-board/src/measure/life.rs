//! Much of what a host can ask for and of what can go wrong, to see how deep the stack reaches.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{
    Bytes, ClearTarget, RawFrame, Setpoint, StateField, StateFields, StopAction, StopTarget,
};
use mgw_client::{Client, ClientError, Hold, Transport};

use super::bench::STARTED;
use super::{SEED, stack};
use crate::board::Board;
use crate::machine::{Builder, CanPort, Machine};
use crate::outside::Outside;
use crate::transport::BoardTransport;
use crate::usual::{self, Axis, REPLY_WINDOW};
use virtual_stm32::fdcan::Wiring;

/// The four motors; the last one brakes.
fn axes() -> [Axis; 4] {
    let mut axes = usual::axes();
    axes[3].stop_action = StopAction::Brake;
    axes
}
const MOTOR_TIMEOUT_MS: u32 = 1_000;
const TTL: Duration = Duration::from_millis(100);
const SAMPLE_PERIOD: Duration = Duration::from_millis(20);
/// For a stop to be confirmed, or a bus to come back.
const SETTLED: Duration = Duration::from_millis(500);
/// Every value of a byte, and more than a receive buffer of the board holds.
const NOISE: usize = 2_000;
/// Read status 2 of an RMD (V3.6 §2.24), and the same for node 1 on RS485.
const READ_STATUS: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];
const READ_STATUS_RS485: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];

/// Bytes of the stack: of the start-up, and of such a life behind it.
pub(super) struct Depth {
    pub(super) start_up: u64,
    pub(super) life: u64,
}

/// Lives such a life on a board of this speed.
/// Panics if the gateway refuses what it should do.
pub(super) fn stack_used(board: Builder, instructions_per_second: u64) -> Depth {
    let mut board = board.instructions_per_second(instructions_per_second);
    let outside = Outside::four_motors(&mut board, SEED);
    let mut machine = board.power_on();
    stack::paint(&mut machine);
    machine.run_for(STARTED);
    let start_up = stack::used(&mut machine);
    stack::paint_anew(&mut machine);
    let machine = Rc::new(RefCell::new(machine));
    let mut client =
        Client::connect_as(BoardTransport::new(&machine, outside.hosts[0]), 1, 1).expect("hello");
    live(&mut client, &machine, &outside).expect("the gateway does as it is told");
    let life = stack::used(&mut machine.borrow_mut());
    Depth { start_up, life }
}

fn live(
    client: &mut Client<BoardTransport>,
    machine: &Rc<RefCell<Machine>>,
    outside: &Outside,
) -> Result<(), ClientError> {
    configure(client)?;
    client.list_axes()?;
    client.subscribe(&[0, 1, 2, 3], StateFields::of(StateField::ALL), SAMPLE_PERIOD)?;
    // Before a motor holds.
    let line = Board::chosen().rs485_bus();
    client.raw_open(line)?;
    client
        .raw_send(line, RawFrame::Serial(Bytes::from_slice(&READ_STATUS_RS485).expect("short")))?;
    stay(client, TTL)?;
    client.raw_receive(line)?;
    client.raw_close(line)?;

    move_all(client)?;
    client.stop(StopTarget::All)?;
    stay(client, SETTLED)?;

    let epoch = client.arm(0)?.epoch;
    client.move_relative(0, epoch, 0.1, 1.0, TTL)?;
    client.native(0, 0, Bytes::from_slice(&READ_STATUS).expect("eight bytes"), TTL)?;
    // The setpoint expires: a trip, and its stop.
    stay(client, SETTLED)?;
    client.clear(ClearTarget::Axis(0))?;

    let epoch = client.arm(0)?.epoch;
    machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
    client.set(0, epoch, Setpoint::Velocity { velocity_rad_s: 1.0 }, TTL)?;
    stay(client, SETTLED)?;
    machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Connected);
    stay(client, 2 * SETTLED)?;
    client.bus_status(0)?;

    let noise: Vec<u8> = (0..=u8::MAX).cycle().take(NOISE).collect();
    machine.borrow_mut().line(outside.hosts[1]).send(&noise);
    machine.borrow_mut().line(outside.hosts[1]).send_damaged(&noise);
    stay(client, SETTLED)?;
    client.estop()?;
    stay(client, SETTLED)?;
    client.clear(ClearTarget::Gateway)
}

fn configure(client: &mut Client<BoardTransport>) -> Result<(), ClientError> {
    for (bus, bitrate, protocols) in usual::buses() {
        client.configure_bus(bus, bitrate, protocols, true, REPLY_WINDOW)?;
    }
    for (number, axis) in (0..).zip(axes()) {
        axis.configure(client, number)?;
        if axis.has_motor_timeout() {
            client.provision_motor_timeout(number, MOTOR_TIMEOUT_MS)?;
        }
    }
    Ok(())
}

/// All four motors turn at once.
fn move_all(client: &mut Client<BoardTransport>) -> Result<(), ClientError> {
    let mut holds = Vec::new();
    for (axis, Axis { protocol, .. }) in (0..).zip(axes()) {
        let (epoch, setpoint) = (client.arm(axis)?.epoch, usual::turning(protocol));
        holds.push(Hold { axis, epoch, setpoint, ttl: TTL });
    }
    client.hold_setpoints(&holds, SETTLED, |client| {
        for axis in 0..4 {
            client.read_state(axis)?;
        }
        while client.poll_event(Duration::ZERO)?.is_some() {}
        Ok(ControlFlow::Continue(()))
    })
}

/// Stays in command without a setpoint, and reads the events.
fn stay<T: Transport>(client: &mut Client<T>, duration: Duration) -> Result<(), ClientError> {
    client.hold(duration, |client| {
        while client.poll_event(Duration::ZERO)?.is_some() {}
        Ok(ControlFlow::Continue(()))
    })
}
