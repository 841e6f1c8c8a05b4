//! Another image over a host link: by the code of `mgw`, on trial, kept or taken back, whatever becomes
//! of the supply meanwhile.

mod every;

use std::ops::Range;
use std::path::PathBuf;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use firmware_image::{CHECKSUM, HEADER_OFFSET, HEADER_SIZE, Header, UNIT};
use host_protocol::requests::{ConfirmImage, FinishImage, WriteImage};
use host_protocol::{
    BootReason, Call, Error, FirmwareVersion, ImageState, Kind, MAX_FRAME, MAX_IMAGE_BYTES,
    SIGNATURE_SIZE, encode,
};
use mgw_cli::print_on;
use mgw_client::{ClientError, Interrupt};
use salty::{Keypair, Sha512};
use serde::Serialize;
use virtual_board::board::{Board, Flash};
use virtual_board::machine::{Builder, FlashContents, ImageAreas, Machine, Snapshot, image_path};
use virtual_board::transport::BoardTransport;

use crate::lab::{D5, Lab, SEED, wire, wired};
use crate::part::part_of;

/// The new one.
const NEW: FirmwareVersion = FirmwareVersion { major: 9, minor: 8, patch: 7 };
/// For an exchange, with what comes before and after.
const EXCHANGE: Duration = Duration::from_secs(25);
/// How long a trial lasts.
const TRIAL: Duration = Duration::from_secs(60);
/// For every first stop to be confirmed.
const SETTLED: Duration = Duration::from_millis(500);
/// Where the images of this board lie, and what an update does to them.
pub struct Layout {
    pub areas: ImageAreas,
    pub flash: Flash,
}

pub static LAYOUT: LazyLock<Layout> = LazyLock::new(|| {
    let builder = Machine::builder();
    Layout { areas: builder.image_areas(), flash: builder.board().flash }
});

impl Layout {
    /// Bytes of the longest image.
    fn room(&self) -> usize {
        bytes(&self.areas.active)
    }

    /// Operations of a page of an image: its erasure, its words, and the word that counts it.
    pub fn page_operations(&self) -> usize {
        self.flash.page / self.flash.word + 2
    }

    /// Of marking, by the image that runs or by the loader: what was before no longer counts,
    /// erasures, what counts now.
    pub fn marking(&self) -> usize {
        bytes(&self.areas.state) / self.flash.page + 2
    }

    /// Of an exchange: each page goes both ways.
    pub fn exchange_operations(&self) -> usize {
        2 * self.room() / self.flash.page * self.page_operations()
    }
}

fn bytes(area: &Range<u64>) -> usize {
    usize::try_from(area.end - area.start).expect("it fits")
}

/// A number of requests beyond what a client that goes on has reached.
const FAR: u16 = 0x7000;
/// `B .`
const HANG: [u8; 2] = [0xFE, 0xE7];
/// `UDF #0`
const UNDEFINED: [u8; 2] = [0x00, 0xDE];

/// The image that runs, with another version.
fn new_image(machine: &mut Machine) -> Vec<u8> {
    let mut image = machine.read_memory(LAYOUT.areas.active.start, LAYOUT.room());
    let mut header = Header::of_image(&image).expect("a header");
    let length = usize::try_from(header.length).expect("it fits");
    image.truncate(length);
    image.resize(length.next_multiple_of(UNIT), 0xFF);
    header.version = NEW;
    put_header(&mut image, header);
    image
}

fn put_header(image: &mut [u8], header: Header) {
    image[HEADER_OFFSET..HEADER_OFFSET + HEADER_SIZE].copy_from_slice(&header.to_bytes());
}

/// The same with other first instructions.
fn ill_image(machine: &mut Machine, first: [u8; 2]) -> Vec<u8> {
    let mut image = new_image(machine);
    let entry = u32::from_le_bytes(image[4..8].try_into().expect("a word")) & !1;
    let at = usize::try_from(u64::from(entry) - LAYOUT.areas.active.start).expect("in the image");
    image[at..at + 2].copy_from_slice(&first);
    image
}

/// Of the parts in which it is sent, one.
fn part(image: &[u8], number: usize) -> WriteImage {
    let offset = number * MAX_IMAGE_BYTES;
    let bytes = image[offset..].iter().copied().take(MAX_IMAGE_BYTES).collect();
    WriteImage { offset: u32::try_from(offset).expect("it fits"), bytes }
}

/// A board with nothing configured.
fn lab() -> Lab {
    Lab::power_on(SEED)
}

/// The same when the new image is written.
static WRITTEN: LazyLock<Snapshot> = LazyLock::new(|| {
    let mut lab = lab();
    let image = new_image(&mut lab.machine.borrow_mut());
    lab.write(&image);
    lab.into_snapshot()
});

fn written() -> Lab {
    let mut lab = Lab::resume(&WRITTEN);
    lab.client.take_authority().expect("in command");
    lab
}

/// The same when it runs on trial.
static ON_TRIAL: LazyLock<Snapshot> = LazyLock::new(|| {
    let mut lab = written();
    lab.exchange();
    lab.into_snapshot()
});

fn on_trial() -> Lab {
    let mut lab = Lab::resume(&ON_TRIAL);
    lab.client.take_authority().expect("in command");
    lab
}

impl Lab {
    /// Says that an image will come.
    fn announce(&mut self, image: &[u8]) {
        let length = u32::try_from(image.len()).expect("it fits");
        let version = Header::of_image(image).expect("a header").version;
        self.client.take_authority().expect("in command");
        let board = self.client.hello().board.to_string();
        self.client
            .begin_image(&board, version, length, CHECKSUM.checksum(image), false)
            .expect("announced");
    }

    fn write(&mut self, image: &[u8]) {
        self.announce(image);
        for (offset, part) in (0..).step_by(MAX_IMAGE_BYTES).zip(image.chunks(MAX_IMAGE_BYTES)) {
            self.client.write_image(offset, part).expect("written");
        }
    }

    /// Writes an image with that signature, and asserts that the board does not take it for one.
    #[track_caller]
    fn assert_not_signed(&mut self, image: &[u8], signature: &[u8]) {
        self.write(image);
        let refused = self.client.finish_image(signature).expect_err("not signed");
        assert!(matches!(refused, ClientError::Gateway(Error::ImageNotSigned {})), "{refused}");
    }

    /// Has the new image run on trial.
    fn exchange(&mut self) {
        self.client.finish_image(&[]).expect("whole");
        self.run_for(EXCHANGE);
        self.meet();
        assert!(matches!(self.runs(), (NEW, ImageState::OnTrial { .. })), "{:?}", self.runs());
    }

    fn meet(&mut self) {
        self.client.reconnect().expect("hello");
        self.client.take_authority().expect("in command");
    }

    fn runs(&mut self) -> (FirmwareVersion, ImageState) {
        let report = self.client.image().expect("a report");
        (report.version, report.state)
    }

    fn done(&self) -> usize {
        self.machine.borrow_mut().flash_operations().len()
    }

    /// Cuts the power in the flash's operation of that number from `before` on, and lets the
    /// board start again.
    fn cut(&mut self, before: usize, operation: usize, seed: u64) {
        let mut machine = self.machine.borrow_mut();
        let begins =
            machine.run_until_flash_operation(before + operation + 1, 2 * EXCHANGE + TRIAL);
        assert!(begins, "there is no operation {operation}");
        machine.cut_power_in_flash_operation(seed);
    }

    /// What runs after a start that may exchange images.
    fn runs_after_exchange(&mut self) -> (FirmwareVersion, ImageState) {
        self.run_for(EXCHANGE);
        self.meet();
        self.runs()
    }

    /// `mgw update`, with a signature or without.
    fn mgw_update(&self, image: &[u8], signature: Option<&[u8]>) -> Result<String, String> {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let file = |end: &str, bytes: &[u8]| {
            let name = format!("mgw-update-{}-{number}.{end}", std::process::id());
            let path: PathBuf = std::env::temp_dir().join(name);
            std::fs::write(&path, bytes).expect("a file");
            path.to_str().expect("text").to_owned()
        };
        let image = file("bin", image);
        let signature = signature.map(|bytes| file("sig", bytes));
        let mut words = vec!["update", &image];
        if let Some(signature) = &signature {
            words.extend(["--signature", signature]);
        }
        let printed = self.mgw(&words);
        for file in [Some(&image), signature.as_ref()].into_iter().flatten() {
            std::fs::remove_file(file).expect("it is there");
        }
        printed
    }

    fn mgw(&self, words: &[&str]) -> Result<String, String> {
        let host = self.outside.hosts[1];
        let transport = Box::new(BoardTransport::new(&self.machine, host));
        let (outcome, printed) = print_on(transport, Interrupt::default(), words);
        match outcome.failure {
            None => Ok(printed),
            Some((_, text)) => Err(text),
        }
    }
}

fn old(lab: &mut Lab) -> FirmwareVersion {
    let (version, state) = lab.runs();
    assert_eq!(state, ImageState::Kept);
    assert!(version < NEW);
    version
}

/// Pieces of three units do not end where a sector does.
#[test]
fn a_piece_that_reaches_into_the_next_sector_has_it_erased() {
    const PIECE: usize = 3 * UNIT;
    let mut lab = written();
    let image = new_image(&mut lab.machine.borrow_mut());
    let other: Vec<u8> = image.iter().map(|byte| !byte).collect();
    lab.announce(&image);
    let page = LAYOUT.flash.page;
    let pieces = other.chunks(PIECE).take(page / PIECE + 2);
    for (offset, piece) in (0..).step_by(PIECE).zip(pieces) {
        lab.client.write_image(offset, piece).expect("written");
    }
    let begins = LAYOUT.areas.update.start + u64::try_from(page).expect("it fits");
    let behind = lab.machine.borrow_mut().read_memory(begins, UNIT);
    assert_eq!(behind, other[page..page + UNIT]);
}

#[test]
fn mgw_update_gives_a_board_another_image_which_is_kept() {
    let began = Instant::now();
    let mut lab = lab();
    let before = old(&mut lab);
    lab.client.release_authority().expect("released");
    let image = new_image(&mut lab.machine.borrow_mut());
    let printed = lab.mgw_update(&image, None);
    let printed = printed.expect("updated");
    assert!(printed.contains("confirmed version 9.8.7 runs, and is kept"), "{printed}");
    lab.meet();
    assert_eq!(lab.runs(), (NEW, ImageState::Kept));
    assert_eq!(lab.client.hello().boot, BootReason::Software);
    lab.machine.borrow_mut().power_cycle(SETTLED);
    lab.run_for(SETTLED);
    lab.meet();
    assert_eq!(lab.runs(), (NEW, ImageState::Kept));
    assert!(before < NEW);
    println!("{:?} for {:?} of virtual time", began.elapsed(), lab.now());
}

#[test]
fn an_image_that_nobody_confirms_runs_for_a_minute_and_is_taken_back() {
    let mut lab = on_trial();
    let ImageState::OnTrial { left_ms } = lab.runs().1 else { panic!("on trial") };
    let refused = lab.client.arm(D5).expect_err("on trial");
    assert!(matches!(refused, ClientError::Gateway(Error::ImageOnTrial {})), "{refused}");
    lab.run_for(Duration::from_millis(left_ms.into()) - SETTLED);
    lab.meet();
    assert_eq!(lab.runs().0, NEW);
    let (version, state) = lab.runs_after_exchange();
    assert_eq!(state, ImageState::RolledBack);
    assert!(version < NEW);
    // The next start changes nothing.
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(SETTLED);
    lab.meet();
    assert_eq!(lab.runs(), (version, ImageState::RolledBack));
}

#[test]
fn an_image_that_fails_at_its_first_instruction_is_taken_back() {
    for first in part_of([UNDEFINED, HANG]) {
        let mut lab = lab();
        let before = old(&mut lab);
        let image = ill_image(&mut lab.machine.borrow_mut(), first);
        lab.write(&image);
        lab.client.finish_image(&[]).expect("whole");
        // One that hangs is ended by the loader's watchdog.
        lab.run_for(2 * EXCHANGE + Duration::from_secs(34));
        lab.meet();
        assert_eq!(lab.runs(), (before, ImageState::RolledBack), "{first:02X?}");
    }
}

/// The image that runs, of another version, with a key or without.
fn image_with_key(machine: &mut Machine, version: FirmwareVersion, key: &Keypair) -> Vec<u8> {
    let mut image = new_image(machine);
    let mut header = Header::of_image(&image).expect("a header");
    (header.version, header.key) = (version, *key.public.as_bytes());
    put_header(&mut image, header);
    image
}

/// A whole image as far as a board that does not run it can tell: what lies behind is cut off.
fn cut_short(image: &[u8]) -> Vec<u8> {
    let mut short = image[..(HEADER_OFFSET + HEADER_SIZE).next_multiple_of(UNIT)].to_vec();
    let length = u32::try_from(short.len()).expect("it fits");
    let header = Header::of_image(image).expect("a header").with_length(length);
    put_header(&mut short, header);
    short
}

/// As docs/update.md has it done: the key's signature of the SHA-512 digest.
fn sign(key: &Keypair, image: &[u8]) -> [u8; SIGNATURE_SIZE] {
    let mut hash = Sha512::new();
    hash.update(image);
    key.sign(&hash.finalize()).to_bytes()
}

/// A board that was flashed by a probe with the same image, which carries a key.
fn lab_with_key(key: &Keypair) -> Lab {
    let mut elf = std::fs::read(image_path().expect("an image")).expect("it is there");
    let is_header = |bytes: &[u8; HEADER_SIZE]| {
        Header::read(bytes).is_ok_and(|header| header.board() == Board::chosen().name())
    };
    let mut places = elf.windows(HEADER_SIZE).enumerate();
    let place = places.find(|(_, bytes)| bytes.first_chunk().is_some_and(is_header));
    let (at, bytes) = place.expect("a header");
    let mut header = Header::read(bytes.first_chunk().expect("as long")).expect("a header");
    header.key = *key.public.as_bytes();
    elf[at..at + HEADER_SIZE].copy_from_slice(&header.to_bytes());
    let file = std::env::temp_dir().join(format!("with-key-{}.elf", std::process::id()));
    std::fs::write(&file, elf).expect("a file");
    let board = Builder::new(&file).expect("an image");
    std::fs::remove_file(&file).expect("it is there");
    let (board, outside, probes) = wire(board, SEED);
    Lab::around(board.power_on(), outside, probes)
}

#[test]
fn a_board_with_a_key_runs_only_what_its_other_half_has_signed() {
    let began = Instant::now();
    let [ours, others] = [[1; 32], [2; 32]].map(|seed| Keypair::from(&seed));
    let mut lab = lab_with_key(&ours);
    let before = old(&mut lab);
    assert!(lab.client.image().expect("a report").needs_signature);
    let new = image_with_key(&mut lab.machine.borrow_mut(), NEW, &ours);
    let short = cut_short(&new);
    let mut wrong = sign(&ours, &short);
    wrong[0] ^= 1;
    lab.assert_not_signed(&short, &[]);
    lab.assert_not_signed(&short, &wrong);
    lab.assert_not_signed(&short, &sign(&others, &short));
    lab.assert_not_signed(&short, &sign(&ours, &new));
    // Whatever key it carries itself.
    let theirs = cut_short(&image_with_key(&mut lab.machine.borrow_mut(), NEW, &others));
    lab.assert_not_signed(&theirs, &sign(&others, &theirs));
    // None of it is run by a start.
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(SETTLED);
    lab.meet();
    assert_eq!(lab.runs(), (before, ImageState::Kept));
    lab.client.release_authority().expect("released");
    lab.mgw_update(&new, Some(&sign(&ours, &new))).expect("updated");
    lab.meet();
    assert_eq!(lab.runs(), (NEW, ImageState::Kept));
    println!("{:?} for {:?} of virtual time", began.elapsed(), lab.now());
}

/// So no board takes a key that nobody can sign for.
#[test]
fn a_key_is_taken_only_with_a_signature_of_its_other_half() {
    let [ours, others] = [[1; 32], [2; 32]].map(|seed| Keypair::from(&seed));
    let mut lab = lab();
    let before = old(&mut lab);
    assert!(!lab.client.image().expect("a report").needs_signature);
    let new = image_with_key(&mut lab.machine.borrow_mut(), NEW, &ours);
    let short = cut_short(&new);
    lab.assert_not_signed(&short, &[]);
    lab.assert_not_signed(&short, &sign(&others, &short));
    assert_eq!(lab.runs(), (before, ImageState::Kept));
    // Whole, as far as a board can tell; it is not let run.
    lab.write(&short);
    lab.client.finish_image(&sign(&ours, &short)).expect("signed");
}

#[test]
fn what_is_damaged_is_not_run() {
    let mut lab = lab();
    let before = old(&mut lab);
    let image = new_image(&mut lab.machine.borrow_mut());
    let length = u32::try_from(MAX_IMAGE_BYTES).expect("few");
    lab.client.take_authority().expect("in command");
    let board = lab.client.hello().board.to_string();
    lab.client.begin_image(&board, NEW, length, 1, false).expect("announced");
    lab.client.write_image(0, &image[..MAX_IMAGE_BYTES]).expect("written");
    let refused = lab.client.finish_image(&[]).expect_err("another checksum");
    assert!(matches!(refused, ClientError::Gateway(Error::ImageDamaged {})), "{refused}");
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(SETTLED);
    lab.meet();
    assert_eq!(lab.runs(), (before, ImageState::Kept));
}

/// What the images' places hold on a board that has the new one written, and on one that runs it.
static CONTENTS: LazyLock<[FlashContents; 2]> = LazyLock::new(|| {
    let places = LAYOUT.areas.all();
    [written(), on_trial()]
        .map(|lab| FlashContents::of(&mut lab.machine.borrow_mut(), &places[..2]))
});

impl Lab {
    /// Asserts that the active and the update area are as before an exchange or after it, where
    /// nobody has come back from one.
    fn assert_images(&mut self, exchanged: bool, came_back: bool) {
        let places = LAYOUT.areas.all();
        let found = FlashContents::of(&mut self.machine.borrow_mut(), &places[..2]);
        let count = if came_back { 1 } else { 2 };
        let expected = &CONTENTS[usize::from(exchanged)];
        let is_equal = found.places[..count] == expected.places[..count];
        assert!(is_equal, "another image, exchanged: {exchanged}");
    }

    /// What must be so after a cut of the mark or the exchange.
    fn check_after_cut(&mut self, operation: usize) {
        let (version, state) = self.runs();
        let all = LAYOUT.marking() + LAYOUT.exchange_operations();
        if operation < LAYOUT.marking() {
            assert!(version < NEW && state == ImageState::Kept, "{operation}: {version} {state:?}");
            self.assert_images(false, false);
        } else if operation + 1 == all && version < NEW {
            // The last word counted all the same, so the cut was one of the trial.
            assert_eq!(state, ImageState::RolledBack, "{operation}");
            self.assert_images(false, true);
        } else {
            // It goes on where it was, and the trial begins.
            let is_on_trial = matches!(state, ImageState::OnTrial { .. });
            assert!(version == NEW && is_on_trial, "{operation}: {version} {state:?}");
            self.assert_images(true, false);
            self.client.confirm_image().expect("on trial");
            assert_eq!(self.runs(), (NEW, ImageState::Kept));
        }
    }

    /// The same of the way back.
    fn check_after_cut_on_way_back(&mut self, operation: usize) {
        let (version, state) = self.runs();
        assert!(version < NEW, "{operation}: {version} {state:?}");
        assert!(!matches!(state, ImageState::OnTrial { .. }), "{operation}: {state:?}");
        self.assert_images(false, true);
    }

    /// The same of the confirmation.
    fn check_after_cut_of_confirmation(&mut self, operation: usize) {
        let (version, state) = self.runs();
        // Once the erasure has begun, nothing is taken back.
        let is_on_trial = matches!(state, ImageState::OnTrial { .. });
        assert!(version == NEW || operation == 0, "{operation}: {version} {state:?}");
        assert!(!is_on_trial, "{operation}: {version} {state:?}");
        self.assert_images(version == NEW, version < NEW);
    }
}

/// A cut while the image is marked, or while the images are exchanged.
fn cut_until_it_runs(operation: usize, seed: u64) {
    let mut lab = written();
    let before = lab.done();
    lab.begin(&FinishImage { signature: Default::default() });
    lab.cut(before, operation, seed);
    lab.run_for(EXCHANGE);
    lab.meet();
    lab.check_after_cut(operation);
}

#[test]
fn a_loss_of_power_until_the_new_image_runs_leaves_the_old_or_goes_on() {
    let (first, page) = (LAYOUT.marking(), LAYOUT.page_operations());
    let steps = [
        // The progress before, the erasure, what counts.
        0,
        1,
        first - 1,
        // An erasure, a word and the count in the second bank, and in the first.
        first,
        first + 7,
        first + page - 1,
        first + page,
        first + page + 7,
        // The last count.
        first + LAYOUT.exchange_operations() - 1,
    ];
    for (step, seed) in part_of(steps.into_iter().zip(1..)) {
        let began = Instant::now();
        cut_until_it_runs(step, seed);
        println!("{step}: {:?}", began.elapsed());
    }
}

#[test]
fn a_loss_of_power_while_it_is_written_leaves_the_old() {
    // An erasure and the words behind it are the first part.
    let second = 1 + MAX_IMAGE_BYTES / LAYOUT.flash.word;
    for (operation, seed) in [(0, 1), (1, 2), (second + 1, 3)] {
        let mut lab = lab();
        let version = old(&mut lab);
        let image = new_image(&mut lab.machine.borrow_mut());
        lab.announce(&image);
        let before = lab.done();
        if operation >= second {
            lab.client.write_image(0, &image[..MAX_IMAGE_BYTES]).expect("written");
            lab.begin(&part(&image, 1));
        } else {
            lab.begin(&part(&image, 0));
        }
        lab.cut(before, operation, seed);
        lab.run_for(SETTLED);
        lab.meet();
        assert_eq!(lab.runs(), (version, ImageState::Kept), "{operation}");
        // What is left does not stand in the way of the next.
        lab.announce(&image);
        lab.client.write_image(0, &image[..MAX_IMAGE_BYTES]).expect("written");
    }
}

impl Lab {
    /// Asks for something, and does not wait for the answer.
    fn begin<C: Call + Serialize>(&mut self, request: &C) {
        self.begin_as(FAR, request);
    }

    /// The same as the request of that number.
    fn begin_as<C: Call + Serialize>(&mut self, number: u16, request: &C) {
        let mut frame = [0; MAX_FRAME];
        let length =
            encode(Kind::Request, number, C::NUMBER, request, &mut frame).expect("it fits");
        let host = self.outside.hosts[0];
        self.machine.borrow_mut().line(host).send(&frame[..length]);
    }
}

#[test]
fn a_loss_of_power_while_the_new_image_is_confirmed_or_taken_back_leaves_one_of_both() {
    for (operation, seed) in part_of((0..LAYOUT.marking()).zip(1..)) {
        let mut lab = on_trial();
        let before = lab.done();
        lab.begin(&ConfirmImage {});
        lab.cut(before, operation, seed);
        lab.run_for(EXCHANGE);
        lab.meet();
        lab.check_after_cut_of_confirmation(operation);
    }
    // On the way back: a page, the count, and the marking.
    let page = LAYOUT.page_operations();
    let back = LAYOUT.exchange_operations();
    let steps = [7, page + 7].into_iter().chain(back..back + LAYOUT.marking());
    for (operation, seed) in part_of(steps.zip(1..)) {
        let mut lab = on_trial();
        let before = lab.done();
        lab.machine.borrow_mut().reset_by_pin();
        lab.cut(before, operation, seed);
        lab.run_for(EXCHANGE);
        lab.meet();
        lab.check_after_cut_on_way_back(operation);
    }
}
