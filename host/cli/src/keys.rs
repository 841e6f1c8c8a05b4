//! Single keys of a terminal, as they are pressed.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::event::{
    KeyboardEnhancementFlags, PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags,
};
use crossterm::execute;

/// A key that is held down comes again within this after it was pressed.
const FIRST_REPETITION: Duration = Duration::from_secs(1);
/// Then again within this, or it has been let go.
const REPETITION: Duration = Duration::from_millis(200);

/// A key and whether it has been let go, which not every terminal tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    pub code: KeyCode,
    pub released: bool,
}

/// The keyboard, while it gives each key at once and unseen; as before when this is dropped.
pub struct Keyboard {
    _unbuffered: Unbuffered,
}

impl Keyboard {
    /// `None` where standard input is no terminal.
    ///
    /// # Errors
    /// The terminal does not allow it.
    pub fn open() -> io::Result<Option<Self>> {
        if !io::stdin().is_terminal() {
            return Ok(None);
        }
        let keyboard = Self { _unbuffered: Unbuffered::begin()? };
        // Terminals that do not know it ignore it, and do not tell that a key is let go.
        let flags = KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
        execute!(io::stderr(), PushKeyboardEnhancementFlags(flags))?;
        Ok(Some(keyboard))
    }

    /// The next key that waits.
    ///
    /// # Errors
    /// The terminal is gone.
    pub fn next(&mut self) -> io::Result<Option<Key>> {
        while event::poll(Duration::ZERO)? {
            let Event::Key(key) = event::read()? else { continue };
            let interrupts = key.modifiers.contains(KeyModifiers::CONTROL)
                && matches!(key.code, KeyCode::Char('c' | 'd'));
            let code = if interrupts { KeyCode::Esc } else { key.code };
            return Ok(Some(Key { code, released: key.kind == KeyEventKind::Release }));
        }
        Ok(None)
    }

    /// Takes the keys that wait; whether `wanted` was among them.
    ///
    /// # Errors
    /// As [`next`](Self::next).
    pub fn forget_but(&mut self, wanted: impl Fn(KeyCode) -> bool) -> io::Result<bool> {
        let mut found = false;
        while let Some(key) = self.next()? {
            found |= wanted(key.code);
        }
        Ok(found)
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        // With nobody to hear it there is nothing more to do.
        let _ = execute!(io::stderr(), PopKeyboardEnhancementFlags);
    }
}

/// Tells from its repetitions whether a key is held down.
#[derive(Debug, Default)]
pub struct Held {
    latest: Option<(KeyCode, Instant, Duration)>,
}

impl Held {
    /// A key that is held down since `now`.
    pub fn down(code: KeyCode, now: Instant) -> Self {
        Self { latest: Some((code, now, REPETITION)) }
    }

    /// Whether it has come again.
    pub fn came_after(&self, since: Instant) -> bool {
        self.latest.is_some_and(|(_, at, _)| at > since)
    }

    /// Takes a key; the one that is held down from now on, or still.
    pub fn take(&mut self, key: Key, now: Instant) -> Option<KeyCode> {
        let again = self.at(now) == Some(key.code);
        let patience = if again { REPETITION } else { FIRST_REPETITION };
        self.latest = (!key.released).then_some((key.code, now, patience));
        (again && !key.released).then_some(key.code)
    }

    /// The key that may be held down, as far as can be told now.
    pub fn at(&self, now: Instant) -> Option<KeyCode> {
        let (code, pressed, patience) = self.latest?;
        (now.saturating_duration_since(pressed) < patience).then_some(code)
    }
}

/// The terminal's own line editing and echo switched off. Ctrl-C stays a signal on Unix.
#[cfg(unix)]
struct Unbuffered(nix::sys::termios::Termios);

#[cfg(unix)]
impl Unbuffered {
    fn begin() -> io::Result<Self> {
        use nix::sys::termios::{LocalFlags, SetArg, tcgetattr, tcsetattr};
        let before = tcgetattr(io::stdin())?;
        let mut now = before.clone();
        now.local_flags.remove(LocalFlags::ICANON | LocalFlags::ECHO);
        tcsetattr(io::stdin(), SetArg::TCSANOW, &now)?;
        Ok(Self(before))
    }
}

#[cfg(unix)]
impl Drop for Unbuffered {
    fn drop(&mut self) {
        use nix::sys::termios::{SetArg, tcsetattr};
        // What was typed meanwhile was for the motor.
        let _ = tcsetattr(io::stdin(), SetArg::TCSAFLUSH, &self.0);
    }
}

#[cfg(not(unix))]
struct Unbuffered;

#[cfg(not(unix))]
impl Unbuffered {
    fn begin() -> io::Result<Self> {
        crossterm::terminal::enable_raw_mode().map(|()| Self)
    }
}

#[cfg(not(unix))]
impl Drop for Unbuffered {
    fn drop(&mut self) {
        let _ = crossterm::terminal::disable_raw_mode();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: Key = Key { code: KeyCode::Right, released: false };
    const LEFT: Key = Key { code: KeyCode::Left, released: false };

    #[test]
    fn a_key_is_held_from_its_first_repetition_until_none_comes() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut held = Held::default();
        assert_eq!(held.take(RIGHT, at(0)), None, "a tap");
        assert_eq!(held.take(RIGHT, at(660)), Some(KeyCode::Right));
        assert_eq!(held.take(RIGHT, at(760)), Some(KeyCode::Right));
        assert_eq!(held.at(at(959)), Some(KeyCode::Right));
        assert_eq!(held.at(at(960)), None, "let go");
        assert_eq!(held.take(RIGHT, at(1_000)), None, "it begins anew");
    }

    #[test]
    fn a_tap_another_key_or_a_release_is_not_held() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut held = Held::default();
        assert_eq!(held.take(RIGHT, at(0)), None);
        assert_eq!(held.take(RIGHT, at(1_001)), None, "two taps");
        assert_eq!(held.take(LEFT, at(1_100)), None);
        assert_eq!(held.take(LEFT, at(1_150)), Some(KeyCode::Left));
        assert_eq!(held.take(RIGHT, at(1_200)), None, "another key");
        assert_eq!(held.take(RIGHT, at(1_250)), Some(KeyCode::Right));
        assert_eq!(held.take(Key { released: true, ..RIGHT }, at(1_260)), None);
        assert_eq!(held.at(at(1_261)), None);
    }
}
