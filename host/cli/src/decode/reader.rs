//! Lines of bounded length.

use std::io::{self, BufRead, BufReader, Read};

/// Longer lines are handed out in pieces, so that memory stays flat whatever comes.
const LONGEST: u64 = 1 << 16;

/// The lines of an input, in one buffer.
pub struct Lines<R> {
    input: BufReader<R>,
    line: Vec<u8>,
    /// Bytes of `line` handed out before.
    used: usize,
}

impl<R: Read> Lines<R> {
    pub fn new(input: BufReader<R>) -> Self {
        Self { input, line: Vec::new(), used: 0 }
    }

    /// Whether the next line may have to be waited for.
    pub fn would_wait(&self) -> bool {
        self.input.buffer().is_empty()
    }

    /// The next line, or a piece of one; `None` at the end.
    pub fn next(&mut self) -> io::Result<Option<&[u8]>> {
        self.line.drain(..self.used);
        let room = LONGEST.saturating_sub(u64::try_from(self.line.len()).unwrap_or(LONGEST));
        let read = self.input.by_ref().take(room).read_until(b'\n', &mut self.line)?;
        let is_whole = self.line.last() == Some(&b'\n') || u64::try_from(read) != Ok(room);
        self.used = if is_whole { self.line.len() } else { cut(&self.line) };
        Ok((self.used > 0).then(|| self.line.get(..self.used).unwrap_or_default()))
    }
}

/// Where a piece of a long line ends: between two words, else between two pairs of digits.
fn cut(line: &[u8]) -> usize {
    match line.iter().rposition(u8::is_ascii_whitespace) {
        Some(space) => space + 1,
        None => line.len() & !1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(input: &[u8]) -> Vec<Vec<u8>> {
        let mut lines = Lines::new(BufReader::new(input));
        let mut all = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            all.push(line.to_vec());
        }
        all
    }

    #[test]
    fn the_last_line_needs_no_end() {
        assert_eq!(lines(b"one\n\ntwo"), [&b"one\n"[..], b"\n", b"two"]);
        assert!(lines(b"").is_empty());
    }

    #[test]
    fn a_long_line_comes_in_pieces_that_split_no_byte() {
        let digits = "3E01".repeat(50_000);
        let pieces = lines(format!("({}) {digits}\n141#00\n", "1".repeat(9)).as_bytes());
        assert!(pieces.len() > 3 && pieces.iter().all(|piece| piece.len() <= 1 << 16));
        assert_eq!(pieces[0], b"(111111111) ");
        assert_eq!(pieces.last().unwrap(), b"141#00\n");
        let text: Vec<u8> = pieces[1..pieces.len() - 1].concat();
        assert_eq!(text.trim_ascii(), digits.as_bytes());
        assert!(pieces[1..pieces.len() - 2].iter().all(|piece| piece.len() % 2 == 0));
    }
}
