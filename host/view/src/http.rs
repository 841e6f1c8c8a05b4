//! As much of HTTP as the page needs: heads of bounded length within a bounded time, and answers
//! that end the connection.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest head of a request, bytes.
pub const LONGEST_HEAD: usize = 8_192;
/// Most headers of a request.
const HEADERS: usize = 64;
/// How long a head may take to arrive.
pub const HEAD_WITHIN: Duration = Duration::from_secs(5);
/// How long an answer may take to be read.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Bytes of a refused request that are read, so that its answer is not lost by a reset.
const READ_AFTER: usize = 65_536;

/// The head of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// `GET`.
    pub method: String,
    /// Without what follows the `?`.
    pub path: String,
    /// What follows the `?`.
    pub query: String,
    headers: Vec<(String, String)>,
}

impl Head {
    /// The value of a header that must not come twice; nothing where it does, or is not there.
    pub fn only(&self, name: &str) -> Option<&str> {
        let mut all = self.all(name);
        let first = all.next()?;
        if all.next().is_some() { None } else { Some(first) }
    }

    /// Every value of a header.
    pub fn all(&self, name: &str) -> impl Iterator<Item = &str> {
        let is_it = move |(of, _): &&(String, String)| of.eq_ignore_ascii_case(name);
        self.headers.iter().filter(is_it).map(|(_, value)| value.as_str())
    }

    /// The items of a header that is a list.
    pub fn items(&self, name: &str) -> impl Iterator<Item = &str> {
        self.all(name).flat_map(|value| value.split(',')).map(str::trim)
    }

    /// The decoded value of a parameter of the query.
    pub fn parameter(&self, name: &str) -> Option<Vec<u8>> {
        let mut all = self.query.split('&').filter_map(|one| one.split_once('='));
        all.find(|(of, _)| *of == name).and_then(|(_, value)| percent_decoded(value))
    }

    /// Whether it asks for a WebSocket.
    pub fn asks_for_websocket(&self) -> bool {
        self.items("upgrade").any(|item| item.eq_ignore_ascii_case("websocket"))
            && self.items("connection").any(|item| item.eq_ignore_ascii_case("upgrade"))
    }
}

/// Why there is no head.
#[derive(Debug, PartialEq, Eq)]
pub enum BadHead {
    /// The connection has ended, or nothing came in time.
    Gone,
    /// It is longer than [`LONGEST_HEAD`], or has too many headers.
    TooLong,
    /// It is not HTTP.
    NotHttp,
}

/// Reads the head of a request.
///
/// # Errors
/// [`BadHead`].
pub fn read_head(stream: &mut TcpStream) -> Result<Head, BadHead> {
    let end = Instant::now() + HEAD_WITHIN;
    let mut bytes = Vec::new();
    let mut piece = [0; 1_024];
    loop {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return Err(BadHead::Gone);
        }
        let count = match stream.read(&mut piece) {
            Ok(0) => return Err(BadHead::Gone),
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => return Err(BadHead::Gone),
        };
        bytes.extend(piece.get(..count).unwrap_or_default());
        if let Some(head) = parse(&bytes)? {
            return Ok(head);
        }
        if bytes.len() > LONGEST_HEAD {
            return Err(BadHead::TooLong);
        }
    }
}

fn parse(bytes: &[u8]) -> Result<Option<Head>, BadHead> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) => return Ok(None),
        // A body would be another request to a reader that is less strict.
        Ok(httparse::Status::Complete(length)) if length < bytes.len() => {
            return Err(BadHead::NotHttp);
        }
        Ok(httparse::Status::Complete(length)) if length > LONGEST_HEAD => {
            return Err(BadHead::TooLong);
        }
        Ok(httparse::Status::Complete(_)) => {}
        Err(httparse::Error::TooManyHeaders) => return Err(BadHead::TooLong),
        Err(_) => return Err(BadHead::NotHttp),
    }
    let target = request.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut all = Vec::new();
    for header in request.headers.iter() {
        let value = std::str::from_utf8(header.value).map_err(|_| BadHead::NotHttp)?;
        all.push((header.name.to_owned(), value.trim().to_owned()));
    }
    let head = Head {
        method: request.method.unwrap_or_default().to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        headers: all,
    };
    let twice = ["host", "origin", "content-length"].iter().any(|name| head.all(name).count() > 1);
    let has_body = head.all("transfer-encoding").next().is_some()
        || head.only("content-length").is_some_and(|length| length != "0");
    if twice || has_body { Err(BadHead::NotHttp) } else { Ok(Some(head)) }
}

/// `%41` as `A`; nothing where it is not written so.
fn percent_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = text.bytes();
    let mut decoded = Vec::new();
    while let Some(byte) = bytes.next() {
        decoded.push(match byte {
            b'%' => from_hex(bytes.next()?, bytes.next()?)?,
            byte => byte,
        });
    }
    Some(decoded)
}

/// The bytes that hexadecimal digits stand for.
pub fn hex_decoded(text: &str) -> Option<Vec<u8>> {
    let digits = text.as_bytes();
    if !digits.len().is_multiple_of(2) {
        return None;
    }
    digits.chunks_exact(2).map(|pair| from_hex(*pair.first()?, *pair.get(1)?)).collect()
}

fn from_hex(high: u8, low: u8) -> Option<u8> {
    let digit = |digit: u8| char::from(digit).to_digit(16);
    u8::try_from(digit(high)? * 16 + digit(low)?).ok()
}

/// Writes an answer with these headers beside the ones that every answer has, and ends the
/// connection.
pub fn answer(stream: &mut TcpStream, status: u16, headers: &[(&str, &str)], body: &[u8]) {
    let mut head = format!("HTTP/1.1 {status} {}\r\n", phrase(status));
    let length = body.len().to_string();
    let common = [
        ("Content-Length", length.as_str()),
        ("Connection", "close"),
        ("Cache-Control", "no-store"),
        ("X-Content-Type-Options", "nosniff"),
        ("X-Frame-Options", "DENY"),
        ("Referrer-Policy", "no-referrer"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Cross-Origin-Opener-Policy", "same-origin"),
    ];
    for (name, value) in common.iter().chain(headers) {
        head.push_str(&format!("{name}: {value}\r\n"));
    }
    head.push_str("\r\n");
    let _ = stream.set_write_timeout(Some(ANSWER_WITHIN));
    let written = stream.write_all(&[head.as_bytes(), body].concat());
    let _ = stream.shutdown(std::net::Shutdown::Write);
    if written.is_ok() {
        read_away(stream);
    }
}

/// Text for people, as the whole of an answer.
pub fn answer_text(stream: &mut TcpStream, status: u16, text: &str) {
    let headers = [
        ("Content-Type", "text/plain; charset=utf-8"),
        ("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'"),
    ];
    answer(stream, status, &headers, format!("{text}\n").as_bytes());
}

/// What still comes is read for a while: a connection that is closed with bytes unread loses its
/// answer.
fn read_away(stream: &mut TcpStream) {
    let end = Instant::now() + Duration::from_secs(1);
    let (mut bytes, mut count) = ([0; 1_024], 0);
    let _ = stream.set_read_timeout(Some(Duration::from_millis(200)));
    while count < READ_AFTER && Instant::now() < end {
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(more) => count += more,
        }
    }
}

fn phrase(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        421 => "Misdirected Request",
        426 => "Upgrade Required",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Error",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_and_its_parts_found() {
        let text = b"GET /live?token=a%20b&x=1 HTTP/1.1\r\nHost: localhost:1\r\n\
            Connection: keep-alive, Upgrade\r\nUpgrade: WebSocket\r\n\
            Sec-WebSocket-Protocol: a, b\r\nSec-WebSocket-Protocol: c\r\n\r\n";
        let head = parse(text).unwrap().unwrap();
        assert_eq!((head.method.as_str(), head.path.as_str()), ("GET", "/live"));
        assert_eq!(head.parameter("token").as_deref(), Some(&b"a b"[..]));
        assert_eq!(head.only("host"), Some("localhost:1"));
        assert!(head.asks_for_websocket());
        let protocols: Vec<_> = head.items("sec-websocket-protocol").collect();
        assert_eq!(protocols, ["a", "b", "c"]);
    }

    #[test]
    fn what_two_readers_could_read_differently_is_refused() {
        for bad in [
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
            "POST /stop HTTP/1.1\r\nHost: a\r\nOrigin: a\r\nOrigin: b\r\n\r\n",
            "POST /stop HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n",
            "POST /stop HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\n",
            "GET / HTTP/1.1\r\nHost: a\r\n\r\nGET / HTTP/1.1\r\n\r\n",
            "GET / HTTP/1.1\r\nHost : a\r\n\r\n",
            "\x16\x03\x01\x02\x00",
        ] {
            assert_eq!(parse(bad.as_bytes()), Err(BadHead::NotHttp), "{bad:?}");
        }
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(HEADERS + 1));
        assert_eq!(parse(many.as_bytes()), Err(BadHead::TooLong));
    }

    #[test]
    fn digits_that_are_none_decode_to_nothing() {
        assert_eq!(percent_decoded("%4"), None);
        assert_eq!(percent_decoded("%zz"), None);
        assert_eq!(hex_decoded("6d67"), Some(b"mg".to_vec()));
        assert_eq!((hex_decoded("6"), hex_decoded("xy"), hex_decoded("+1")), (None, None, None));
    }
}
