//! The configuration that outlives a loss of power: its rows as bytes, and what is stored of them.
//!
//! A row is a sequence of changes, as a host would send them: those that make it of nothing.
//! Whoever runs the core keeps the bytes; the core does not know where.

use super::Gateway;
use super::names::subject_of;
use super::requests::{Authority, Result};
use crate::axis::{Axis, Is};
use crate::bus::Bus;
use crate::outbox::Ticket;
use crate::port::{Found, Save, SaveError};
use crate::set::Set;
use crate::time::Instant;
use crate::{MAX_AXES, MAX_BUSES};
use core::ops::Range;
use host_protocol::{
    AxisParameter, CHECKSUM, Change, Error, GatewayParameter, MAX_NAME, Reply, StoredState,
    Subject, replies,
};
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// Rows of a configuration: the gateway, its buses, its axes.
pub const STORED_ROWS: usize = AXIS_ROWS.end;
/// Longest row, bytes.
pub const MAX_STORED_ROW: usize = 512;

/// The rows of buses and of axes, behind that of the gateway.
pub(super) const BUS_ROWS: Range<usize> = 1..1 + MAX_BUSES;
pub(super) const AXIS_ROWS: Range<usize> = BUS_ROWS.end..BUS_ROWS.end + MAX_AXES;
/// The kinds of change, the axis, the parameter, a value: its place and 5 bytes.
const CHANGE_BYTES: usize = 10;
/// The kinds of change and of what is named, its number, whether there is a name, and that.
const NAME_BYTES: usize = 5 + MAX_NAME;
const _: () =
    assert!(AxisParameter::ALL.len() * CHANGE_BYTES + NAME_BYTES <= MAX_STORED_ROW, "a row fits");

/// Writes the next row that is stored and returns its bytes; nothing after the last.
pub type NextRow<'a> = &'a mut dyn FnMut(&mut [u8; MAX_STORED_ROW]) -> Option<Result<usize, ()>>;

/// What is stored, as far as the core knows.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Stored {
    state: Found,
    /// The checksum of each row of the running configuration, 0 where it is empty. So a row that
    /// changes costs a look at that row.
    #[serde(with = "BigArray")]
    rows: [u32; STORED_ROWS],
    /// Who waits for what is being stored.
    saving: Option<Saving>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Saving {
    save: Save,
    ticket: Ticket,
    is_taken: bool,
}

impl Stored {
    pub const fn new() -> Self {
        Self { state: Err(StoredState::NoStorage), rows: [0; STORED_ROWS], saving: None }
    }

    /// Whether something is to be stored that nobody has taken yet.
    pub fn is_due(&self) -> bool {
        self.saving.as_ref().is_some_and(|saving| !saving.is_taken)
    }

    /// Whether something is being stored.
    pub fn is_saving(&self) -> bool {
        self.saving.is_some()
    }

    /// The digest of the running configuration: the sum of the checksums of its rows.
    fn digest(&self) -> u32 {
        self.rows.iter().fold(0, |sum, row| sum.wrapping_add(*row))
    }
}

impl Gateway {
    /// Takes over the configuration that is stored, and stops each of its axes, unless a reset has
    /// left the running one: that one counts, and of what is stored only what damage has taken of
    /// it. Once, behind [`restore`](Self::restore); where nothing
    /// [was remembered](Self::is_remembered), before the first event. `next` writes one row after
    /// the other, in the order of their numbers, and returns the bytes of each; nothing after the
    /// last; `Err` where a row cannot be read.
    ///
    /// What cannot be read whole, or would be refused from a host, is left out as a whole, and
    /// [`ReadStored`](host_protocol::Request::ReadStored) says so.
    pub fn load(&mut self, now: Instant, found: Found, next: NextRow<'_>) {
        self.stored.state = found;
        let Ok(digest) = found else { return };
        if self.retention.is_of_a_run() {
            return self.find_lost(now, next);
        }
        self.stored.state = match self.load_rows(now, next) {
            Ok(()) if self.stored.digest() != digest => Err(StoredState::Damaged),
            loaded => loaded.map(|()| digest),
        };
        if self.stored.state.is_err() {
            self.forget_configuration(now);
        }
        self.retention.together = true;
        self.settle(now);
        self.each_axis(now, self.axes.which(Is::Configured), |axis, out| axis.halt(now, out));
        self.settle(now);
    }

    /// Makes the changes of all rows, or returns why not.
    fn load_rows(&mut self, now: Instant, next: NextRow<'_>) -> Result<(), StoredState> {
        let mut row = [0; MAX_STORED_ROW];
        while let Some(length) = next(&mut row) {
            let row = length.ok().and_then(|length| row.get(..length));
            self.load_row(now, row.ok_or(StoredState::Damaged)?, false)?;
        }
        Ok(())
    }

    /// Takes over what a damaged memory has lost, so that its motors are stopped: they may be in
    /// motion. What does not fit beside the rest stays lost.
    fn find_lost(&mut self, now: Instant, next: NextRow<'_>) {
        let mut row = [0; MAX_STORED_ROW];
        while self.retention.has_lost()
            && let Some(Ok(length)) = next(&mut row)
        {
            let _ = self.load_row(now, row.get(..length).unwrap_or_default(), true);
        }
    }

    /// Makes the changes of a row, or of one that is lost only.
    fn load_row(&mut self, now: Instant, mut row: &[u8], lost: bool) -> Result<(), StoredState> {
        let refused = |error: Error| StoredState::Refused { error: error.number() };
        self.draft.open();
        while !row.is_empty() {
            let (change, rest) =
                postcard::take_from_bytes::<Change>(row).map_err(|_| StoredState::Damaged)?;
            if lost && !self.retention.has_lost_of(&change) {
                break;
            }
            let unserved = match &change {
                Change::Bus { bus, config: Some(config) } => self.restore_unserved(*bus, *config),
                _ => None,
            };
            unserved.unwrap_or_else(|| self.add_changes(&[change])).map_err(refused)?;
            row = rest;
        }
        self.apply_changes(now).map_err(refused)
    }

    fn forget_configuration(&mut self, now: Instant) {
        for axis in 0..crate::MAX_AXES_WIRE {
            let _ = self.remove_axis(now, axis);
        }
        self.draft.open();
        (0u8..).take(self.buses.len()).for_each(|bus| self.draft.set_bus(bus, None));
        self.draft.silence = Some(Authority::new().silence);
        let _ = self.add_name(Subject::Gateway, None);
        let _ = self.apply_changes(now);
    }

    /// What is to be stored, once. [`Event::Saved`](crate::Event::Saved) says that it has been;
    /// until then the configuration stays as it is, and nothing is armed.
    pub fn take_save(&mut self) -> Option<Save> {
        let saving = self.stored.saving.as_mut().filter(|saving| !saving.is_taken)?;
        saving.is_taken = true;
        Some(saving.save.clone())
    }

    /// Writes a row of the running configuration, below [`STORED_ROWS`], and returns its bytes: 0
    /// where nothing is set.
    pub fn stored_row(&self, row: usize, out: &mut [u8; MAX_STORED_ROW]) -> usize {
        let mut length = 0;
        let mut add = |change: Change| {
            let rest = out.get_mut(length..).unwrap_or_default();
            length += postcard::to_slice(&change, rest).map_or(0, |bytes| bytes.len());
        };
        let of = subject_of(row);
        match of {
            Subject::Gateway => {
                let parameter = GatewayParameter::LinkSilenceUs.number();
                if let Ok(value) = self.gateway_parameter(parameter) {
                    add(Change::Gateway { parameter, value });
                }
            }
            Subject::Bus(bus) => {
                if let Some(config) = self.bus(bus).ok().and_then(Bus::config) {
                    add(Change::Bus { bus, config: Some(*config) });
                }
            }
            Subject::Axis(axis) => {
                let Ok(Axis { config, .. }) = self.axis(axis) else { return 0 };
                for parameter in AxisParameter::ALL.iter().filter(|one| config.is_set(**one)) {
                    let (parameter, value) = (parameter.number(), config.get(*parameter));
                    add(Change::Axis { axis, parameter, value });
                }
            }
        }
        if let Some(name) = self.name_of(of) {
            add(Change::Name { of, name: Some(name) });
        }
        length
    }

    /// Works out the checksums of rows anew.
    pub(crate) fn measure(&mut self, buses: Set, axes: Set, gateway: bool) {
        let mut bytes = [0; MAX_STORED_ROW];
        let gateway = gateway.then_some(0).into_iter();
        let buses = (0..MAX_BUSES).filter(|bus| buses.has(*bus)).map(|bus| bus + BUS_ROWS.start);
        let axes = (0..MAX_AXES).filter(|axis| axes.has(*axis)).map(|axis| axis + AXIS_ROWS.start);
        for row in gateway.chain(buses).chain(axes) {
            let length = self.stored_row(row, &mut bytes);
            let of_it = bytes.get(..length).filter(|row| !row.is_empty());
            if let Some(checksum) = self.stored.rows.get_mut(row) {
                *checksum = of_it.map_or(0, |row| CHECKSUM.checksum(row));
            }
        }
    }

    /// All of them: what a reset has left came another way.
    pub(crate) fn measure_configuration(&mut self) {
        self.measure(Set::ALL, Set::ALL, true);
    }

    /// The digest of the running configuration, with what motors have been told meanwhile.
    fn digest(&mut self) -> u32 {
        let told = self.axes.those(Set::ALL, |axis| axis.row_was_told);
        if !told.is_empty() {
            self.axes.each(told, |axis| axis.row_was_told = false);
            self.measure(Set::NONE, told, false);
        }
        self.stored.digest()
    }

    /// Has the running configuration stored, or what is stored forgotten.
    pub(crate) fn save_configuration(&mut self, keep: bool, ticket: Ticket) -> Result<()> {
        match self.stored.state {
            Err(StoredState::NoStorage) => return Err(Error::NoStorage {}),
            Err(StoredState::SingleBank) => return Err(Error::SingleBank {}),
            _ => {}
        }
        self.check_at_rest()?;
        let digest = self.digest();
        if cfg!(debug_assertions) {
            self.measure_configuration();
            assert_eq!(digest, self.stored.digest(), "a row has changed unnoticed");
        }
        let save = if keep { Save::Rows { digest } } else { Save::Nothing };
        self.store(save, ticket);
        Ok(())
    }

    /// Has something stored; whoever asked for it is answered when it is.
    pub(crate) fn store(&mut self, save: Save, ticket: Ticket) {
        self.stored.saving = Some(Saving { save, ticket, is_taken: false });
    }

    /// The flash may hold the processor up: nothing is written while anything may move.
    pub(crate) fn check_at_rest(&self) -> Result<()> {
        for axis in self.axes.iter().filter(|axis| axis.is_configured()) {
            axis.refuse_busy()?;
            if axis.is_in_use() {
                return Err(Error::NotIdle { axis: axis.index, state: axis.state() });
            }
        }
        if let Some(bus) = self.buses.iter().find(|bus| bus.raw.is_some()) {
            return Err(Error::RawOpen { bus: bus.index() });
        }
        Ok(())
    }

    /// While something is stored the configuration stays as it is, and nothing begins to move: the
    /// flash may hold the processor up.
    pub(crate) fn refuse_saving(&self) -> Result<()> {
        if self.stored.is_saving() { Err(Error::Saving {}) } else { Ok(()) }
    }

    /// What was to be stored is, or could not be.
    pub(crate) fn saved(&mut self, now: Instant, result: Result<(), SaveError>) {
        let Some(Saving { save, ticket, .. }) =
            self.stored.saving.take_if(|saving| saving.is_taken)
        else {
            return;
        };
        let done = replies::Done {};
        let answer = match save {
            Save::Rows { digest } => self
                .configuration_stored(Ok(digest), result)
                .map(|()| Reply::SaveConfiguration(done)),
            Save::Nothing => self
                .configuration_stored(Err(StoredState::Nothing), result)
                .map(|()| Reply::ForgetStored(done)),
            Save::Image(job) => self.image_stored(now, &job, result),
        };
        self.outbox(now).answer(ticket, answer.as_ref().map_err(|error| *error));
    }

    fn configuration_stored(&mut self, found: Found, result: Result<(), SaveError>) -> Result<()> {
        match result {
            Ok(()) => {
                self.stored.state = found;
                Ok(())
            }
            Err(SaveError::Full) => Err(Error::StorageFull {}),
            Err(_) => Err(Error::SaveFailed {}),
        }
    }

    pub(crate) fn stored_report(&mut self) -> replies::StoredReport {
        let running = self.digest();
        let state = match self.stored.state {
            Ok(digest) => StoredState::Kept { differs: digest != running },
            Err(state) => state,
        };
        replies::StoredReport { state, saving: self.stored.is_saving() }
    }
}
