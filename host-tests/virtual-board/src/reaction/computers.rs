//! The computers at the host links: what they send, and what they are told.

use std::time::Duration;

use host_protocol::requests::Ping;
use host_protocol::{Call, Deframer, Frame, Kind, MAX_FRAME, encode};

use super::situation::Flood;
use crate::board::serial_port;
use crate::host_uart::HostUart;
use crate::machine::UartPort;
pub(super) use crate::rs485_line::BITS_PER_BYTE;
use virtual_stm32::Chip;

/// A sequence number that the client has not used lately.
pub(super) const SEQUENCE: u16 = 0x7000;
const HOST_BITS_PER_SECOND: u32 = 921_600;

/// What stops follow from.
pub(super) struct Cause {
    /// What a computer sends.
    pub(super) bytes: Vec<u8>,
    pub(super) from: UartPort,
    /// From when on the stops are timed, in the machine's time; nothing: from its last bit.
    pub(super) since: Option<Duration>,
}

impl Cause {
    /// A command on the second host link.
    pub(super) fn command<C: Call>(command: &C) -> Self {
        Self { bytes: request(command, SEQUENCE), from: UartPort::Host1, since: None }
    }

    /// A command of the host that has the authority, whose stops are timed from an instant on.
    pub(super) fn since<C: Call>(since: Duration, command: &C) -> Self {
        Self { bytes: request(command, SEQUENCE), from: UartPort::Host0, since: Some(since) }
    }
}

/// So many bytes as a line carries in that time: any, the delimiter among them, and the same in
/// each run.
pub(super) fn garbage(duration: Duration, bits_per_second: u32) -> Vec<u8> {
    let bits = duration.as_micros() * u128::from(bits_per_second) / 1_000_000;
    let bytes = usize::try_from(bits / u128::from(BITS_PER_BYTE)).expect("a second or so");
    let mut random = fastrand::Rng::with_seed(1);
    std::iter::repeat_with(|| random.u8(..)).take(bytes).collect()
}

/// What a computer sends in that time, whole frames.
pub(super) fn flood(of: Flood, duration: Duration) -> Vec<u8> {
    let bytes = garbage(duration, HOST_BITS_PER_SECOND);
    match of {
        Flood::Garbage => bytes,
        Flood::Requests => {
            let ping = |sequence| request(&Ping {}, sequence);
            let requests = bytes.len().div_ceil(ping(0).len());
            (0..SEQUENCE).cycle().take(requests).flat_map(ping).collect()
        }
    }
}

fn request<C: Call>(command: &C, sequence: u16) -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Request, sequence, C::NUMBER, command, &mut frame).expect("it fits");
    frame[..length].to_vec()
}

/// A computer whose line is free.
pub(super) fn computer(part: &mut Chip, port: UartPort) -> &mut HostUart {
    let host: &mut HostUart = serial_port(part, port).peer_mut().expect("a computer");
    assert_eq!(host.unsent(), 0);
    host
}

/// What the computer at the second host link was told.
pub(super) fn told(part: &mut Chip) -> Vec<u8> {
    serial_port(part, UartPort::Host1).peer_mut::<HostUart>().expect("a computer").take()
}

/// Calls `act` with every sound frame of it.
pub(super) fn each_frame(bytes: &[u8], mut act: impl FnMut(&Frame<'_>)) {
    let mut deframer = Deframer::new();
    for byte in bytes {
        if let Some(Ok(frame)) = deframer.push(*byte) {
            act(&frame);
        }
    }
}
