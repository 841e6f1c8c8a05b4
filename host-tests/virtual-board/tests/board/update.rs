//! Another image over a host link: by the code of `mgw`, on trial, kept or taken back, whatever becomes
//! of the supply meanwhile.

/// The NUCLEO-G474RE takes none.
mod only_h743 {
    use std::path::PathBuf;
    use std::sync::LazyLock;
    use std::time::{Duration, Instant};

    use firmware_image::{CHECKSUM, HEADER_OFFSET, Header, UNIT};
    use host_protocol::requests::{ConfirmImage, FinishImage, WriteImage};
    use host_protocol::{
        BootReason, Call, Error, FirmwareVersion, ImageState, Kind, MAX_FRAME, MAX_IMAGE_BYTES,
        encode,
    };
    use mgw_cli::print_on;
    use mgw_client::{ClientError, Interrupt};
    use serde::Serialize;
    use virtual_board::machine::{Machine, Snapshot};
    use virtual_board::transport::BoardTransport;

    use crate::lab::{D5, Lab, SEED, wired};

    const ACTIVE: u64 = 0x0802_0000;
    const ROOM: usize = 512 << 10;
    /// The new one.
    const NEW: FirmwareVersion = FirmwareVersion { major: 9, minor: 8, patch: 7 };
    /// For an exchange, with what comes before and after.
    const EXCHANGE: Duration = Duration::from_secs(25);
    /// How long a trial lasts.
    const TRIAL: Duration = Duration::from_secs(60);
    /// For every first stop to be confirmed.
    const SETTLED: Duration = Duration::from_millis(500);
    /// Words of an image's page, with its erasure and the word that counts it.
    const PAGE_OPERATIONS: usize = (128 << 10) / 32 + 2;
    /// Marking, by the image that runs or by the loader: what was before no longer counts, the
    /// erasure, what counts now.
    const MARKING: usize = 3;
    /// Both ways of four pages.
    const EXCHANGE_OPERATIONS: usize = 2 * 4 * PAGE_OPERATIONS;

    /// A number of requests beyond what a client that goes on has reached.
    const FAR: u16 = 0x7000;
    /// `B .`
    const HANG: [u8; 2] = [0xFE, 0xE7];
    /// `UDF #0`
    const UNDEFINED: [u8; 2] = [0x00, 0xDE];

    /// The image that runs, with another version.
    fn new_image(machine: &mut Machine) -> Vec<u8> {
        let mut image = machine.read_memory(ACTIVE, ROOM);
        let mut header = Header::of_image(&image).expect("a header");
        let length = usize::try_from(header.length).expect("it fits");
        image.truncate(length);
        image.resize(length.next_multiple_of(UNIT), 0xFF);
        header.version = NEW;
        let bytes = header.to_bytes();
        image[HEADER_OFFSET..HEADER_OFFSET + bytes.len()].copy_from_slice(&bytes);
        image
    }

    /// The same with other first instructions.
    fn ill_image(machine: &mut Machine, first: [u8; 2]) -> Vec<u8> {
        let mut image = new_image(machine);
        let entry = u32::from_le_bytes(image[4..8].try_into().expect("a word")) & !1;
        let at = usize::try_from(u64::from(entry) - ACTIVE).expect("in the image");
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
        lab.client.release_authority().expect("released");
        let mut machine = lab.machine.borrow_mut();
        machine.snapshot()
    });

    fn written() -> Lab {
        let (board, outside, probes) = wired(SEED);
        let mut lab = Lab::around(board.resume(&WRITTEN), outside, probes);
        lab.client.take_authority().expect("in command");
        lab
    }

    /// The same when it runs on trial.
    static ON_TRIAL: LazyLock<Snapshot> = LazyLock::new(|| {
        let mut lab = written();
        lab.exchange();
        lab.client.release_authority().expect("released");
        let mut machine = lab.machine.borrow_mut();
        machine.snapshot()
    });

    fn on_trial() -> Lab {
        let (board, outside, probes) = wired(SEED);
        let mut lab = Lab::around(board.resume(&ON_TRIAL), outside, probes);
        lab.client.take_authority().expect("in command");
        lab
    }

    impl Lab {
        fn write(&mut self, image: &[u8]) {
            let length = u32::try_from(image.len()).expect("it fits");
            self.client.take_authority().expect("in command");
            let board = self.client.hello().board.to_string();
            self.client
                .begin_image(&board, NEW, length, CHECKSUM.checksum(image), false)
                .expect("announced");
            for (offset, part) in (0..).step_by(MAX_IMAGE_BYTES).zip(image.chunks(MAX_IMAGE_BYTES))
            {
                self.client.write_image(offset, part).expect("written");
            }
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

    #[test]
    fn mgw_update_gives_a_board_another_image_which_is_kept() {
        let began = Instant::now();
        let mut lab = lab();
        let before = old(&mut lab);
        lab.client.release_authority().expect("released");
        let image = new_image(&mut lab.machine.borrow_mut());
        let file: PathBuf =
            std::env::temp_dir().join(format!("mgw-update-{}.bin", std::process::id()));
        std::fs::write(&file, &image).expect("a file");
        let printed = lab.mgw(&["update", file.to_str().expect("text")]);
        std::fs::remove_file(&file).expect("it is there");
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
        for first in [UNDEFINED, HANG] {
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

    /// A cut while the image is written, while it is marked, while the images are exchanged.
    fn cut_until_it_runs(operation: usize, seed: u64) {
        let mut lab = written();
        let before = lab.done();
        lab.begin(&FinishImage { signature: Default::default() });
        lab.cut(before, operation, seed);
        let (version, state) = lab.runs_after_exchange();
        if operation < MARKING {
            assert!(version < NEW && state == ImageState::Kept, "{operation}: {version} {state:?}");
        } else if operation + 1 == MARKING + EXCHANGE_OPERATIONS && version < NEW {
            // The last word counted all the same, so the cut was one of the trial.
            assert_eq!(state, ImageState::RolledBack, "{operation}");
        } else {
            // It goes on where it was, and the trial begins.
            let is_on_trial = matches!(state, ImageState::OnTrial { .. });
            assert!(version == NEW && is_on_trial, "{operation}: {version} {state:?}");
            lab.client.confirm_image().expect("on trial");
            assert_eq!(lab.runs(), (NEW, ImageState::Kept));
        }
    }

    #[test]
    fn a_loss_of_power_until_the_new_image_runs_leaves_the_old_or_goes_on() {
        let first = MARKING;
        let steps = [
            // The progress before, the erasure, what counts.
            0,
            1,
            2,
            // An erasure, a word and the count in the second bank, and in the first.
            first,
            first + 7,
            first + PAGE_OPERATIONS - 1,
            first + PAGE_OPERATIONS,
            first + PAGE_OPERATIONS + 7,
            // The last count.
            first + EXCHANGE_OPERATIONS - 1,
        ];
        for (step, seed) in steps.into_iter().zip(1..) {
            let began = Instant::now();
            cut_until_it_runs(step, seed);
            println!("{step}: {:?}", began.elapsed());
        }
    }

    #[test]
    fn a_loss_of_power_while_it_is_written_leaves_the_old() {
        for (operation, seed) in [(0, 1), (1, 2), (6, 3)] {
            let mut lab = lab();
            let version = old(&mut lab);
            let image = new_image(&mut lab.machine.borrow_mut());
            lab.client.take_authority().expect("in command");
            let board = lab.client.hello().board.to_string();
            let length = u32::try_from(image.len()).expect("it fits");
            let checksum = CHECKSUM.checksum(&image);
            lab.client.begin_image(&board, NEW, length, checksum, false).expect("announced");
            let before = lab.done();
            if operation > 4 {
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
            lab.client.begin_image(&board, NEW, length, checksum, false).expect("announced");
            lab.client.write_image(0, &image[..MAX_IMAGE_BYTES]).expect("written");
        }
    }

    impl Lab {
        /// Asks for something, and does not wait for the answer.
        fn begin<C: Call + Serialize>(&mut self, request: &C) {
            let mut frame = [0; MAX_FRAME];
            let length =
                encode(Kind::Request, FAR, C::NUMBER, request, &mut frame).expect("it fits");
            let host = self.outside.hosts[0];
            self.machine.borrow_mut().line(host).send(&frame[..length]);
        }
    }

    #[test]
    fn a_loss_of_power_while_the_new_image_is_confirmed_or_taken_back_leaves_one_of_both() {
        for (operation, seed) in (0..MARKING).zip(1..) {
            let mut lab = on_trial();
            let before = lab.done();
            lab.begin(&ConfirmImage {});
            lab.cut(before, operation, seed);
            let (version, state) = lab.runs_after_exchange();
            // Once the erasure has begun, nothing is taken back.
            let is_on_trial = matches!(state, ImageState::OnTrial { .. });
            assert!(version == NEW || operation == 0, "{operation}: {version} {state:?}");
            assert!(!is_on_trial, "{operation}: {version} {state:?}");
        }
        // On the way back: a page, the count, and the marking.
        let back = EXCHANGE_OPERATIONS;
        for (operation, seed) in
            [7, PAGE_OPERATIONS + 7, back, back + 1, back + 2].into_iter().zip(1..)
        {
            let mut lab = on_trial();
            let before = lab.done();
            lab.machine.borrow_mut().reset_by_pin();
            lab.cut(before, operation, seed);
            let (version, state) = lab.runs_after_exchange();
            assert!(version < NEW, "{operation}: {version} {state:?}");
            assert!(!matches!(state, ImageState::OnTrial { .. }), "{operation}: {state:?}");
        }
    }

    /// By hand: each operation of an update from its mark on, or each of a stride.
    #[test]
    #[ignore = "takes hours: .ci/virtual-board test --test board -- --ignored every_operation"]
    fn a_loss_of_power_at_every_operation_of_an_update_leaves_the_old_or_goes_on() {
        let stride =
            std::env::var("STRIDE").ok().map_or(997, |text| text.parse().expect("a number"));
        let all = MARKING + EXCHANGE_OPERATIONS;
        for (operation, seed) in (0..all).step_by(stride).zip(1..) {
            cut_until_it_runs(operation, seed);
            println!("{operation} of {all}: well");
        }
    }
}
