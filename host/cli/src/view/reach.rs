//! How the page reaches the gateway: as every program does, through the server.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use mgw_client::{ClientError, TcpTransport, Transport};

use crate::failure::Failure;

/// Where this computer reaches a listener of its own.
pub fn from_here(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}

/// Where the server listens, and the token that it wants.
#[derive(Debug, Clone)]
pub struct Reach {
    address: String,
    token: Option<String>,
}

impl Reach {
    /// A server of this process that listens there.
    pub fn new(address: SocketAddr, token: Option<String>) -> Self {
        Self { address: from_here(address).to_string(), token }
    }

    /// A connection of its own.
    ///
    /// # Errors
    /// The server takes none.
    pub fn open(&self) -> Result<Box<dyn Transport>, Failure> {
        let opened = TcpTransport::connect_showing(&self.address, self.token.clone());
        Ok(Box::new(opened.map_err(ClientError::Transport)?))
    }
}
