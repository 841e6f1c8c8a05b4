//! The arguments of `delays`.

use std::path::PathBuf;

use clap::Args;

use crate::delays::typed_word;

#[derive(Debug, Args)]
pub struct DelaysArgs {
    /// Recordings with raw frames (MCAP), and tables of delays
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub told: Told,
    /// Write the table into this file
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write over a file that is there already, as one of those that are merged
    #[arg(long, requires = "output")]
    pub force: bool,
}

/// What a person knows that a recording may not tell.
#[derive(Debug, Clone, Default, Args)]
pub struct Told {
    /// The bitrate of a bus in the recordings; may be given often
    #[arg(long = "bitrate", value_name = "BUS=BIT_S", value_parser = bitrate)]
    pub bitrates: Vec<(u64, u32)>,
    /// Who measured, as lab-a; unknown without it, simulator where the gateway was simulated
    #[arg(long = "where", value_name = "NAME", value_parser = typed_word)]
    pub place: Option<String>,
    /// The model of the motors in the recordings that do not tell it themselves
    #[arg(long, value_name = "MODEL", value_parser = typed_word)]
    pub model: Option<String>,
    /// The firmware of the motors in the recordings that do not tell it themselves
    #[arg(long, value_name = "VERSION", value_parser = typed_word)]
    pub firmware: Option<String>,
    /// The version of the gateway, where the recordings do not tell it
    #[arg(long, value_name = "VERSION", value_parser = typed_word)]
    pub gateway: Option<String>,
}

impl Told {
    /// bit/s of a bus.
    pub fn bitrate(&self, bus: u64) -> Option<u32> {
        self.bitrates.iter().rev().find(|(of, _)| *of == bus).map(|(_, bitrate)| *bitrate)
    }
}

fn bitrate(text: &str) -> Result<(u64, u32), String> {
    let parts = text.split_once('=');
    let parsed = parts.and_then(|(bus, rate)| Some((bus.parse().ok()?, rate.parse().ok()?)));
    parsed
        .filter(|(bus, rate)| {
            *bus < gateway::MAX_BUSES as u64 && (1_000..=20_000_000).contains(rate)
        })
        .ok_or_else(|| "takes BUS=BIT_S, bus 0 to 3, 1000 to 20000000 bit/s".to_owned())
}
