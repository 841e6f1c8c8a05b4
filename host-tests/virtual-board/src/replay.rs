//! What a flight recorder has kept, played to the image of the same build on the virtual board:
//! frames, bytes, pins and cables as they were, and in the image's memory the core as it was.

mod answers;
mod desk;
mod stage;
mod stimulus;

use std::collections::BTreeSet;
use std::fmt;
use std::path::PathBuf;

use flight_recorder::{Call, Recording, Replay, Step};
use gateway::{Event, Gateway, Instant, MAX_SNAPSHOT};
use host_protocol::{DEFAULT_BAUD, DELIMITER, Trip};
use mgw_cli::flight::{OnImage, leak};
use mgw_client::ClientError;

use crate::board::Board;
use crate::machine::{ImageError, image_path_of};
use stage::{Stage, USB, ready_us};
use stimulus::{Played, begins, outside};

/// The core begins with a call so long after the one before, µs: it never sees its time go
/// backwards.
const PAUSE_US: u64 = 40;

/// What is needed of the build of a board.
struct Images {
    board: Board,
    /// The firmware.
    firmware: PathBuf,
    /// `board-resume`.
    resume: PathBuf,
}

impl Images {
    /// Those that `.ci/virtual-board` has built, the one beside the other.
    fn of(board: Board) -> Result<Self, ImageError> {
        let firmware = image_path_of(board)?;
        let resume = firmware.with_file_name("board-resume");
        Ok(Self { board, firmware, resume })
    }
}

/// Why a recording is not played to an image.
#[derive(Debug)]
pub enum ReplayError {
    /// There is no image.
    Image(ImageError),
    /// The recording cannot be read, or the core of this program does not go on from it.
    Recording(String),
    /// There is no image of its board.
    OtherBoard(String),
    /// The image is of another build.
    OtherBuild,
    /// It was recorded by this build; the image says it is of another.
    Build {
        /// Of the recording.
        recorded: String,
        /// Of the image.
        image: String,
    },
    /// No core was found in the image's memory.
    NoCore,
    /// The image was not told of what it was to begin with.
    NotTold,
    /// The board does not do what it is asked to before the recording begins.
    Board(String),
    /// That bus was open and took no usual part in what happened there.
    OpenBus(u8),
    /// Nowhere in it may an image begin.
    NoBegin,
    /// A host link had another rate than that of a start.
    Baud {
        /// Index of the link.
        link: u8,
        /// Its rate.
        baud: u32,
    },
}

impl fmt::Display for ReplayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(error) => error.fmt(f),
            Self::Recording(why) => f.write_str(why),
            Self::OtherBoard(name) => {
                let boards = Board::ALL.map(Board::name).join(" and of ");
                write!(f, "it was recorded on {name}; there are images of {boards} to play it")
            }
            Self::OtherBuild => f.write_str("the image does not go on from it: another build"),
            Self::Build { recorded, image } => {
                write!(f, "it was recorded by build {recorded}; the image is of build {image}")
            }
            Self::NoCore => f.write_str("the image's core was not found in its memory"),
            Self::NotTold => {
                f.write_str("the image was not told of what it was to begin with")
            }
            Self::Board(why) => write!(f, "the board was not set up: {why}"),
            Self::OpenBus(bus) => write!(f, "bus {bus} was open to listen, or to send once"),
            Self::NoBegin => f.write_str(
                "an image can begin nowhere before the trip: it needs something that comes over a \
                 wire when no frame of the gateway is under way, 0.4 s after the start, 1.2 s where \
                 a host speaks over USB",
            ),
            Self::Baud { link, baud } => {
                write!(f, "host link {link} ran at {baud} baud; only {DEFAULT_BAUD} is played")
            }
        }
    }
}

impl std::error::Error for ReplayError {}

impl From<ClientError> for ReplayError {
    fn from(error: ClientError) -> Self {
        Self::Board(error.to_string())
    }
}

impl From<ImageError> for ReplayError {
    fn from(error: ImageError) -> Self {
        Self::Image(error)
    }
}

/// Where an image goes on from: the core before a call, and the calls from there on.
struct Begin<'a> {
    at: Instant,
    core: Vec<u8>,
    calls: Vec<Played<'a>>,
}

/// Plays a recording to the image of its board.
///
/// # Errors
/// Where it cannot be; see [`ReplayError`].
pub fn replay(file: &[u8]) -> Result<OnImage, ReplayError> {
    let mut scratch = vec![0; MAX_SNAPSHOT];
    let recording =
        Recording::read_file(file).map_err(|error| ReplayError::Recording(error.to_string()))?;
    let name = recording.board.name;
    let of = Board::ALL.into_iter().find(|board| board.name() == name);
    let images = Images::of(of.ok_or_else(|| ReplayError::OtherBoard(name.to_owned()))?)?;
    let recorded =
        recording.trip.ok_or_else(|| ReplayError::Recording("no trip was recorded".to_owned()))?;
    let board = leak(&recording.board);
    let usb = is_over_usb(&recording);
    let Begin { at, core, calls } = begin(&recording, recorded.1, usb, board, &mut scratch)?;
    let (begun, _) = Gateway::resume(board, &core).map_err(|_| ReplayError::OtherBuild)?;
    for link in (0..USB).take(recording.board.links.len()) {
        let baud = begun.baud(link);
        if baud != DEFAULT_BAUD {
            return Err(ReplayError::Baud { link, baud });
        }
    }
    let end = calls.last().map_or(at, |played| played.at);
    let outside = outside(&calls, recording.board.buses.len());
    let mut stage = Stage::new(&images, &begun, at, usb)?;
    let causes = begins(outside.causes, |line| stage.pace(line));
    let (first, rest) = causes.split_first().ok_or(ReplayError::NoBegin)?;
    stage.answer(&outside.answers);
    let done = stage.exchange(&core, first)?;
    if done.build != recording.board.build_id {
        let recorded = recording.board.build_id.to_owned();
        return Err(ReplayError::Build { recorded, image: done.build });
    }
    for (begin, cause) in rest {
        stage.play(*begin, cause);
    }
    let taken = stage.end(end)?;
    let (core, _) = Gateway::resume(board, &taken).map_err(|_| ReplayError::OtherBuild)?;
    let played = core.trips(core.tripped()).find(|(axis, _)| *axis == recorded.0);
    let (_, Trip { time_us, .. }) = recorded;
    let left_out = outside.left_out.into_iter().filter(|(at, _)| at.as_micros() <= time_us);
    Ok(OnImage {
        recorded,
        played: played.map(|(_, trip)| trip),
        causes: causes.len(),
        left_out: left_out.map(|(_, what)| what).collect(),
    })
}

/// Whether a host speaks over USB.
fn is_over_usb(recording: &Recording<'_>) -> bool {
    let mut calls = recording.halves.iter().flat_map(|half| half.calls());
    calls.any(|(_, call)| matches!(call, Call::Handle(Event::HostBytes { link: USB, .. })))
}

/// The first call of something that comes over a wire, behind a pause, when no controller holds a
/// frame, before the trip.
fn begin<'a>(
    recording: &Recording<'a>,
    trip: Trip,
    usb: bool,
    board: &'static gateway::Board,
    scratch: &'a mut [u8],
) -> Result<Begin<'a>, ReplayError> {
    let mut replay = Replay::new(board, recording, scratch)
        .map_err(|_| ReplayError::Recording("it is of another build".to_owned()))?;
    let mut snapshot = vec![0; MAX_SNAPSHOT];
    let (mut begin, mut before): (Option<Begin<'a>>, _) = (None, Instant::from_micros(0));
    // The core as it is before the next call is asked for behind the one before.
    let mut ready = None;
    // Of the host links on which a part of a frame has come: the line keeps it until the rest has.
    let mut inside = BTreeSet::new();
    while let Some(step) = replay.step() {
        let Ok(Step { at, call, transmit }) = step else { continue };
        let played = Played { at, call, transmit };
        match &mut begin {
            Some(begin) => begin.calls.push(played),
            None if at.as_micros() >= trip.time_us => break,
            None if inside.is_empty() && is_begin(&played, before, usb) && ready.is_some() => {
                let core: Vec<u8> = ready.take().unwrap_or_default();
                begin = Some(Begin { at, core, calls: vec![played] });
            }
            None => {}
        }
        if let Call::Handle(Event::HostBytes { link, bytes }) = call {
            match bytes.last() {
                Some(&DELIMITER) => _ = inside.remove(&link),
                _ => _ = inside.insert(link),
            }
        }
        if begin.is_none() {
            let is_empty = replay.core().has_nothing_out();
            ready =
                if is_empty { replay.snapshot(&mut snapshot).map(<[u8]>::to_vec) } else { None };
        }
        before = at;
    }
    begin.ok_or(ReplayError::NoBegin)
}

fn is_begin(played: &Played<'_>, before: Instant, usb: bool) -> bool {
    let at = played.at.as_micros();
    let comes = match played.call {
        Call::Handle(Event::CanReceived { .. }) => true,
        Call::Handle(Event::HostBytes { bytes, .. }) => bytes.last() == Some(&DELIMITER),
        _ => false,
    };
    comes && at >= ready_us(usb) && at - before.as_micros() >= PAUSE_US
}
