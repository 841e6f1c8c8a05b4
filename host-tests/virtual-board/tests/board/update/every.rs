//! By hand: the power is cut in every operation that an update makes of the flash.
//!
//! One board goes through the whole of it, uncut. In the midst of every operation the process is
//! forked, the child's power is cut there, and what it leaves of the operation is a seed's. The child
//! starts again, and is played until its flash is, bit by bit, that of the uncut run, and until it
//! begins the same operation there. In active, update and state area nothing then tells of the cut:
//! from there on the loader does what it does in the uncut run, as it keeps nothing else over a loss
//! of power. It looks at no other memory, its own RAM is anything by then, and where it stands in a
//! page follows from the words that count. In most cases that is so as soon as the page is erased anew.
//!
//! What the flash is to be is worked out from the operations of the uncut run, and compared with it
//! where each page begins. A child that comes to no such flash is no failure: that cut is played to
//! the very end from a snapshot, with the assertions of the tests of CI, and so is every cut of the
//! words that mark an image, and one of [`STRIDE`] others as a control.
//!
//! `PART=2/8` cuts a part of it, the second of eight, which together are all: each of its operations
//! of pages is eight behind the one before; the words that count and mark are in the first.

use std::fmt::Write as _;
use std::sync::Arc;

use rigless::emulator::Watch;
use virtual_board::machine::{AfterCut, Cut, Expected, FlashContents, FlashOperation};

use super::*;
use crate::part::Part;

/// Of so many operations one is played to its end as a control.
const STRIDE: usize = 997;
/// Of so many one has a snapshot.
const SNAPSHOT_EVERY: usize = 1000;
/// Things that may be left of a word that marks an image.
const MARK_SEEDS: u64 = 4;
/// Until the first operation after a start, and between two: an erasure takes most.
const OPERATION: Duration = Duration::from_secs(5);
/// From a start until the image runs, where nothing is exchanged.
const START: Duration = Duration::from_millis(100);

/// What an operation is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Of a page of an image.
    Page,
    /// The word that counts a page.
    Count,
    /// Says which image is to run.
    Mark,
}

/// Whether a part cuts the operation of this number. Those of which there are few are all of the
/// first.
fn cuts(part: Part, number: usize, kind: Kind) -> bool {
    match kind {
        Kind::Page => part.has(number),
        Kind::Count | Kind::Mark => part.number == 1,
    }
}

impl Layout {
    fn kind(&self, operation: &FlashOperation) -> Kind {
        let state = &self.areas.state;
        if !state.contains(&operation.address) {
            return Kind::Page;
        }
        // What is to be done, whether the progress counts, the progress.
        let first_count = state.start + 2 * self.flash.word as u64;
        let is_count = operation.word.is_some() && operation.address >= first_count;
        if is_count { Kind::Count } else { Kind::Mark }
    }
}

/// What has been done.
#[derive(Debug, Default)]
struct Tally {
    operations: usize,
    cuts: usize,
    equal: usize,
    /// Numbers of operations, and seeds.
    to_play: Vec<(usize, u64)>,
}

/// A run that is cut.
struct Run {
    name: &'static str,
    /// A board that is about to begin, and what its flash has done before.
    begin: fn() -> (Lab, usize),
    /// What must be so in the end.
    check: fn(&mut Lab, usize, u64),
}

/// The mark of the new image and the exchange, up to its trial.
const FORTH: Run = Run {
    name: "mark and exchange",
    begin: || {
        let mut lab = written();
        let before = lab.done();
        lab.begin(&FinishImage { signature: Default::default() });
        (lab, before)
    },
    check: |lab, operation, _| lab.check_after_cut(operation),
};

/// The way back, and what marks its end.
const BACK: Run = Run {
    name: "way back",
    begin: || {
        let lab = on_trial();
        let before = lab.done();
        lab.machine.borrow_mut().reset_by_pin();
        (lab, before)
    },
    check: |lab, operation, _| lab.check_after_cut_on_way_back(operation),
};

/// What keeps the new image.
const CONFIRMATION: Run = Run {
    name: "confirmation",
    begin: || {
        let mut lab = on_trial();
        let before = lab.done();
        lab.begin(&ConfirmImage {});
        (lab, before)
    },
    check: |lab, operation, _| lab.check_after_cut_of_confirmation(operation),
};

/// A run as it goes on, at one of its operations.
struct Walk {
    lab: Lab,
    before: usize,
    operations: Vec<FlashOperation>,
    snapshots: Vec<(usize, Snapshot)>,
    /// What the flash holds before the operation under way.
    contents: FlashContents,
    /// The page under way, as it is when it is erased.
    erased: Vec<Expected>,
}

impl Walk {
    /// Where the uncut run begins, with all of its operations.
    fn new(run: &Run) -> Self {
        let (lab, before) = (run.begin)();
        lab.run_for(EXCHANGE);
        let operations = lab.machine.borrow_mut().flash_operations().split_off(before);
        let (lab, before) = (run.begin)();
        let contents = FlashContents::of(&mut lab.machine.borrow_mut(), &LAYOUT.areas.all());
        lab.watch_entry();
        Self { lab, before, operations, snapshots: Vec::new(), contents, erased: Vec::new() }
    }

    /// Goes on into the midst of an operation.
    fn enter(&mut self, number: usize) {
        let mut machine = self.lab.machine.borrow_mut();
        let under_way = machine.run_into_flash_operation(self.before + number, EXCHANGE);
        let operation = &self.operations[number];
        assert_eq!(under_way.as_ref(), Some(operation), "the same run");
        if operation.word.is_none() {
            let next = self.operations.get(number + 1);
            self.erased = next
                .map(|next| self.after(std::slice::from_ref(operation), next))
                .into_iter()
                .collect();
        } else if number > 0 && self.operations[number - 1].word.is_none() {
            let now = FlashContents::of(&mut machine, &LAYOUT.areas.all());
            assert!(now == self.contents, "operation {number}: the flash is not as worked out");
        }
    }

    /// The flash after these operations, before another.
    fn after(&self, operations: &[FlashOperation], next: &FlashOperation) -> Expected {
        let mut contents = self.contents.clone();
        operations.iter().for_each(|operation| contents.apply(operation, LAYOUT.flash));
        Expected { contents, next: Some((next.address, next.word.is_none())) }
    }

    /// What the flash may be after a cut of the operation under way.
    fn expected(&self, number: usize) -> Vec<Expected> {
        match (LAYOUT.kind(&self.operations[number]), &self.operations[number..]) {
            (Kind::Page, _) => self.erased.clone(),
            // Where the word counts, and where it does not and the page is written anew.
            (Kind::Count, [count, erasure, next, ..]) if LAYOUT.kind(erasure) == Kind::Page => {
                vec![self.after(&[count.clone(), erasure.clone()], next)]
            }
            _ => Vec::new(),
        }
    }

    fn cut(&self, number: usize, cut: Cut) -> AfterCut {
        self.lab.machine.borrow_mut().branch_with_cut(&self.operations[number], cut)
    }

    fn leave(&mut self, number: usize) {
        self.contents.apply(&self.operations[number], LAYOUT.flash);
    }

    fn keep_snapshot(&mut self, number: usize) {
        if number.is_multiple_of(SNAPSHOT_EVERY) {
            let snapshot = self.lab.machine.borrow_mut().snapshot();
            self.snapshots.push((number, snapshot));
        }
    }

    /// Cuts an operation, and plays it to the very end.
    fn play(&self, number: usize, seed: u64) -> Lab {
        let snapshot = self.snapshots.iter().rfind(|(at, _)| *at <= number).expect("the first");
        let (board, outside, probes) = wired(SEED);
        let mut machine = board.resume(&snapshot.1);
        let begins = machine.run_until_flash_operation(self.before + number + 1, EXCHANGE);
        assert!(begins, "there is no operation {number}");
        machine.cut_power_in_flash_operation(seed);
        machine.run_for(EXCHANGE);
        machine.line(outside.hosts[0]).clear();
        let mut lab = Lab::around(machine, outside, probes);
        lab.client.take_authority().expect("in command");
        lab
    }
}

impl Lab {
    /// Notes where an image begins to run.
    fn watch_entry(&self) {
        let mut machine = self.machine.borrow_mut();
        let entry = machine.read_word(LAYOUT.areas.active.start + 4) & !1;
        machine.watch(Watch::Instruction(entry.into()));
    }
}

/// Cuts a run in every operation.
fn cut_everywhere(run: &Run) {
    let began = Instant::now();
    let mut walk = Walk::new(run);
    let part = Part::chosen();
    let mut tally = Tally { operations: walk.operations.len(), ..Tally::default() };
    for number in 0..walk.operations.len() {
        walk.enter(number);
        walk.keep_snapshot(number);
        let expected = Arc::new(walk.expected(number));
        let first = number as u64 * MARK_SEEDS;
        let kind = LAYOUT.kind(&walk.operations[number]);
        let odd = (number / part.of) as u64 % 2;
        let seeds = match kind {
            // Every second one leaves a word of which nothing can be made.
            _ if !cuts(part, number, kind) => first..first,
            Kind::Page => first + odd..first + odd + 1,
            Kind::Count => first..first + 2,
            Kind::Mark => first..first + MARK_SEEDS,
        };
        for seed in seeds {
            tally.cuts += 1;
            let cut = Cut {
                seed,
                expected: Arc::clone(&expected),
                operations: LAYOUT.page_operations() + 4,
                time: 2 * OPERATION,
                defect: None,
            };
            let is_equal = kind != Kind::Mark && {
                let after = walk.cut(number, cut);
                matches!(after, AfterCut::Equal(_))
            };
            tally.equal += usize::from(is_equal);
            if !is_equal || (number / part.of) % STRIDE == STRIDE / 2 {
                tally.to_play.push((number, seed));
            }
        }
        walk.leave(number);
        if number % 1000 == 0 {
            println!("{}: {number} of {}, {:?}", run.name, tally.operations, began.elapsed());
        }
    }
    println!("{}: {} to play, {:?}", run.name, tally.to_play.len(), began.elapsed());
    for &(number, seed) in &tally.to_play {
        println!("{}: operation {number}, seed {seed}", run.name);
        (run.check)(&mut walk.play(number, seed), number, seed);
    }
    tally.print(run.name, began);
}

impl Tally {
    /// A line of power-cuts.txt.
    fn print(&self, what: &str, began: Instant) {
        let mut line = String::new();
        let board = Board::chosen().name();
        let Self { operations, cuts, equal, to_play } = self;
        let Part { number, of } = Part::chosen();
        let minutes = began.elapsed().as_secs().div_ceil(60);
        write!(
            line,
            "{board} | {what:<17} | {number}/{of} | {operations:>10} | {cuts:>6} | {equal:>6} | "
        )
        .expect("text");
        println!("power-cuts: {line}{:>6} | {minutes:>7} | well", to_play.len());
    }
}

#[test]
#[ignore = "takes long: .ci/virtual-board cuts"]
fn a_loss_of_power_at_every_operation_of_an_exchange_leaves_the_old_or_goes_on() {
    cut_everywhere(&FORTH);
}

#[test]
#[ignore = "takes long: .ci/virtual-board cuts"]
fn a_loss_of_power_at_every_operation_of_the_way_back_leaves_the_old() {
    cut_everywhere(&BACK);
}

#[test]
#[ignore = "takes long: .ci/virtual-board cuts"]
fn a_loss_of_power_at_every_operation_of_a_confirmation_leaves_one_of_both() {
    cut_everywhere(&CONFIRMATION);
}

/// While an image is sent nothing but its own place may change: after each cut the loader starts the
/// old one without a word, from an active and a state area that are as they were.
#[test]
#[ignore = "takes long: .ci/virtual-board cuts"]
fn a_loss_of_power_at_every_operation_of_receiving_an_image_leaves_the_old() {
    let began = Instant::now();
    let mut lab = lab();
    let version = old(&mut lab);
    let image = new_image(&mut lab.machine.borrow_mut());
    lab.announce(&image);
    lab.watch_entry();
    let (flash, host) = (LAYOUT.flash, lab.outside.hosts[0]);
    let places = [LAYOUT.areas.active.clone(), LAYOUT.areas.state.clone()];
    let contents = FlashContents::of(&mut lab.machine.borrow_mut(), &places);
    let expected = Arc::new(vec![Expected { contents, next: None }]);
    let (mut tally, chosen) = (Tally::default(), Part::chosen());
    let parts = image.len().div_ceil(MAX_IMAGE_BYTES);
    let mut done = lab.done();
    for number in 0..parts {
        let part = part(&image, number);
        let offset = number * MAX_IMAGE_BYTES;
        let erasures = usize::from(offset.is_multiple_of(flash.page));
        let count = erasures + part.bytes.len().div_ceil(flash.word);
        lab.begin_as(FAR + u16::try_from(number).expect("few"), &part);
        for _ in 0..count {
            done += 1;
            let mut machine = lab.machine.borrow_mut();
            let operation = machine.run_into_flash_operation(done - 1, OPERATION);
            let operation = operation.unwrap_or_else(|| panic!("part {number}"));
            let number = tally.operations;
            tally.operations += 1;
            if !chosen.has(number) {
                continue;
            }
            let seed = (number / chosen.of) as u64;
            let cut = Cut {
                seed,
                expected: Arc::clone(&expected),
                operations: 0,
                time: START,
                defect: None,
            };
            tally.cuts += 1;
            let after = machine.branch_with_cut(&operation, cut);
            assert_eq!(after, AfterCut::Reached(0, Some(0)), "operation {number}");
            tally.equal += 1;
            if tally.cuts % STRIDE == 1 {
                let snapshot = machine.snapshot();
                drop(machine);
                tally.to_play.push((number, seed));
                println!("receiving: part {number} of {parts}, {:?}", began.elapsed());
                let (board, outside, probes) = wired(SEED);
                let mut machine = board.resume(&snapshot);
                machine.cut_power_in_flash_operation(seed);
                machine.run_for(SETTLED);
                machine.line(outside.hosts[0]).clear();
                let mut cut = Lab::around(machine, outside, probes);
                cut.client.take_authority().expect("in command");
                assert_eq!(cut.runs(), (version, ImageState::Kept), "operation {number}");
                // What is left does not stand in the way of the next.
                cut.announce(&image);
                cut.client.write_image(0, &image[..MAX_IMAGE_BYTES]).expect("written");
            }
        }
        let mut machine = lab.machine.borrow_mut();
        let answers = machine.run_until(OPERATION, |machine| machine.line(host).has_received());
        assert!(answers, "part {number}");
        machine.run_for(Duration::from_millis(1));
        machine.line(host).take();
    }
    assert_eq!(lab.done(), done, "operations of the flash");
    lab.exchange();
    tally.print("receiving", began);
}

/// What the comparison is for: it must not take another flash for the same.
#[test]
fn a_flash_that_differs_after_a_cut_is_noticed() {
    let mut walk = Walk::new(&FORTH);
    // In the second page, which lies in the active area.
    let number = LAYOUT.marking() + LAYOUT.page_operations() + 7;
    for earlier in 0..=number {
        // Only the pages' beginnings are looked at.
        if earlier == number || walk.operations[earlier].word.is_none() {
            walk.enter(earlier);
        }
        if earlier < number {
            walk.leave(earlier);
        }
    }
    let page = walk.operations[number].address / LAYOUT.flash.page as u64;
    let own = page * LAYOUT.flash.page as u64 + LAYOUT.flash.page as u64 / 2;
    let [active, update, state] = LAYOUT.areas.all();
    let defects = [
        (None, true),
        // The erasure heals that.
        (Some((own, false)), true),
        (Some((own, true)), false),
        (Some((active.start + 5, false)), false),
        (Some((update.end - 1, false)), false),
        (Some((update.start, false)), false),
        (Some((state.end - 1, false)), false),
    ];
    for (defect, is_equal) in defects {
        let after = walk.cut(
            number,
            Cut {
                seed: 1,
                expected: Arc::new(walk.expected(number)),
                operations: 4,
                time: 2 * OPERATION,
                defect,
            },
        );
        assert_eq!(after == AfterCut::Equal(0), is_equal, "{defect:X?}: {after:?}");
    }
}
