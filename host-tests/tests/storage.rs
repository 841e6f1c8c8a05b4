//! The stored configuration: old or new after a loss of power at any operation of the flash, and
//! what a start makes of it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use config_store::{ConfigStore, LAYOUT};
use embedded_storage_async::nor_flash::NorFlash;
use gateway::{MAX_STORED_ROW, STORED_ROWS, SaveError};
use host_protocol::replies::StoredReport;
use host_protocol::{
    AxisParameter, AxisState, BootReason, BusConfig, Bytes, Change, ClearTarget, Error, Protocol,
    ProtocolSet, StopAction, StopTarget, StoredState, Subject, Text, Value,
};
use mgw_client::{Client, ClientError};
use mgw_sim::flash::{Flash, G474Flash, H743Flash, Storage, at_once, storage};
use mgw_sim::{SimTransport, Station, Wiring, World};

type Rows = BTreeMap<usize, Vec<u8>>;

/// What is stored; nothing where it is nothing.
fn read<S: NorFlash>(store: &mut ConfigStore<S>) -> Result<Rows, StoredState> {
    let digest = match at_once(store.find()) {
        Err(StoredState::Nothing) => return Ok(Rows::new()),
        found => found?,
    };
    let (mut rows, mut from, mut bytes) = (Rows::new(), 0, [0; MAX_STORED_ROW]);
    while let Some((row, length)) =
        at_once(store.next_row(from, &mut bytes)).map_err(|()| StoredState::Damaged)?
    {
        rows.insert(row, bytes[..length].to_vec());
        from = row + 1;
    }
    assert_eq!(digest, sum(&rows), "the number stored with the rows is theirs");
    Ok(rows)
}

fn sum(rows: &Rows) -> u32 {
    rows.values().flatten().map(|byte| u32::from(*byte)).sum()
}

fn save<S: NorFlash>(store: &mut ConfigStore<S>, rows: &Rows) -> Result<(), SaveError> {
    if rows.is_empty() {
        return at_once(store.forget());
    }
    at_once(store.save(sum(rows), &mut |row, out| {
        let bytes = rows.get(&row).map(Vec::as_slice).unwrap_or_default();
        out[..bytes.len()].copy_from_slice(bytes);
        bytes.len()
    }))
}

fn random_rows(random: &mut fastrand::Rng, most: usize) -> Rows {
    let count = random.usize(1..=most);
    let row = |random: &mut fastrand::Rng| {
        let length = random.usize(1..60);
        (random.usize(..STORED_ROWS), (0..length).map(|_| random.u8(..)).collect())
    };
    (0..count).map(|_| row(random)).collect()
}

/// Saves one configuration after the other, or forgets it, and cuts the power at every operation of
/// some of them: what has failed leaves the old. At every second cut it does so at another
/// operation of the save after it too.
fn cut_everywhere<const PAGE: usize, const WORD: usize>(
    pages: usize,
    saves: usize,
    cut: impl Fn(usize) -> bool,
) {
    let end = u32::try_from(pages * PAGE).unwrap();
    let open = |bytes: &[u8]| {
        let mut flash = Flash::<PAGE, WORD>::new(pages);
        flash.bytes().copy_from_slice(bytes);
        ConfigStore::new(flash, 0..end).unwrap()
    };
    let mut random = fastrand::Rng::with_seed(7);
    let (mut old, mut image) = (Rows::new(), vec![0xFF; pages * PAGE]);
    let (mut cuts, mut kept_old, mut kept_new) = (0, 0, 0);
    for number in 0..saves {
        let new =
            if number % 7 == 6 { Rows::new() } else { random_rows(&mut random, STORED_ROWS / 2) };
        let mut whole = open(&image);
        save(&mut whole, &new).unwrap();
        let operations = whole.flash().operations();
        let after_it = whole.flash().bytes().to_vec();
        for at in (0..operations).filter(|_| cut(number)) {
            let mut store = open(&image);
            store.flash().cut_after(at, random.u64(..));
            let result = save(&mut store, &new);
            store.flash().power_on();
            cuts += 1;
            let mut store = open(store.flash().bytes());
            let found = read(&mut store);
            let (counts, kept) = match result {
                Ok(()) => (&new, &mut kept_new),
                Err(SaveError::Failed) => (&old, &mut kept_old),
                Err(error) => panic!("save {number}, cut {at} of {operations}: {error:?}"),
            };
            assert_eq!(found.as_ref(), Ok(counts), "save {number}, cut {at} of {operations}");
            *kept += 1;
            let before = found.unwrap();
            let next = random_rows(&mut random, 4);
            if at % 2 == 0 {
                store.flash().cut_after(random.usize(..40), random.u64(..));
                let result = save(&mut store, &next);
                store.flash().power_on();
                let mut again = open(store.flash().bytes());
                let found = read(&mut again);
                let is_old = found.as_ref() == Ok(&before) && result.is_err();
                assert!(is_old || found.as_ref() == Ok(&next), "{number}, {at}: {found:?}");
                store = again;
            }
            save(&mut store, &next).unwrap();
            assert_eq!(read(&mut store).as_ref(), Ok(&next), "save {number}, cut {at}");
        }
        (old, image) = (new, after_it);
        assert_eq!(read(&mut open(&image)).as_ref(), Ok(&old), "save {number}");
    }
    let kept = format!("{cuts} cuts, {kept_old} old, {kept_new} new");
    assert!(cuts >= 30 && kept_old > 0 && kept_new > 0, "{kept}");
}

#[test]
fn a_power_cut_at_any_operation_of_a_g474_leaves_the_old_or_the_new() {
    // Each page is erased several times.
    cut_everywhere::<2048, 8>(16, 60, |save| !(3..=50).contains(&save));
}

#[test]
fn a_power_cut_at_any_operation_of_an_h743_leaves_the_old_or_the_new() {
    cut_everywhere::<0x2_0000, 32>(2, 8, |save| save != 3);
    // Its words in smaller pages.
    cut_everywhere::<0x4000, 32>(2, 20, |save| save > 15);
}

#[test]
fn the_geometries_are_those_of_the_chips() {
    assert_eq!((G474Flash::WRITE_SIZE, G474Flash::ERASE_SIZE), (8, 2048));
    assert_eq!((H743Flash::WRITE_SIZE, H743Flash::ERASE_SIZE), (32, 131_072));
}

#[test]
fn a_bit_that_flips_brings_back_nothing_older() {
    let (old, new) = (Rows::from([(0, vec![1; 20]), (3, vec![2; 9])]), vec![3; 20]);
    let new = Rows::from([(0, new), (4, vec![4; 7])]);
    let mut store = ConfigStore::new(G474Flash::new(16), 0..16 * 2048).unwrap();
    save(&mut store, &old).unwrap();
    save(&mut store, &new).unwrap();
    let image = store.flash().bytes().to_vec();
    let used = image.iter().rposition(|byte| *byte != 0xFF).expect("something is written") + 1;
    let (mut kept, mut told) = (0, 0);
    for bit in 0..used * 8 {
        let mut flash = G474Flash::new(16);
        flash.bytes().copy_from_slice(&image);
        flash.bytes()[bit / 8] ^= 1 << (bit % 8);
        let mut store = ConfigStore::new(flash, 0..16 * 2048).unwrap();
        match read(&mut store) {
            Ok(rows) => {
                assert_eq!(rows, new, "bit {bit}");
                kept += 1;
            }
            Err(_) => told += 1,
        }
    }
    assert!(kept > 100 && told > 100, "{kept} kept, {told} told");
}

/// The power fails between the two heads, or between two words of the second. Without the rest a
/// bit that flips in the first would bring back something older.
#[test]
fn a_start_writes_the_rest_of_the_second_head() {
    let mut store = ConfigStore::new(Flash::<2048, 8>::new(2), 0..4096).unwrap();
    let new = Rows::from([(0, vec![2; 9])]);
    save(&mut store, &Rows::from([(0, vec![1; 20])])).unwrap();
    save(&mut store, &new).unwrap();
    let whole = store.flash().bytes().to_vec();
    let second_head = 2048 + 32..2048 + 56;
    for written in [0, 8, 16, 24] {
        store.flash().bytes()[second_head.clone()][written..].fill(0xFF);
        assert_eq!(read(&mut store).as_ref(), Ok(&new));
        assert_eq!(store.flash().bytes(), whole, "{written} bytes of the second head");
    }
    // A word that is torn is not written again.
    store.flash().bytes()[second_head].fill(0);
    let torn = store.flash().bytes().to_vec();
    assert_eq!(read(&mut store).as_ref(), Ok(&new));
    assert_eq!(store.flash().bytes(), torn);
}

#[test]
fn what_does_not_fit_leaves_what_was_there() {
    let mut store = ConfigStore::new(Flash::<2048, 8>::new(2), 0..4096).unwrap();
    let rows = Rows::from([(0, vec![1, 2, 3])]);
    save(&mut store, &rows).unwrap();
    let long = (0..30).map(|row| (row, vec![5; 400])).collect();
    assert_eq!(save(&mut store, &long), Err(SaveError::Full));
    assert_eq!(read(&mut store).as_ref(), Ok(&rows));
}

/// The layout byte by byte; one of another version is not misread, and a save replaces it.
#[test]
fn another_layout_is_refused_by_its_version() {
    let mut store = ConfigStore::new(Flash::<2048, 8>::new(4), 0..8192).unwrap();
    save(&mut store, &Rows::from([(0, vec![0xA5]), (5, vec![0x5A])])).unwrap();
    // Layout, number 0, 8 bytes and their CRC-32C, the digest of the core, the CRC-32C of these.
    let head = [
        0x01, 0x00, 0x00, 0x00, 0x00, 0x08, 0x00, 0x00, 0x00, 0x8B, 0xD4, 0x94, 0x70, 0xFF, 0x00,
        0x00, 0x00, 0x1E, 0x6D, 0x5E, 0xF5,
    ];
    // Rows 0 and 5, of one byte each.
    let rows = [0x00, 0x01, 0x00, 0xA5, 0x05, 0x01, 0x00, 0x5A];
    let bytes = store.flash().bytes();
    assert_eq!((LAYOUT, &bytes[..21], &bytes[32..53]), (1, &head[..], &head[..]));
    assert_eq!((&bytes[64..72], bytes[72]), (&rows[..], 0xFF));

    let mut other = ConfigStore::new(Flash::<2048, 8>::new(4), 0..8192).unwrap();
    let head = [
        0x09, 0x05, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
        0x00, 0x00, 0xB9, 0xD1, 0xFF, 0x45,
    ];
    other.flash().bytes()[4096..4117].copy_from_slice(&head);
    assert_eq!(at_once(other.find()), Err(StoredState::OtherLayout { layout: 9 }));
    save(&mut other, &Rows::from([(1, vec![7])])).unwrap();
    assert_eq!(read(&mut other), Ok(Rows::from([(1, vec![7])])));
    assert_eq!(other.flash().bytes()[1..5], [6, 0, 0, 0], "the next number, in the other area");
}

/// A gateway with a storage, and a host.
struct Bench {
    world: Rc<RefCell<World>>,
    client: Client<SimTransport>,
}

impl Bench {
    fn new(storage: Storage) -> Self {
        let mut world = World::new(Wiring::four_motors());
        world.set_storage(storage);
        let world = Rc::new(RefCell::new(world));
        let client = Client::connect(SimTransport::new(world.clone(), 0)).unwrap();
        Self { world, client }
    }

    fn start(&mut self, boot: BootReason) {
        self.world.borrow_mut().trace();
        self.world.borrow_mut().reset(boot, "");
        self.client = Client::connect(SimTransport::new(self.world.clone(), 0)).unwrap();
    }

    fn configure(&mut self) {
        self.client.take_authority().unwrap();
        let protocols = ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]);
        let config =
            BusConfig { bitrate: 1_000_000, protocols, exclusive: false, reply_window_us: 5_000 };
        let set = |parameter: AxisParameter, value| Change::Axis {
            axis: 0,
            parameter: parameter.number(),
            value: Some(value),
        };
        self.client.begin_changes().unwrap();
        self.client
            .add_changes(&[
                Change::Bus { bus: 0, config: Some(config) },
                set(AxisParameter::Bus, Value::Unsigned(0)),
                set(AxisParameter::Protocol, Value::Unsigned(Protocol::Rmd as u32)),
                set(AxisParameter::Node, Value::Unsigned(1)),
                set(AxisParameter::StopAction, Value::Unsigned(StopAction::Coast as u32)),
            ])
            .unwrap();
        self.client
            .add_changes(&[set(AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true))])
            .unwrap();
        self.client.apply_changes().unwrap();
        self.rest();
    }

    fn rest(&mut self) {
        self.world.borrow_mut().run_for(Duration::from_millis(200));
    }

    fn stored(&mut self) -> StoredState {
        let StoredReport { state, saving } = self.client.read_stored().unwrap();
        assert!(!saving);
        state
    }

    fn axes(&mut self) -> usize {
        self.client.list_axes().unwrap().len()
    }
}

fn refused<T: std::fmt::Debug>(result: Result<T, ClientError>) -> Error {
    match result {
        Err(ClientError::Gateway(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_loss_of_power_brings_the_stored_configuration_and_stops_its_axes_first() {
    let mut bench = Bench::new(storage(None).unwrap());
    assert_eq!(bench.stored(), StoredState::Nothing);
    bench.configure();
    bench.client.save_configuration().unwrap();
    assert_eq!(bench.stored(), StoredState::Kept { differs: false });
    // What changes after the save is lost with the power.
    let limit = AxisParameter::VelocityLimitRadS;
    bench.client.configure_axis(0, limit, Value::Float(3.0)).unwrap();
    assert_eq!(bench.stored(), StoredState::Kept { differs: true });
    bench.start(BootReason::PowerOn);
    let trace = bench.world.borrow_mut().trace();
    let first = trace.iter().find(|entry| entry.from == Station::Gateway).expect("a frame");
    assert!(format!("{first:?}").contains("141#8000000000000000"), "{first:?}");
    bench.rest();
    assert_eq!(bench.stored(), StoredState::Kept { differs: false });
    assert_eq!(bench.axes(), 1);
    let report = bench.client.read_state(0).unwrap();
    assert_eq!(report.state, AxisState::Idle);
    assert_eq!(bench.client.read_axis_parameter(0, limit).unwrap(), None);
    assert!(!bench.client.gateway_status().unwrap().e_stop_latched);
    bench.client.take_authority().unwrap();
    bench.client.arm(0).unwrap();
}

#[test]
fn names_are_stored_with_what_they_name() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    bench.client.save_configuration().unwrap();
    let subjects =
        [(Subject::Gateway, "arm-2_B"), (Subject::Bus(0), "line"), (Subject::Axis(0), "left")];
    for (of, name) in subjects {
        let name = Some(Text::try_from(name).unwrap());
        bench.client.begin_changes().unwrap();
        bench.client.add_changes(&[Change::Name { of, name }]).unwrap();
        bench.client.apply_changes().unwrap();
        assert_eq!(bench.stored(), StoredState::Kept { differs: true }, "{of}");
        bench.client.save_configuration().unwrap();
        assert_eq!(bench.stored(), StoredState::Kept { differs: false }, "{of}");
    }
    bench.start(BootReason::PowerOn);
    bench.rest();
    assert_eq!(bench.stored(), StoredState::Kept { differs: false });
    let names = bench.client.names().unwrap();
    let names: Vec<_> = names.iter().map(|named| (named.of, named.name.as_str())).collect();
    assert_eq!(names, subjects);
}

/// SR (thruster manual §2.5): the gateway counts from then on what the motor sends by itself.
#[test]
fn what_a_native_command_changes_of_a_row_is_stored_with_it() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    let set = |parameter: AxisParameter, value| Change::Axis {
        axis: 1,
        parameter: parameter.number(),
        value: Some(Value::Unsigned(value)),
    };
    bench.client.begin_changes().unwrap();
    bench
        .client
        .add_changes(&[
            set(AxisParameter::Bus, 0),
            set(AxisParameter::Protocol, Protocol::Thruster as u32),
            set(AxisParameter::Node, 0x0B),
            set(AxisParameter::StopAction, StopAction::Coast as u32),
        ])
        .unwrap();
    bench.client.apply_changes().unwrap();
    bench.rest();
    bench.client.save_configuration().unwrap();
    let stream = Bytes::from_slice(&[0x53, 0x52, 0, 0, 0, 1, 0, 100]).unwrap();
    for differs in [true, false] {
        bench.client.native(1, 0, stream.clone(), Duration::from_millis(100)).unwrap();
        assert_eq!(bench.stored(), StoredState::Kept { differs });
        bench.client.save_configuration().unwrap();
        assert_eq!(bench.stored(), StoredState::Kept { differs: false });
    }
    bench.start(BootReason::PowerOn);
    bench.rest();
    assert_eq!((bench.stored(), bench.axes()), (StoredState::Kept { differs: false }, 2));
    let word = bench.client.read_axis_parameter(1, AxisParameter::Stream).unwrap();
    assert_eq!(word, Some(Value::Unsigned(0x0001_0064)));
}

#[test]
fn after_a_reset_the_running_configuration_counts() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    bench.client.save_configuration().unwrap();
    bench.client.remove_axis(0).unwrap();
    bench.start(BootReason::Pin);
    assert_eq!(bench.stored(), StoredState::Kept { differs: true });
    assert_eq!(bench.axes(), 0);
}

#[test]
fn what_was_forgotten_does_not_come_back_and_what_runs_stays() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    bench.client.save_configuration().unwrap();
    bench.client.forget_stored().unwrap();
    assert_eq!((bench.stored(), bench.axes()), (StoredState::Nothing, 1));
    bench.start(BootReason::PowerOn);
    assert_eq!((bench.stored(), bench.axes()), (StoredState::Nothing, 0));
}

#[test]
fn nothing_is_saved_while_an_axis_may_move() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    bench.client.arm(0).unwrap();
    let state = AxisState::Armed;
    assert_eq!(refused(bench.client.save_configuration()), Error::NotIdle { axis: 0, state });
    assert_eq!(refused(bench.client.forget_stored()), Error::NotIdle { axis: 0, state });
    bench.client.estop().unwrap();
    let error = refused(bench.client.save_configuration());
    assert!(matches!(error, Error::NotIdle { axis: 0, state: AxisState::Tripped { .. } }));
    bench.rest();
    bench.client.clear(ClearTarget::Gateway).unwrap();
    bench.client.clear(ClearTarget::Axis(0)).unwrap();
    bench.client.stop(StopTarget::All).unwrap();
    bench.rest();
    bench.client.save_configuration().unwrap();
}

#[test]
fn without_a_storage_a_save_is_refused_by_name() {
    let world = Rc::new(RefCell::new(World::new(Wiring::four_motors())));
    let mut client = Client::connect(SimTransport::new(world.clone(), 0)).unwrap();
    assert_eq!(client.read_stored().unwrap().state, StoredState::NoStorage);
    assert_eq!(refused(client.save_configuration()), Error::NoStorage {});
}

/// A byte of each row is turned over, one after the other.
#[test]
fn a_damaged_storage_configures_nothing_and_says_so() {
    let mut bench = Bench::new(storage(None).unwrap());
    bench.configure();
    bench.client.save_configuration().unwrap();
    let whole = {
        let mut world = bench.world.borrow_mut();
        world.storage().unwrap().flash().bytes().to_vec()
    };
    let used: Vec<usize> = (0..2048).filter(|at| whole[*at] != 0xFF).collect();
    let (mut damaged, mut sound) = (0, 0);
    for at in used.into_iter().step_by(3) {
        {
            let mut world = bench.world.borrow_mut();
            let bytes = world.storage().unwrap().flash().bytes();
            bytes.copy_from_slice(&whole);
            bytes[at] ^= 0x10;
        }
        bench.start(BootReason::PowerOn);
        bench.rest();
        match (bench.stored(), bench.axes()) {
            (StoredState::Kept { differs: false }, 1) => sound += 1,
            (StoredState::Damaged | StoredState::Nothing, 0) => damaged += 1,
            other => panic!("byte {at}: {other:?}"),
        }
    }
    assert!(damaged > 10 && damaged > sound, "{damaged} {sound}");
    // A save mends it.
    bench.configure();
    bench.client.save_configuration().unwrap();
    bench.start(BootReason::PowerOn);
    assert_eq!((bench.stored(), bench.axes()), (StoredState::Kept { differs: false }, 1));
}

/// A board that refuses what is stored as it would from a host runs none of it.
#[test]
fn what_this_gateway_refuses_is_not_taken_in_part() {
    let mut store = storage(None).unwrap();
    // Axis 0 on bus 0, and axis 1 on a bus that there is not.
    let bus = vec![1, 0, 1, 0xC0, 0x84, 0x3D, 1, 0, 0x88, 0x27];
    let of = |bus| vec![2, 0, 1, 1, 1, bus];
    let rows = Rows::from([(1, bus), (5, of(0)), (6, of(9))]);
    save(&mut store, &rows).unwrap();
    let mut bench = Bench::new(store);
    assert!(matches!(bench.stored(), StoredState::Refused { .. }), "{:?}", bench.stored());
    assert_eq!(bench.axes(), 0);
    assert_eq!(bench.client.bus_status(0).unwrap().config, None);
}

/// The power fails at every operation of a save that a host asked for.
#[test]
fn a_host_that_loses_its_board_in_a_save_finds_the_old_or_the_new_configuration() {
    let limit = AxisParameter::VelocityLimitRadS;
    let (mut old, mut new) = (0, 0);
    for cut in 0.. {
        let mut bench = Bench::new(storage(None).unwrap());
        bench.configure();
        bench.client.save_configuration().unwrap();
        bench.client.configure_axis(0, limit, Value::Float(3.0)).unwrap();
        bench.world.borrow_mut().storage().unwrap().flash().cut_after(cut, cut as u64);
        let whole = match bench.client.save_configuration() {
            Ok(()) => true,
            Err(ClientError::Gateway(Error::SaveFailed {})) => false,
            other => panic!("{other:?}"),
        };
        bench.world.borrow_mut().storage().unwrap().flash().power_on();
        bench.start(BootReason::PowerOn);
        assert_eq!((bench.stored(), bench.axes()), (StoredState::Kept { differs: false }, 1));
        match bench.client.read_axis_parameter(0, limit).unwrap() {
            None => old += 1,
            Some(value) => {
                assert_eq!(value, Value::Float(3.0));
                new += 1;
            }
        }
        if whole {
            break;
        }
    }
    assert!(old > 5 && new > 0, "{old} {new}");
}
