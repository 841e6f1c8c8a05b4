//! The bitrates of CB.

use codec::{Decode, Encode};

use crate::error::{DecodeError, EncodeError};
use crate::payload::Payload;
use crate::units::Kilobits;

/// One bitrate of the manual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BitrateInfo {
    /// What CB carries.
    pub setting: Kilobits,
    /// What it stands for, bit/s. Three settings leave out a third or two of a kbit/s.
    pub bits_per_second: u32,
}

const fn whole(kilobits: u16) -> BitrateInfo {
    BitrateInfo { setting: Kilobits(kilobits), bits_per_second: kilobits as u32 * 1000 }
}

const fn fractional(kilobits: u16, bits_per_second: u32) -> BitrateInfo {
    BitrateInfo { setting: Kilobits(kilobits), bits_per_second }
}

/// Every bitrate a device can be set to, in the manual's order (Thruster manual §2.2).
pub static BITRATES: [BitrateInfo; 19] = [
    whole(1000),
    whole(800),
    whole(666),
    whole(500),
    whole(400),
    whole(333),
    whole(250),
    whole(200),
    whole(150),
    whole(125),
    whole(100),
    // 83.33, 66.66 and 33.33 kbit/s.
    fractional(83, 83_333),
    whole(80),
    fractional(66, 66_666),
    whole(50),
    whole(40),
    fractional(33, 33_333),
    whole(20),
    whole(10),
];

impl Kilobits {
    /// The row of the table; `None` if no device has this bitrate.
    pub fn info(self) -> Option<&'static BitrateInfo> {
        BITRATES.iter().find(|info| info.setting == self)
    }
}

impl Decode<Payload> for Kilobits {
    fn get<const AT: usize>(data: &Payload) -> Result<Kilobits, DecodeError> {
        u16::get::<AT>(data).map(Kilobits)
    }
}

impl Encode<Payload> for Kilobits {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        self.0.put::<AT>(data);
    }

    /// Refuses a bitrate that the manual does not have.
    fn check(&self) -> Result<(), EncodeError> {
        if self.info().is_some() {
            return Ok(());
        }
        let reason = "not one of the 19 bitrates of the manual, 10 to 1000 kbit/s";
        Err(EncodeError::Forbidden { field: "bitrate", value: i64::from(self.0), reason })
    }
}
