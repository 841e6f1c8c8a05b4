//! The board that a recording was made on, as far as a core must know it.

use gateway::{Board, BusPort, LinkPort, MAX_BUSES, MAX_LINKS};
use heapless::Vec;
use host_protocol::{BootReason, BusKind, BusLimit, MAX_BITRATES};
use serde::{Deserialize, Serialize};

/// Bitrates, or rates of a link.
type Rates = Vec<u32, MAX_BITRATES>;

/// A [`Board`] with all that it refers to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordedBoard<'a> {
    /// Its name.
    pub name: &'a str,
    /// Version of the firmware.
    pub firmware: &'a str,
    /// What identifies the build.
    pub build_id: &'a str,
    /// Why it started.
    pub boot: BootReason,
    /// What the run before left behind.
    pub crash_report: &'a str,
    /// Whether it has an e-stop input.
    pub e_stop_input: bool,
    /// Whether it has an enable output.
    pub enable_output: bool,
    /// Its buses: what each is, and its bitrates.
    pub buses: Vec<(BusKind, Rates), MAX_BUSES>,
    /// Why one of them has no bitrates.
    pub bus_limit: Option<BusLimit>,
    /// The rates of its host links.
    pub links: Vec<Rates, MAX_LINKS>,
}

impl From<&'static Board> for RecordedBoard<'static> {
    fn from(board: &'static Board) -> Self {
        let rates = |rates: &[u32]| rates.iter().copied().take(MAX_BITRATES).collect();
        let bus = |bus: &BusPort| (bus.kind, rates(bus.bitrates));
        let link = |link: &LinkPort| rates(link.bauds);
        Self {
            name: board.name,
            firmware: board.firmware,
            build_id: board.build_id,
            boot: board.boot,
            crash_report: board.crash_report,
            e_stop_input: board.e_stop_input,
            enable_output: board.enable_output,
            buses: board.buses.iter().take(MAX_BUSES).map(bus).collect(),
            bus_limit: board.bus_limit,
            links: board.links.iter().take(MAX_LINKS).map(link).collect(),
        }
    }
}
