//! A register by its place in a table that is known at run time only.

use rigless::soc::{Access, Layout, ReadAction, RegisterSpec, Width, WriteModify};

/// A register's row in the table of its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row(pub usize);

/// What every register of these tables has in common.
static WORD: RegisterSpec = RegisterSpec {
    name: "a register",
    offset: 0,
    width: Width::W32,
    reset: 0,
    access: Access::ReadWrite,
    read: ReadAction::None,
    write: WriteModify::None,
    fields: &[],
};

impl Layout for Row {
    /// None: a model answers for its own table.
    const REGISTERS: &'static [RegisterSpec] = &[];

    fn from_index(index: usize) -> Option<Self> {
        Some(Self(index))
    }

    fn index(self) -> usize {
        self.0
    }

    fn spec(self) -> &'static RegisterSpec {
        &WORD
    }
}
