//! The USB's packet memory of the STM32G474: 1 KiB in half-words, where the buffers and the table
//! of them lie.
//!
//! The controller reaches it through a clone of [`PacketMemory`], the processor through
//! [`PacketMemoryWindow`]. Each endpoint register has four half-words in the table: address and
//! length of what it sends, address and length of what it receives (RM0440, USB chapter, buffer
//! descriptor table).

use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};

use rigless::device::{DeviceContext, ErasedDevice, RegisterFile, RequestChange};
use rigless::snapshot::{Error, Reader, Store, Writer};
use rigless::soc::{Gate, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};

/// Its name on the bus.
pub const NAME: &str = "USBRAM";
/// Its size.
const BYTES: usize = 1024;
const SIZE: NonZeroU64 = NonZeroU64::new(BYTES as u64).expect("not empty");
/// Where the processor finds it (stm32-metapac 21, USBRAM).
const BASE: u64 = 0x4000_6000;
/// Bytes that an endpoint register has in the table.
const ROW_BYTES: u16 = 8;
/// COUNTn_RX: the size of a block, their number, the bytes received.
const BL_SIZE: u16 = 1 << 15;
const NUM_BLOCK: u16 = 0x1F << 10;
const COUNT: u16 = 0x3FF;

/// The memory. Clones reach the same bytes.
#[derive(Debug, Clone)]
pub struct PacketMemory(Arc<[AtomicU16]>);

/// Why a packet was neither sent nor received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failed {
    /// It is longer than the buffer.
    Overrun,
    /// The table or the buffer lies outside the memory: a defect of the firmware.
    Outside,
}

impl PacketMemory {
    /// All zero. After power-on the part's RAM holds anything; a model must choose.
    #[must_use]
    pub fn new() -> Self {
        Self((0..BYTES / 2).map(|_| AtomicU16::new(0)).collect())
    }

    /// The half-word at a byte address; bit 0 of it does not count.
    fn get(&self, address: u16) -> Result<u16, Failed> {
        self.0
            .get(usize::from(address / 2))
            .map(|half| half.load(Ordering::Relaxed))
            .ok_or(Failed::Outside)
    }

    fn set(&self, address: u16, value: u16) -> Result<(), Failed> {
        let half = self.0.get(usize::from(address / 2)).ok_or(Failed::Outside)?;
        half.store(value, Ordering::Relaxed);
        Ok(())
    }

    /// What an endpoint register has to send; `table` is BTABLE.
    ///
    /// # Errors
    ///
    /// If it lies outside.
    pub fn packet(&self, table: u16, register: u16) -> Result<Vec<u8>, Failed> {
        let row = table.checked_add(register * ROW_BYTES).ok_or(Failed::Outside)?;
        let (start, length) = (self.get(row)?, self.get(row + 2)? & COUNT);
        let mut bytes = Vec::with_capacity(usize::from(length) + 1);
        for offset in (0..length).step_by(2) {
            bytes
                .extend(self.get(start.checked_add(offset).ok_or(Failed::Outside)?)?.to_le_bytes());
        }
        bytes.truncate(usize::from(length));
        Ok(bytes)
    }

    /// Puts what has arrived into the buffer of an endpoint register: the data, as much of their
    /// CRC as there is room for, and the number of bytes.
    ///
    /// # Errors
    ///
    /// If the buffer is too small, or lies outside.
    pub fn receive(&self, table: u16, register: u16, data: &[u8]) -> Result<(), Failed> {
        let row = table.checked_add(register * ROW_BYTES).ok_or(Failed::Outside)?;
        let (start, described) = (self.get(row + 4)?, self.get(row + 6)?);
        let room = room(described);
        let arrived: Vec<u8> =
            data.iter().copied().chain(crc(data).to_le_bytes()).take(room).collect();
        for (offset, pair) in (0..).step_by(2).zip(arrived.chunks(2)) {
            let half = u16::from_le_bytes([pair[0], pair.get(1).copied().unwrap_or(0)]);
            self.set(start.checked_add(offset).ok_or(Failed::Outside)?, half)?;
        }
        if data.len() > room {
            return Err(Failed::Overrun);
        }
        let length = u16::try_from(data.len()).expect("no more than there is room for");
        self.set(row + 6, described & !COUNT | length)
    }
}

impl Default for PacketMemory {
    fn default() -> Self {
        Self::new()
    }
}

impl Store for PacketMemory {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        let halves: Vec<u16> = self.0.iter().map(|half| half.load(Ordering::Relaxed)).collect();
        to.put(&halves)
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        let halves: Vec<u16> = from.take()?;
        self.0.iter().zip(halves).for_each(|(half, value)| half.store(value, Ordering::Relaxed));
        Ok(())
    }
}

/// The bytes that a buffer holds: blocks of 2 bytes, or of 32 and then one more than said.
fn room(described: u16) -> usize {
    let blocks = usize::from((described & NUM_BLOCK) >> NUM_BLOCK.trailing_zeros());
    if described & BL_SIZE == 0 { 2 * blocks } else { 32 * (blocks + 1) }
}

/// The CRC behind the data of a packet (USB 2.0 §8.3.5.2).
fn crc(data: &[u8]) -> u16 {
    let mut crc = u16::MAX;
    for byte in data {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
        }
    }
    !crc
}

/// The memory as the processor's bus reaches it, by half-words.
#[derive(Debug)]
pub struct PacketMemoryWindow {
    memory: PacketMemory,
    layout: &'static [RegisterSpec],
}

impl PacketMemoryWindow {
    /// The window to add to the part's bus: it answers while the USB's clock is on.
    #[must_use]
    pub const fn window() -> Window {
        Window::new(NAME, BASE, SIZE).gated(Gate::by("RCC", "APB1ENR1", "USBEN"))
    }

    /// Over `memory`, for the slot whose table is `layout`.
    #[must_use]
    pub const fn new(memory: PacketMemory, layout: &'static [RegisterSpec]) -> Self {
        Self { memory, layout }
    }
}

fn address(offset: u64) -> u16 {
    u16::try_from(offset).expect("inside the window")
}

impl ErasedDevice for PacketMemoryWindow {
    fn layout(&self) -> &'static [RegisterSpec] {
        self.layout
    }

    crate::message_ram::without_registers!();

    fn read_window(&mut self, offset: u64, width: Width, context: &mut DeviceContext<'_>) -> u64 {
        if width != Width::W16 {
            context.tell(NAME, "read otherwise than as a half-word");
        }
        self.peek_window(offset, width, context.now()).unwrap_or(0)
    }

    fn write_window(
        &mut self,
        offset: u64,
        width: Width,
        value: u64,
        context: &mut DeviceContext<'_>,
    ) {
        match (width, u16::try_from(value)) {
            (Width::W16, Ok(value)) if self.memory.set(address(offset), value).is_ok() => {}
            _ => context.tell(NAME, "written otherwise than as a half-word"),
        }
    }

    fn peek_window(&self, offset: u64, _: Width, _: VirtualNanos) -> Option<u64> {
        let half = |at| u64::from(self.memory.get(address(at)).unwrap_or(0));
        Some((half(offset) | half(offset + 2) << 16) >> (offset % 2 * 8))
    }
}

impl Store for PacketMemoryWindow {
    /// The controller's clone is stored.
    fn store(&self, _: &mut Writer) -> Result<(), Error> {
        Ok(())
    }

    fn load(&mut self, _: &mut Reader) -> Result<(), Error> {
        Ok(())
    }
}
