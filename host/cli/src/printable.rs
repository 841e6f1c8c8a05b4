//! Text that must not command the terminal.

use std::borrow::Cow;
use std::fmt::Write;

/// The line with each control character, and each that turns the direction of writing around, as
/// `\u001b`. What a gateway, a capture or a file says is shown, and obeyed by no terminal. In a
/// line of JSON such characters can only stand in strings, and there the escape means the same.
pub fn printable(line: &str) -> Cow<'_, str> {
    if !line.contains(commands_the_terminal) {
        return Cow::Borrowed(line);
    }
    let mut escaped = String::with_capacity(line.len());
    for character in line.chars() {
        if commands_the_terminal(character) {
            // Writing to a string does not fail.
            let _ = write!(escaped, "\\u{:04x}", u32::from(character));
        } else {
            escaped.push(character);
        }
    }
    Cow::Owned(escaped)
}

fn commands_the_terminal(character: char) -> bool {
    let separates_or_turns = matches!(character,
        '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() || separates_or_turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_shown() {
        assert_eq!(
            printable("stop\u{1b}[2J\r\n\u{7f}\u{9b}31m"),
            r"stop\u001b[2J\u000d\u000a\u007f\u009b31m"
        );
        assert_eq!(printable("\u{202e}pots"), r"\u202epots");
        assert_eq!(printable("axis 0: 1,5 µs °C \\u"), "axis 0: 1,5 µs °C \\u");
    }

    #[test]
    fn a_line_of_json_says_the_same_as_before() {
        let value = serde_json::json!({ "board": "a\u{1b}\u{9b}\u{202e}\"\\b" });
        let line = value.to_string();
        let shown = printable(&line);
        assert!(shown.is_ascii(), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
    }
}
