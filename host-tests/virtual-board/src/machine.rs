//! The board as a test sees it: boots an image and runs it in virtual time.
//!
//! The emulation runs on a thread of its own and stands still whenever the test thinks: [`Machine`]
//! then has the part in its hands, every model and every peer included. So a test reads like a lab
//! note: hang nodes on, switch on, run for a while, look, change something, run on.
//!
//! Same image, same peers, same orders at the same instants: same run, to the last access.

mod branch;
mod builder;
mod clock;
mod core_thread;
mod cut;
mod flash;
mod handles;
mod hold;
mod hse;
mod images;
mod names;
mod pins;
mod plant;
mod power;
mod recorder;
mod reports;
mod retention;
mod rom;
mod snapshot;

pub use builder::{Builder, ImageError, image_path, image_path_of};
pub use cut::{AfterCut, Cut, Expected, FlashContents};
pub use flash::FlashOperation;
pub use handles::{CanNode, CanPort, Line, UartPort};
pub use hold::Held;
pub use images::ImageAreas;
pub(crate) use names::{mangled, path};
pub use pins::PinProbe;
pub use plant::{Fault, Place};
pub use reports::Reports;
pub use rom::bootloader_entry;
pub use snapshot::Snapshot;

use std::time::Duration;

use rigless::chip::{can, uart};
use rigless::emulator::{Hit, Host, Watch};
use rigless::soc::Width;
use rigless::symbols::Symbols;
use rigless::time::VirtualNanos;

use crate::board::{Board, serial_port};
use core_thread::CoreThread;
use names::Names;
use virtual_stm32::Chip;
use virtual_stm32::fdcan::{Fdcan, Wiring};
use virtual_stm32::serial_port::FarEnd;
use virtual_stm32::usb::host::Host as UsbHost;

/// Symbols of cortex-m-rt's linker script: where the instructions lie.
const CODE: (&str, &str) = ("__stext", "__etext");

/// How often [`Machine::run_until`] looks at its condition.
const LOOK_PERIOD: Duration = Duration::from_micros(10);
/// Bytes of a word.
const WORD_BYTES: usize = 4;

/// A board that runs.
pub struct Machine {
    core: CoreThread,
    /// Which image runs, as a snapshot names it.
    firmware: [u8; 32],
    symbols: Symbols,
    names: Names,
    /// Where a fault was planted in a function, and the instructions that were there.
    planted: Option<(u64, [u16; 2])>,
    /// The instant to which the emulation was ordered to run: stops lie on it or at most one
    /// instruction behind.
    reached: VirtualNanos,
}

impl Machine {
    /// A board with the image that `MOTOR_GATEWAY_ELF` names, to hang peers on.
    /// Panics without an image: the message says how to build it.
    pub fn builder() -> Builder {
        let image = image_path().unwrap_or_else(|error| panic!("{error}"));
        Builder::new(&image).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Virtual time since the board was switched on.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.core.stop().at.0)
    }

    /// Instructions that the core has executed since the board was switched on.
    pub fn instructions(&self) -> u64 {
        self.core.stop().instruction_count
    }

    /// Runs for a while.
    pub fn run_for(&mut self, duration: Duration) {
        self.run_to(VirtualNanos(self.reached.0.saturating_add(nanos(duration))));
    }

    /// Runs until the condition holds, at most for `limit`. Looks every 10 µs; says whether it
    /// held.
    pub fn run_until(&mut self, limit: Duration, mut holds: impl FnMut(&mut Self) -> bool) -> bool {
        let end = VirtualNanos(self.reached.0.saturating_add(nanos(limit)));
        loop {
            if holds(self) {
                return true;
            }
            if self.reached >= end {
                return false;
            }
            let next = self.reached.0.saturating_add(nanos(LOOK_PERIOD));
            self.run_to(VirtualNanos(next).min(end));
        }
    }

    /// Runs to an instant on the virtual clock; not at all if that has passed.
    pub fn run_to(&mut self, instant: VirtualNanos) {
        if instant > self.reached {
            self.reached = instant;
            self.core.run_to(instant);
        }
    }

    /// Pulls the reset pin for an instant. The part starts again when it runs on; its peers never
    /// noticed.
    pub fn reset_by_pin(&mut self) {
        self.core.order(|session, host, stop, _| {
            session.reset_by_pin(stop.at, stop.instruction_count, host)
        });
    }

    /// Which board it is.
    pub fn board(&self) -> Board {
        Board::of(self.part())
    }

    /// The part with every model.
    pub fn part(&self) -> &Chip {
        self.core.part()
    }

    /// The part with every model. What is changed here acts when the machine runs on.
    pub fn part_mut(&mut self) -> &mut Chip {
        self.core.part_mut()
    }

    /// A CAN controller with its bus.
    pub fn can(&self, port: CanPort) -> &Fdcan {
        self.part().fdcan(port.index())
    }

    /// A CAN controller with its bus.
    pub fn can_mut(&mut self, port: CanPort) -> &mut Fdcan {
        self.part_mut().fdcan_mut(port.index())
    }

    /// Cuts a bus's cable at the controller, shorts it, or mends it.
    pub fn wire_can(&mut self, port: CanPort, wiring: Wiring) {
        self.can_mut(port).set_wiring(wiring);
    }

    /// A node on a CAN bus.
    pub fn node<P: can::Peer>(&mut self, node: CanNode<P>) -> &mut P {
        self.can_mut(node.port()).nodes_mut()[node.index()].peer_mut()
    }

    /// Cuts one node off its bus, or connects it again.
    pub fn silence_node<P: can::Peer>(&mut self, node: CanNode<P>, silent: bool) {
        self.can_mut(node.port()).nodes_mut()[node.index()].silence(silent);
    }

    /// Has one node run at another bitrate from now on, in bits per second.
    pub fn set_node_bitrate<P: can::Peer>(&mut self, node: CanNode<P>, bitrate: u32) {
        self.can_mut(node.port()).nodes_mut()[node.index()].set_bitrate(bitrate);
    }

    /// The far end of a serial line.
    pub fn line<P: FarEnd>(&mut self, line: Line<P>) -> &mut P {
        let port = serial_port(self.part_mut(), line.port());
        port.peer_mut().expect("the far end that was hung here")
    }

    /// The host at the other end of the USB cable.
    pub fn usb(&mut self) -> &mut UsbHost {
        self.part_mut().usb_host_mut()
    }

    /// Cuts a serial line, both ways, or mends it.
    pub fn silence_line(&mut self, port: UartPort, silent: bool) {
        serial_port(self.part_mut(), port).silence(silent);
    }

    /// How a serial line garbles what arrives at the board: rates and seed, to be set.
    pub fn line_errors(&mut self, port: UartPort) -> &mut uart::Errors {
        serial_port(self.part_mut(), port).errors_mut()
    }

    /// What the emulator could not stand in for, and the resets, since the board was switched on.
    pub fn reports(&mut self) -> Reports {
        self.core.order(|session, _, _, _| Reports::of(session))
    }

    /// Takes the bytes that the firmware has written to its RTT channel 0 since the last call, up
    /// to the last whole virtual millisecond and the last reset: then they are drained,
    /// whatever the test does.
    pub fn take_rtt(&mut self) -> Vec<u8> {
        self.core.order(|_, _, _, recorder| recorder.take_rtt())
    }

    /// A digest of every access the core has made to a peripheral: equal for equal runs.
    pub fn access_digest(&mut self) -> u64 {
        self.core.order(|_, _, _, recorder| recorder.digest())
    }

    /// Counts arrivals at an instruction or writes to memory from now on; see
    /// [`Machine::take_hits`].
    pub fn watch(&mut self, watch: Watch) {
        self.core.order(move |session, _, _, _| session.watch(watch));
    }

    /// Ends one [`Machine::watch`].
    pub fn unwatch(&mut self, watch: Watch) {
        self.core.order(move |session, _, _, _| session.unwatch(watch));
    }

    /// Where the instructions of the image lie.
    pub fn code(&self) -> std::ops::Range<u64> {
        self.symbol(CODE.0)..self.symbol(CODE.1)
    }

    /// Watches every instruction in this range, or no longer: the hits are a trace of the program
    /// counter.
    pub fn trace(&mut self, code: std::ops::Range<u64>, on: bool) {
        self.core.order(move |session, _, _, _| {
            // Wherever one may begin.
            for watch in code.step_by(2).map(Watch::Instruction) {
                if on { session.watch(watch) } else { session.unwatch(watch) }
            }
        });
    }

    /// What the watches have seen since the last call.
    pub fn take_hits(&mut self) -> Vec<Hit> {
        self.core.order(|_, _, _, recorder| recorder.take_hits())
    }

    /// The address of a symbol of the image.
    /// Panics if the image has no such symbol, or several.
    pub fn symbol(&self, name: &str) -> u64 {
        self.symbols.get(name).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Reads memory, not registers.
    /// Panics where there is no memory.
    pub fn read_memory(&mut self, address: u64, length: usize) -> Vec<u8> {
        self.core.order(move |_, host, _, _| {
            (address..).take(length).map(|at| read(host, at, Width::W8).to_le_bytes()[0]).collect()
        })
    }

    /// Reads a word of memory.
    /// Panics where there is no memory.
    pub fn read_word(&mut self, address: u64) -> u32 {
        let bytes = self.read_memory(address, WORD_BYTES);
        u32::from_le_bytes(bytes.try_into().expect("as many as were asked for"))
    }

    /// Writes memory, as a debug probe would.
    /// Panics where there is no writable memory.
    pub fn write_memory(&mut self, address: u64, bytes: &[u8]) {
        let bytes = bytes.to_vec();
        self.core.order(move |_, host, _, _| {
            for (at, byte) in (address..).zip(bytes) {
                host.write(at, Width::W8, byte.into()).unwrap_or_else(|error| panic!("{error}"));
            }
        });
    }

    /// Everything as it stands: the core, memory, the part, the peers. Any number of machines start
    /// from it, with [`Builder::resume`].
    /// Panics between a reset and the next run, and with a peer that keeps no snapshot.
    pub fn snapshot(&mut self) -> Snapshot {
        let firmware = self.firmware;
        let taken = self.core.order(move |session, host, stop, recorder| {
            rigless::snapshot::take(session, host, stop, &firmware, recorder)
        });
        Snapshot::keep(
            &taken.unwrap_or_else(|error| panic!("no snapshot: {error}")).file,
            self.reached,
        )
    }
}

impl std::fmt::Debug for Machine {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Machine").field("stop", &self.core.stop()).finish_non_exhaustive()
    }
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).expect("less than five centuries")
}

fn read(host: &mut dyn Host, address: u64, width: Width) -> u64 {
    host.read(address, width).unwrap_or_else(|error| panic!("{error}"))
}
