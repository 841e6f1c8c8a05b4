//! The command line.

use std::path::PathBuf;

use clap::Parser;

use crate::keys::check_name;

/// A gateway of motors in the key space of a zenoh network: samples, events and states under
/// motor-gateway/NAME, commands from one peer at a time, stops from anybody
#[derive(Debug, Parser)]
#[command(name = "mgw-zenoh", version)]
pub struct Args {
    /// The name of this gateway in the network: 1 to 16 letters, digits, - and _, a letter first
    #[arg(value_parser = check_name)]
    pub name: String,
    /// The server of the gateway, as HOST:PORT or unix:PATH [default: this user's `mgw serve`]
    #[arg(long, value_name = "ADDRESS")]
    pub serve: Option<String>,
    /// A gateway that has no server: a serial device, or tcp:HOST:PORT
    #[arg(short, long, env = "MGW_PORT", conflicts_with = "serve")]
    pub port: Option<String>,
    /// An endpoint of the network to connect to, such as tcp/192.168.1.2:7447; may be given often
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// An endpoint to listen on, such as tcp/127.0.0.1:7447; may be given often. Whoever reaches it
    /// may command
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Look for others of the local network by multicast
    #[arg(long)]
    pub scout: bool,
    /// Pass on what others say to each other: for those that reach this computer only
    #[arg(long)]
    pub route: bool,
    /// A configuration file of zenoh, for TLS, users and access control; --connect and --listen are
    /// still heeded
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scout", "route"])]
    pub config: Option<PathBuf>,
    /// Between two samples of an axis
    #[arg(
        long, default_value_t = 20, value_name = "MS",
        value_parser = clap::value_parser!(u64).range(1..=1_000)
    )]
    pub period: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_none_is_refused_with_what_it_may_be() {
        let refused = Args::try_parse_from(["mgw-zenoh", "a/b"]).unwrap_err().to_string();
        assert!(refused.contains("1 to 16 letters, digits"), "{refused}");
        let args = Args::try_parse_from(["mgw-zenoh", "left", "--listen", "tcp/127.0.0.1:1"]);
        assert_eq!(args.unwrap().listen, ["tcp/127.0.0.1:1"]);
    }
}
