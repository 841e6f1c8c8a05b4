//! What the keys ask for. A thread of their own reads them, so that a stop waits for nothing.

use std::sync::mpsc::{Receiver, channel};
use std::thread;

use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use mgw_client::Interrupt;

/// What a person wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Stop every axis.
    Stop,
    /// The axis above, or below.
    Up,
    Down,
    /// Clear the trip of the chosen axis; it is asked whether.
    Clear,
    /// Yes.
    Yes,
    /// Another key, which is no.
    Other,
    /// The terminal has another size.
    Resized,
    /// It is enough.
    Quit,
}

impl Wish {
    /// What a key means.
    pub fn of(key: KeyEvent) -> Option<Self> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        Some(match key.code {
            KeyCode::Char('c' | 'd' | 'C' | 'D') if control => Self::Quit,
            KeyCode::Char(' ' | 's' | 'S') => Self::Stop,
            KeyCode::Char('q' | 'Q') => Self::Quit,
            KeyCode::Up | KeyCode::Char('k') => Self::Up,
            KeyCode::Down | KeyCode::Char('j') => Self::Down,
            KeyCode::Char('c' | 'C') => Self::Clear,
            KeyCode::Char('y' | 'Y') => Self::Yes,
            _ => Self::Other,
        })
    }

    /// Whether what the client waits for is ended for it.
    fn is_urgent(self) -> bool {
        matches!(self, Self::Stop | Self::Quit)
    }
}

/// Reads the keys from now on. The channel ends with the terminal.
pub fn listen(interrupt: Interrupt) -> Receiver<Wish> {
    let (told, wishes) = channel();
    thread::spawn(move || {
        while let Ok(event) = event::read() {
            let wish = match event {
                Event::Key(key) => Wish::of(key),
                Event::Resize(..) => Some(Wish::Resized),
                _ => None,
            };
            let Some(wish) = wish else { continue };
            // First told, then raised: who is interrupted finds the reason.
            if told.send(wish).is_err() {
                return;
            }
            if wish.is_urgent() {
                interrupt.raise();
            }
        }
        drop(told);
        interrupt.raise();
    });
    wishes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stop_is_the_largest_key_and_ctrl_c_stops_nothing() {
        let plain = |code| Wish::of(KeyEvent::new(code, KeyModifiers::NONE));
        assert_eq!(plain(KeyCode::Char(' ')), Some(Wish::Stop));
        assert_eq!(plain(KeyCode::Char('s')), Some(Wish::Stop));
        assert_eq!(plain(KeyCode::Char('c')), Some(Wish::Clear));
        assert_eq!(plain(KeyCode::Esc), Some(Wish::Other));
        let control = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(Wish::of(control), Some(Wish::Quit));
        let released =
            KeyEvent::new_with_kind(KeyCode::Char(' '), KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(Wish::of(released), None);
    }
}
