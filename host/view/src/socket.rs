//! A WebSocket in two halves, so that a visitor who does not read can still be heard.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::thread;
use std::time::Duration;

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::outbox::{Out, Outbox};

/// Longest message of a visitor, bytes.
const LONGEST_MESSAGE: usize = 4_096;
/// A visitor that takes nothing for so long is gone.
const WRITTEN_WITHIN: Duration = Duration::from_secs(10);

/// The reading half. What it has to answer by itself goes the way of all else.
struct Reading {
    stream: TcpStream,
    outbox: Outbox,
}

impl Read for Reading {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.stream.read(bytes)
    }
}

impl Write for Reading {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.outbox.put_frames(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What a visitor says, message by message.
pub(crate) struct Heard {
    socket: WebSocket<Reading>,
    outbox: Outbox,
}

/// Opens both halves of a connection whose handshake is done.
pub(crate) fn open(stream: TcpStream, outbox: &Outbox) -> io::Result<Heard> {
    stream.set_read_timeout(None)?;
    stream.set_write_timeout(Some(WRITTEN_WITHIN))?;
    stream.set_nodelay(true)?;
    let config = WebSocketConfig::default()
        .max_message_size(Some(LONGEST_MESSAGE))
        .max_frame_size(Some(LONGEST_MESSAGE));
    let (writer, to_write) = (stream.try_clone()?, outbox.clone());
    thread::spawn(move || write(writer, &to_write));
    let reading = Reading { stream, outbox: outbox.clone() };
    let socket = WebSocket::from_raw_socket(reading, Role::Server, Some(config));
    Ok(Heard { socket, outbox: outbox.clone() })
}

impl Heard {
    /// The next text; nothing once the visitor has gone.
    pub(crate) fn next(&mut self) -> Option<String> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Some(text.to_string()),
                Ok(Message::Binary(_) | Message::Ping(_) | Message::Pong(_)) => {
                    let _ = self.socket.flush();
                }
                Ok(Message::Close(_)) => {
                    let _ = self.socket.flush();
                    return None;
                }
                Ok(Message::Frame(_)) => {}
                Err(_) => return None,
            }
        }
    }
}

impl Drop for Heard {
    fn drop(&mut self) {
        self.outbox.close();
    }
}

/// Writes what is in the outbox until it is closed, then ends the connection.
fn write(stream: TcpStream, outbox: &Outbox) {
    let Ok(ending) = stream.try_clone() else { return outbox.close() };
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, None);
    while let Some(out) = outbox.take() {
        let written = match out {
            Out::Message(message) => socket.send(message).is_ok(),
            Out::Frames(frames) => socket.get_mut().write_all(&frames).is_ok(),
        };
        if !written {
            break;
        }
    }
    outbox.close();
    let _ = ending.shutdown(Shutdown::Both);
}
