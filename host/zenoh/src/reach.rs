//! How this program reaches its gateway: each of its parts is a program of a server, one that runs
//! already or one of its own.

use std::net::TcpListener;
use std::thread;

use mgw_client::{
    ClientError, TcpTransport, Transport, check_shared_name, open, open_halves, server_port,
};
use mgw_serve::Listener;

/// Where the server is.
#[derive(Debug, Clone)]
pub enum Reach {
    /// A server that runs: the name of its port.
    Server(String),
    /// One of this program.
    Own {
        /// Where it listens.
        address: String,
        /// What opens it.
        token: String,
    },
}

impl Reach {
    /// The server that was named, a server of this program on the port that was named, or this
    /// user's server. A server of its own tells what happens to its cable to `log`.
    ///
    /// # Errors
    /// What is wrong, and what to do.
    pub fn new(
        server: Option<&str>,
        port: Option<&str>,
        log: impl FnMut(&str) + Send + 'static,
    ) -> Result<Self, String> {
        match (server, port) {
            (Some(server), _) => {
                check_shared_name(server).map_err(|error| error.to_string())?;
                Ok(Self::Server(server.to_owned()))
            }
            (None, Some(port)) => {
                check_shared_name(port).map_err(|error| error.to_string())?;
                own(port.to_owned(), log).map_err(|error| format!("no server: {error}"))
            }
            (None, None) => server_port().map(Self::Server).ok_or_else(|| {
                "no server runs here: start `mgw serve`, or give --serve HOST:PORT, or --port for a \
                 gateway that nobody else uses"
                    .to_owned()
            }),
        }
    }

    /// A connection of its own.
    ///
    /// # Errors
    /// The server takes none.
    pub fn open(&self) -> Result<Box<dyn Transport + Send>, ClientError> {
        match self {
            Self::Server(port) => Ok(open(port)?),
            Self::Own { address, token } => {
                let token = Some(token.clone());
                Ok(Box::new(TcpTransport::connect_showing(address, token)?))
            }
        }
    }
}

/// A server on a port that nobody else has, for this program alone.
fn own(port: String, log: impl FnMut(&str) + Send + 'static) -> std::io::Result<Reach> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?.to_string();
    let token = mgw_view::new_token()?;
    let listeners = vec![Listener::Tcp(listener, Some(token.clone()))];
    let cable = move || open_halves(&port).map_err(|error| error.to_string());
    thread::spawn(move || mgw_serve::serve(listeners, cable, log, None));
    Ok(Reach::Own { address, token })
}
