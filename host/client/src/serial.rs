//! A gateway behind a serial port of this computer: a board's virtual COM port or a USB adapter.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

use host_protocol::DEFAULT_BAUD;
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort, StopBits};

use crate::tcp::nothing_came;
use crate::transport::Transport;

/// Read timeout a port is opened with; each `receive` sets its own.
const OPENING_TIMEOUT: Duration = Duration::from_millis(10);
/// A device that takes no bytes for so long is gone.
pub(crate) const WRITE_TIMEOUT: Duration = Duration::from_secs(1);
/// Shortest read timeout that the operating system is asked for; below its clock's tick it may not
/// wait at all.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);

/// A serial port, 8 data bits, no parity, 1 stop bit, no flow control, in wall-clock time.
pub struct SerialTransport {
    device: String,
    wanted_baud: u32,
    port: Option<Box<dyn SerialPort>>,
    start: Instant,
}

impl SerialTransport {
    /// Opens `device`, at first with [`DEFAULT_BAUD`]; a client then asks the gateway for
    /// `wanted_baud`.
    ///
    /// # Errors
    /// When there is no such device, it may not be opened, or it cannot run at that rate.
    pub fn open(device: &str, wanted_baud: u32) -> io::Result<Self> {
        let port = open(device)?;
        Ok(Self { device: device.to_owned(), wanted_baud, port: Some(port), start: Instant::now() })
    }

    fn port(&mut self) -> io::Result<&mut Box<dyn SerialPort>> {
        self.port
            .as_mut()
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotConnected, "the port is not open"))
    }
}

impl std::fmt::Debug for SerialTransport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SerialTransport")
            .field("device", &self.device)
            .field("wanted_baud", &self.wanted_baud)
            .field("open", &self.port.is_some())
            .finish_non_exhaustive()
    }
}

impl Transport for SerialTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let port = self.port()?;
        // Reading has set another.
        port.set_timeout(WRITE_TIMEOUT)?;
        port.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let port = self.port()?;
        if timeout.is_zero() && port.bytes_to_read()? == 0 {
            return Ok(0);
        }
        port.set_timeout(timeout.max(SHORTEST_WAIT))?;
        match port.read(buffer) {
            Ok(count) => Ok(count),
            Err(error) if nothing_came(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&mut self, duration: Duration) {
        std::thread::sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        // Closed first: the device is opened for one user only.
        self.port = None;
        self.port = Some(open(&self.device)?);
        Ok(())
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        Ok(self.port()?.set_baud_rate(baud)?)
    }

    fn wanted_baud(&self) -> Option<u32> {
        (self.wanted_baud != DEFAULT_BAUD).then_some(self.wanted_baud)
    }
}

/// Opens a device, what it had received before forgotten.
pub(crate) fn open(device: &str) -> io::Result<Box<dyn SerialPort>> {
    let port = serialport::new(device, DEFAULT_BAUD)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .timeout(OPENING_TIMEOUT)
        .open()?;
    // What the system buffered before belongs to nobody; the deframer would survive it, a stale
    // reply might confuse.
    port.clear(ClearBuffer::Input)?;
    Ok(port)
}
