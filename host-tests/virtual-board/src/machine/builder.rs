//! A board before it is switched on: which image, how fast, what hangs on its ports.

use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::{env, fmt, fs};

use rigless::chip::can;
use rigless::cpu::armv7m::code_address;
use rigless::device::Level;
use rigless::image::{Image, digest};
use rigless::symbols::Symbols;
use rigless::time::VirtualNanos;

use super::core_thread::{CoreThread, PoweredOff};
use super::handles::{CanNode, CanPort, Line, UartPort};
use super::names::Names;
use super::recorder::Recorder;
use super::rom::{rom_bootloader, waiting_bootloader};
use super::{Machine, Snapshot};
use crate::board::{Board, serial_port};
use virtual_stm32::Chip;
use virtual_stm32::revision::Revision;
use virtual_stm32::serial_port::FarEnd;
use virtual_stm32::socket::Socket;

/// The vector table at reset: BOOT_ADD0 of the STM32H743 as delivered, and the flash of the
/// STM32G474.
const FLASH: u32 = 0x0800_0000;
/// Where the firmware's logger keeps its control block.
const RTT_SYMBOL: &str = "_SEGGER_RTT";

/// Why there is no image to run.
#[derive(Debug)]
pub enum ImageError {
    /// This variable is not set.
    Unnamed(&'static str),
    /// The file cannot be read.
    Unreadable(PathBuf, std::io::Error),
    /// The file is no image for the part.
    Unusable(PathBuf, String),
}

impl fmt::Display for ImageError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unnamed(variable) => write!(formatter, "{variable} names no firmware image")?,
            Self::Unreadable(path, error) => write!(formatter, "{}: {error}", path.display())?,
            Self::Unusable(path, error) => write!(formatter, "{}: {error}", path.display())?,
        }
        write!(
            formatter,
            ". `.ci/virtual-board` in the repository's root builds the images and names them"
        )
    }
}

impl std::error::Error for ImageError {}

/// The image of the chosen board.
/// Fails if nothing names it.
pub fn image_path() -> Result<PathBuf, ImageError> {
    image_path_of(Board::chosen())
}

/// The image of a board: what its [`Board::image_variable`] names.
/// Fails if it names none.
pub fn image_path_of(board: Board) -> Result<PathBuf, ImageError> {
    let variable = board.image_variable;
    env::var_os(variable).map(PathBuf::from).ok_or(ImageError::Unnamed(variable))
}

/// A board that is not switched on yet.
#[derive(Debug)]
pub struct Builder {
    part: Box<Chip>,
    image: Image,
    /// What else lies in the flash.
    beside: Vec<Image>,
    vector_table: u32,
    started_by_rom: bool,
    bootloader: bool,
    pub(super) symbols: Symbols,
    names: Names,
    instructions_per_second: NonZeroU64,
}

impl Builder {
    /// The chosen board with the image in that file.
    /// Fails if the file is none.
    pub fn new(image: &Path) -> Result<Self, ImageError> {
        Self::of(Board::chosen(), image)
    }

    /// A board with the image in that file.
    /// Fails if the file is none.
    pub fn of(board: Board, image: &Path) -> Result<Self, ImageError> {
        let bytes =
            fs::read(image).map_err(|error| ImageError::Unreadable(image.to_owned(), error))?;
        let unusable =
            |error: &dyn fmt::Display| ImageError::Unusable(image.to_owned(), error.to_string());
        let symbols = Symbols::read(&bytes, code_address).map_err(|error| unusable(&error))?;
        let names = Names::read(&bytes).map_err(|error| unusable(&error))?;
        let image = Image::new(image, bytes, None).map_err(|error| unusable(&error))?;
        let mut part = Box::new(board.chip());
        // Nobody has pressed an emergency stop.
        part.drive_pin(board.e_stop, Some(Level::Low), VirtualNanos(0));
        Ok(Self {
            part,
            image,
            beside: Vec::new(),
            vector_table: FLASH,
            started_by_rom: false,
            bootloader: false,
            symbols,
            names,
            instructions_per_second: board.usual_rate,
        })
    }

    /// Puts another image beside the one that runs.
    /// Fails if the file is none.
    pub fn beside(mut self, image: &Path) -> Result<Self, ImageError> {
        self.beside.push(
            Image::read(image, None)
                .map_err(|error| ImageError::Unusable(image.to_owned(), error.to_string()))?,
        );
        Ok(self)
    }

    /// Starts what has its vector table there.
    pub fn starting_at(mut self, vector_table: u32) -> Self {
        self.vector_table = vector_table;
        self
    }

    /// Which board it is.
    pub fn board(&self) -> Board {
        Board::of(&self.part)
    }

    /// Which revision the chip is; V unless set.
    pub fn revision(mut self, revision: Revision) -> Self {
        self.part.h743_mut().set_revision(revision, None);
        self
    }

    /// A chip of one revision that says it is of another.
    pub fn disguised(mut self, revision: Revision, pretended: Revision) -> Self {
        self.part.h743_mut().set_revision(revision, Some(pretended));
        self
    }

    /// An STM32G474 whose flash is one bank: option DBANK = 0.
    pub fn single_bank(mut self) -> Self {
        self.part.g474_mut().set_single_bank();
        self
    }

    /// Nothing is on the HSE input: no ST-LINK that clocks the chip, no crystal that swings.
    pub fn without_hse(mut self) -> Self {
        self.part.attach_hse(VirtualNanos(0), 0);
        self
    }

    /// Has every reset lead to the ROM bootloader, which leaves for the image with its own vector
    /// table still in place, as after an update over USB (DFU `:leave`, AN3156).
    pub fn started_by_rom(mut self) -> Self {
        self.started_by_rom = true;
        self
    }

    /// Puts a bootloader where the firmware starts it: it waits at
    /// [`bootloader_entry`](super::bootloader_entry).
    pub fn with_bootloader(mut self) -> Self {
        self.bootloader = true;
        self
    }

    /// How fast the core is; unless set, 250 million instructions a second for an STM32H743 and 168
    /// for an STM32G474.
    /// Panics on 0.
    pub fn instructions_per_second(mut self, rate: u64) -> Self {
        self.instructions_per_second = NonZeroU64::new(rate).expect("a core that runs");
        self
    }

    /// Hangs a node on a CAN bus. `bitrate`: the bits per second at which it runs, `None` for
    /// whatever the controller runs at. Two nodes at rates that differ destroy each other's
    /// frames.
    pub fn can_node<P: can::Peer>(
        &mut self,
        port: CanPort,
        peer: P,
        bitrate: Option<u32>,
    ) -> CanNode<P> {
        CanNode::new(port, self.part.fdcan_mut(port.index()).attach(peer, bitrate))
    }

    /// Hangs the far end on a serial line. It speaks at the rate of the board.
    pub fn line<P: FarEnd>(&mut self, port: UartPort, peer: P) -> Line<P> {
        serial_port(&mut self.part, port).attach(peer);
        Line::new(port)
    }

    /// Switches the board on. It stands before its first instruction.
    pub fn power_on(self) -> Machine {
        self.start(None)
    }

    /// Goes on from where the snapshot was taken, with the same image and the same peers in the
    /// same places.
    pub fn resume(self, snapshot: &Snapshot) -> Machine {
        self.start(Some(snapshot.clone()))
    }

    fn start(self, from: Option<Snapshot>) -> Machine {
        let Self {
            part,
            image,
            beside,
            vector_table,
            started_by_rom,
            bootloader,
            symbols,
            names,
            instructions_per_second,
        } = self;
        let (vector_table, rom) = match started_by_rom {
            true => {
                let (at, image) = rom_bootloader(Board::of(&part));
                (at, Some(image))
            }
            false => (vector_table, None),
        };
        let board = Board::of(&part);
        let bootloader = bootloader.then(|| waiting_bootloader(board));
        let images = [Some(image), rom, bootloader].into_iter().flatten().chain(beside);
        let images: Vec<Image> = images.collect();
        let firmware = digest(&images, None);
        let recorder = Recorder::new(symbols.get(RTT_SYMBOL).ok(), board);
        let board =
            Socket::new(board.name(), part, board.pace(instructions_per_second), vector_table);
        let reached = from.as_ref().map_or(VirtualNanos(0), Snapshot::reached);
        let core = CoreThread::start(PoweredOff { board, images, firmware, recorder }, from);
        Machine { core, firmware, symbols, names, planted: None, reached }
    }
}
