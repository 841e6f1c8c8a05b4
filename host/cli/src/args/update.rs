//! The arguments of `update` and `image`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("what").required(true).args(["file", "confirm"])))]
pub struct UpdateArgs {
    /// The firmware: an ELF file, or the bytes of the flash
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// Its Ed25519 signature of 64 bytes: for a gateway that carries a key, or an image that does
    #[arg(long, value_name = "FILE", conflicts_with = "confirm")]
    pub signature: Option<PathBuf>,
    /// Take an older firmware than the one that runs
    #[arg(long, conflicts_with = "confirm")]
    pub allow_older: bool,
    /// Only say whether the gateway would take it; nothing is sent
    #[arg(long, conflicts_with = "confirm")]
    pub check: bool,
    /// Keep the firmware that runs on trial, after an update that was ended halfway
    #[arg(long)]
    pub confirm: bool,
}

#[derive(Debug, Args)]
pub struct ImageArgs {
    /// The firmware: an ELF file, or the bytes of the flash
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Write what a board takes into this file: to be signed, and sent by `mgw update`
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Put this Ed25519 public key into it (32 bytes, or DER): a gateway with it takes only images
    /// that are signed by its other half
    #[arg(long, value_name = "FILE", requires = "output")]
    pub key: Option<PathBuf>,
}
