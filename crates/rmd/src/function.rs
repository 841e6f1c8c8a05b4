//! The functions behind 0x20.

use core::convert::Infallible;

use codec::{
    BuildError, CommandInfo, Decode, Effect, Encode, FieldInfo, Fields, Visit, check_range,
};

use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::node::Node;
use crate::payload::Payload;
use crate::table::{self, ENABLED, NEXT_ID};

/// One function of 0x20 (RMD V3.6 §2.33.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Function {
    /// Index 1: clear the multi-turn value, take the present position as zero and store it; acts
    /// after a restart.
    ClearMultiTurn,
    /// Index 2: hear only frames with the motor's own CAN id; stored in flash. 0x280 needs it off.
    CanIdFilter {
        /// Whether the filter is on.
        enabled: bool,
    },
    /// Index 3: send 0x9A unasked every 100 ms while a fault stands.
    ErrorReporting {
        /// Whether the motor reports.
        enabled: bool,
    },
    /// Index 4: store the multi-turn value before power is lost.
    MultiTurnSaving {
        /// Whether the motor stores it.
        enabled: bool,
    },
    /// Index 5: the CAN id from the next restart on; the motor answers from it at once, and hears
    /// requests on the old one until then (V4.2 and newer).
    NextCanId {
        /// The new id.
        id: Node,
    },
    /// Index 8: faults of voltage and speed go away by themselves (V4.4).
    FaultRecovery {
        /// Whether they do.
        enabled: bool,
    },
    /// An index or a value that no manual lists. Never encoded.
    Other {
        /// Index as received.
        index: u8,
        /// Value as received.
        value: u32,
    },
}

impl Function {
    const CLEAR_MULTI_TURN: u8 = 1;
    const CAN_ID_FILTER: u8 = 2;
    const ERROR_REPORTING: u8 = 3;
    const MULTI_TURN_SAVING: u8 = 4;
    const NEXT_CAN_ID: u8 = 5;
    const FAULT_RECOVERY: u8 = 8;

    const OFF: u32 = 0;
    const ON: u32 = 1;

    /// Index on the wire.
    pub const fn index(self) -> u8 {
        match self {
            Function::ClearMultiTurn => Function::CLEAR_MULTI_TURN,
            Function::CanIdFilter { .. } => Function::CAN_ID_FILTER,
            Function::ErrorReporting { .. } => Function::ERROR_REPORTING,
            Function::MultiTurnSaving { .. } => Function::MULTI_TURN_SAVING,
            Function::NextCanId { .. } => Function::NEXT_CAN_ID,
            Function::FaultRecovery { .. } => Function::FAULT_RECOVERY,
            Function::Other { index, .. } => index,
        }
    }

    /// Value on the wire.
    pub const fn value(self) -> u32 {
        match self {
            Function::ClearMultiTurn => Function::OFF,
            Function::CanIdFilter { enabled }
            | Function::ErrorReporting { enabled }
            | Function::MultiTurnSaving { enabled }
            | Function::FaultRecovery { enabled } => {
                if enabled {
                    Function::ON
                } else {
                    Function::OFF
                }
            }
            Function::NextCanId { id } => id.get() as u32,
            Function::Other { value, .. } => value,
        }
    }

    fn of(index: u8, value: u32) -> Function {
        let enabled = value == Function::ON;
        match (index, value) {
            (Function::CLEAR_MULTI_TURN, Function::OFF) => Function::ClearMultiTurn,
            (Function::CAN_ID_FILTER, Function::OFF | Function::ON) => {
                Function::CanIdFilter { enabled }
            }
            (Function::ERROR_REPORTING, Function::OFF | Function::ON) => {
                Function::ErrorReporting { enabled }
            }
            (Function::MULTI_TURN_SAVING, Function::OFF | Function::ON) => {
                Function::MultiTurnSaving { enabled }
            }
            (Function::FAULT_RECOVERY, Function::OFF | Function::ON) => {
                Function::FaultRecovery { enabled }
            }
            (Function::NEXT_CAN_ID, id) => match u8::try_from(id).map(Node::new) {
                Ok(Ok(id)) => Function::NextCanId { id },
                _ => Function::Other { index, value },
            },
            _ => Function::Other { index, value },
        }
    }

    /// The function of a row of the table, its switch as the caller gives it.
    pub(crate) fn build_row(
        name: &str,
        fields: &Fields<'_>,
    ) -> Result<Option<Function>, BuildError> {
        if name == table::SET_NEXT_CAN_ID.name {
            let id = Node::new(fields.count(&NEXT_ID)?)?;
            return Ok(Some(Function::NextCanId { id }));
        }
        let blank = [
            Function::ClearMultiTurn,
            Function::CanIdFilter { enabled: false },
            Function::ErrorReporting { enabled: false },
            Function::MultiTurnSaving { enabled: false },
            Function::FaultRecovery { enabled: false },
        ]
        .into_iter()
        .find(|function| function.info().is_some_and(|info| info.name == name));
        match blank {
            None | Some(Function::ClearMultiTurn) => Ok(blank),
            Some(function) => {
                let value = if fields.boolean(&ENABLED)? { Function::ON } else { Function::OFF };
                Ok(Some(Function::of(function.index(), value)))
            }
        }
    }

    pub(crate) fn visit(self, visit: &mut Visit<'_>) {
        match self {
            Function::ClearMultiTurn => {}
            Function::CanIdFilter { enabled }
            | Function::ErrorReporting { enabled }
            | Function::MultiTurnSaving { enabled }
            | Function::FaultRecovery { enabled } => ENABLED.visit_bool(visit, enabled),
            Function::NextCanId { id } => NEXT_ID.visit_integer(visit, id.get()),
            Function::Other { index, value } => {
                FieldInfo::integer("function_index", "", 0, 0).visit_integer(visit, index);
                FieldInfo::integer("value", "", 0, 0).visit_integer(visit, value);
            }
        }
    }

    /// The command of the table that sends this function.
    pub(crate) const fn info(self) -> Option<&'static CommandInfo> {
        match self {
            Function::ClearMultiTurn => Some(&table::CLEAR_MULTI_TURN),
            Function::CanIdFilter { .. } => Some(&table::SET_CAN_ID_FILTER),
            Function::ErrorReporting { .. } => Some(&table::SET_ERROR_REPORTING),
            Function::MultiTurnSaving { .. } => Some(&table::SET_MULTI_TURN_SAVING),
            Function::NextCanId { .. } => Some(&table::SET_NEXT_CAN_ID),
            Function::FaultRecovery { .. } => Some(&table::SET_FAULT_RECOVERY),
            Function::Other { .. } => None,
        }
    }

    /// What it does to a motor (RMD V3.6 §2.33.4).
    pub(crate) const fn effect(self) -> Effect {
        match self {
            Function::ClearMultiTurn | Function::NextCanId { .. } => Effect::Later,
            _ => Effect::Changes,
        }
    }
}

/// The index, and the value in the last four bytes (RMD V3.6 §2.33.2).
impl Decode<Payload> for Function {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<Function, Infallible> {
        Ok(Function::of(u8::get::<AT>(data)?, u32::get::<4>(data)?))
    }
}

impl Encode<Payload> for Function {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.index().put::<AT>(data);
        self.value().put::<4>(data);
    }

    fn check(&self) -> Result<(), EncodeError> {
        let Function::Other { index, value } = *self else { return Ok(()) };
        let (first, last) = (Function::CLEAR_MULTI_TURN, Function::FAULT_RECOVERY);
        check_range("function_index", i64::from(index), i64::from(first), i64::from(last))?;
        let highest =
            if index == Function::CLEAR_MULTI_TURN { Function::OFF } else { Function::ON };
        check_range("value", i64::from(value), i64::from(Function::OFF), i64::from(highest))?;
        let has_function = index <= Function::NEXT_CAN_ID || index == Function::FAULT_RECOVERY;
        Err(EncodeError::Forbidden {
            field: "function_index",
            value: i64::from(index),
            reason: if has_function {
                "this function has a variant of its own"
            } else {
                "no version of the protocol has this function"
            },
        })
    }
}
