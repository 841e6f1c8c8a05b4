//! How the page reaches the gateway: as every program does, through the server.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use mgw_client::{ClientError, TcpTransport, Transport};

use crate::failure::Failure;

/// Where the server listens, and the token that it wants.
#[derive(Debug, Clone)]
pub struct Reach {
    address: SocketAddr,
    token: Option<String>,
}

impl Reach {
    /// A server of this process that listens there.
    pub fn new(address: SocketAddr, token: Option<String>) -> Self {
        let ip = match address.ip() {
            ip if !ip.is_unspecified() => ip,
            IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::LOCALHOST),
            IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::LOCALHOST),
        };
        Self { address: SocketAddr::new(ip, address.port()), token }
    }

    /// A connection of its own.
    ///
    /// # Errors
    /// The server takes none.
    pub fn open(&self) -> Result<Box<dyn Transport>, Failure> {
        let address = self.address.to_string();
        let opened = TcpTransport::connect_showing(&address, self.token.clone());
        let transport = opened.map_err(ClientError::Transport)?;
        Ok(Box::new(transport))
    }
}
