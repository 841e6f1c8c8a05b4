//! Where the configuration is stored: whole or not at all, as the storage of the boards has it.

use super::World;
use super::ports::Input;
use gateway::{Gateway, Instant, MAX_STORED_ROW, STORED_ROWS, Save, StoredState};

/// What is asked to be stored is written so much later, µs, unless something else comes first.
const WRITTEN_AFTER_US: u64 = 30_000;

/// What is stored, and what is about to be.
#[derive(Clone, Default)]
pub struct Storage {
    kept: Option<(u32, Vec<Vec<u8>>)>,
    due: Option<(Save, u64)>,
}

impl Storage {
    pub fn written_at(&self) -> Option<u64> {
        self.due.as_ref().map(|(_, at)| *at)
    }

    /// Writes what decides how it goes on.
    pub fn write_state(&self, to: &mut impl std::fmt::Write) -> std::fmt::Result {
        write!(to, "{:?} {:?}", self.kept, self.due)
    }

    /// A gateway that starts takes over what is stored.
    pub fn load(&self, now: Instant, gateway: &mut Gateway) {
        let (found, rows) = match &self.kept {
            None => (Err(StoredState::Nothing), &[][..]),
            Some((digest, rows)) => (Ok(*digest), rows.as_slice()),
        };
        let mut rows = rows.iter();
        let mut next = |out: &mut [u8; MAX_STORED_ROW]| {
            let row = rows.next()?;
            out[..row.len()].copy_from_slice(row);
            Some(Ok(row.len()))
        };
        gateway.load(now, found, &mut next);
    }
}

impl World {
    /// The gateway wants something stored.
    pub(super) fn store(&mut self) {
        let Some(save) = self.gateway.take_save() else { return };
        self.note(|| format!("out the storage: {save:?}"));
        match save {
            Save::Rows { .. } => self.oracle.stores(self.now_us, true),
            Save::Nothing => self.oracle.stores(self.now_us, false),
            Save::Image(_) => {}
        }
        self.life.storage.due = Some((save, self.now_us + WRITTEN_AFTER_US));
    }

    /// It is stored, or it has failed.
    pub(super) fn stored(&mut self, done: bool) {
        if self.write(done) {
            self.feed(Input::Stored { done });
        }
    }

    /// The gateway starts while something is being stored: nobody knows how far it was.
    pub(super) fn cut_storing(&mut self) {
        self.write(self.now_us.is_multiple_of(2));
    }

    /// The storage loses what it has acknowledged: a fault that must be found.
    #[cfg(test)]
    pub(crate) fn forget_stored(&mut self) {
        self.life.storage.kept = None;
    }

    fn write(&mut self, done: bool) -> bool {
        let Some((save, _)) = self.life.storage.due.take() else { return false };
        self.note(|| format!("the storage: {save:?} is done: {done}"));
        self.oracle.stored(self.now_us, done);
        if done {
            let row = |row| {
                let mut bytes = [0; MAX_STORED_ROW];
                let length = self.gateway.stored_row(row, &mut bytes);
                bytes[..length].to_vec()
            };
            self.life.storage.kept = match save {
                Save::Rows { digest } => Some((digest, (0..STORED_ROWS).map(row).collect())),
                Save::Nothing => None,
                Save::Image(_) => return true,
            };
        }
        true
    }
}
