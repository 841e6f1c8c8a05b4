//! Which version of its protocol a motor speaks, as far as its answers to reads tell (RMD dialects,
//! docs/rmd-dialects.md).

use super::rmd;
use crate::filled::filled;
use crate::measured::Versions;
use host_protocol::replies::{MAX_VERSION_ANSWERS, Recognition, VersionAnswer};
use host_protocol::{Agreement, MAX_CAN_DATA};
use serde::{Deserialize, Serialize};

/// What a motor answered to one of the reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Told {
    answer: [u8; MAX_CAN_DATA],
    /// None: it has told nothing.
    versions: Versions,
    agreement: Agreement,
}

impl Told {
    const NOTHING: Self =
        Self { answer: [0; MAX_CAN_DATA], versions: Versions::NONE, agreement: Agreement::Once };
}

/// What a motor answered to the reads that tell its version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Evidence([Told; MAX_VERSION_ANSWERS]);

const _: () = assert!(::rmd::PROBES.len() == MAX_VERSION_ANSWERS, "as many answers as reads");

/// So many reads must agree before the one version that they leave counts as recognised.
const AGREEING: usize = 2;

impl Evidence {
    pub const NONE: Self = Self([Told::NOTHING; MAX_VERSION_ANSWERS]);

    /// The answer to a read the first time that it is asked: no versions where there was none.
    pub fn first(&mut self, read: u8, data: &[u8], versions: Versions) {
        if let Some(told) = self.0.get_mut(usize::from(read)) {
            *told = Told { answer: filled(data.iter().copied()), versions, ..Told::NOTHING };
        }
    }

    /// The answer when it is asked again: the first one, where there was none before.
    pub fn again(&mut self, read: u8, data: &[u8], versions: Versions) {
        let Some(told) = self.0.get_mut(usize::from(read)) else { return };
        if told.versions == Versions::NONE {
            self.first(read, data, versions);
        } else if versions != Versions::NONE && told.agreement != Agreement::Different {
            told.agreement = match told.versions == versions {
                true => Agreement::Twice,
                false => Agreement::Different,
            };
        }
    }

    /// The versions that all agreeing answers allow; none where they contradict each other, or one
    /// was given in two ways.
    fn possible(&self) -> Versions {
        Versions::of_bits(self.0.iter().fold(rmd::KNOWN, |all, told| match told.agreement {
            Agreement::Once => all,
            Agreement::Twice => all & told.versions.bits(),
            Agreement::Different => 0,
        }))
    }

    /// Whether they leave it possible that the motor speaks the version with this number. 0, which
    /// says nothing, contradicts nothing.
    pub fn allows(&self, version: u8) -> bool {
        version == 0
            || 1u8.checked_shl(version.into()).is_some_and(|bit| self.possible().bits() & bit != 0)
    }

    /// As a host is told it.
    pub fn report(&self) -> Recognition {
        let told =
            self.0.iter().zip(rmd::probes()).filter(|(told, _)| told.versions != Versions::NONE);
        let answers = told.map(|(told, request)| VersionAnswer {
            request,
            answer: told.answer,
            dialects: told.versions.bits(),
            agreement: told.agreement,
        });
        let agreeing = self.0.iter().filter(|told| told.agreement == Agreement::Twice).count();
        let possible = self.possible();
        Recognition {
            dialect: possible.only().filter(|_| agreeing >= AGREEING).unwrap_or(0),
            possible: possible.bits(),
            answers: answers.collect(),
        }
    }
}
