//! What the motors do, in literal frames: plays the scripts of the folder `scripts`.
//!
//! | A line | means |
//! |---|---|
//! | `let NAME FRAME` | a name for a frame: `ID#DATA` on CAN, bytes in hexadecimal on RS485 |
//! | `steps NAME`, `test NAME` | begins lines that `do NAME` inserts; begins a test |
//! | `motor PROTOCOL NODE [serial]` | the motor of the test |
//! | `> FRAME [= REPLY …]` | the motor hears a frame; what it says within 1 ms, `-` for nothing |
//! | `run MS [= REPLY …]` | time passes; what the motor says meanwhile |
//! | `time MIN..MAX FRAME` | the motor hears a frame; the last four bytes of its reply are ms |
//! | `keep MS FRAME` | the motor hears a frame every 20 ms |
//! | `inject FAULT VALUE`, `power-cycle` | what happens to it |
//! | `speed RANGE`, `position RANGE` | rad/s, rad: a number ± 0.01, or `MIN..MAX` |
//! | `event PLACE TEXT`, `last-event TEXT`, `events COUNT TEXT` | its log; all that are this text |
//! | `fault-word HEX`, `own-timeout MS`, `bitrate BITS` | what else is known of it |
//!
//! Replies and events may hold one `*`, which stands for anything; `~` before a reply: another one
//! of its id and length.

use std::collections::HashMap;
use std::time::Duration;

use host_protocol::Protocol;

use super::Injection;
use super::test_motor::TestMotor;

/// What is checked of a number unless a range is given.
const TOLERANCE: f64 = 0.01;

type Lines<'a> = Vec<(usize, &'a str)>;

struct Script<'a> {
    frames: HashMap<&'a str, &'a str>,
    /// Tests and steps by their names, and whether they are tests.
    parts: Vec<(&'a str, bool, Lines<'a>)>,
}

impl<'a> Script<'a> {
    fn read(text: &'a str) -> Self {
        let mut script = Self { frames: HashMap::new(), parts: Vec::new() };
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.split_once("  #").map_or(line, |(line, _)| line).trim();
            match line.split_once(' ').unwrap_or((line, "")) {
                ("" | "#", _) => {}
                ("let", rest) => {
                    let (name, frame) = rest.split_once(' ').expect("a frame");
                    script.frames.insert(name, frame);
                }
                (word @ ("test" | "steps"), name) => {
                    script.parts.push((name, word == "test", Vec::new()));
                }
                _ => script.parts.last_mut().expect("a test").2.push((number, line)),
            }
        }
        script
    }

    fn play(&self, lines: &Lines<'_>, motor: &mut Option<TestMotor>, test: &str) {
        for (number, line) in lines {
            let place = format!("line {number} of {test}: {line}");
            let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
            match (word, motor.as_mut()) {
                ("do", _) => {
                    let (_, _, lines) =
                        self.parts.iter().find(|(name, ..)| *name == rest).expect(&place);
                    self.play(lines, motor, test);
                }
                ("motor", _) => *motor = Some(self::motor(rest)),
                (_, Some(motor)) => self.step(motor, word, rest, &place),
                (_, None) => panic!("no motor: {place}"),
            }
        }
    }

    fn step(&self, motor: &mut TestMotor, word: &str, rest: &str, place: &str) {
        let (first, last) = rest.split_once(' ').unwrap_or((rest, ""));
        let is_like = |pattern: &str| motor.events().iter().filter(|e| matches(pattern, e)).count();
        match word {
            ">" => {
                let said = self.say(motor, first);
                assert_replies(&said, last, place);
            }
            "run" => {
                let said = motor.run_ms(first.parse().expect(place));
                assert_replies(&said, last, place);
            }
            "time" => {
                let said = self.say(motor, last).join(" ");
                let word = bytes(&said[said.len() - 8..]).try_into().expect(place);
                assert_within(u32::from_le_bytes(word).into(), first, place);
            }
            "keep" => {
                for _ in 0..first.parse::<u64>().expect(place) / 20 {
                    self.say(motor, last);
                    motor.run_ms(19);
                }
            }
            "inject" => motor.inject(injection(first, last).expect(place)),
            "power-cycle" => motor.motor.power_cycle(motor.now),
            "speed" => assert_within(motor.motor.speed_rad_s(), rest, place),
            "position" => assert_within(motor.motor.position_rad(), rest, place),
            "event" => {
                let event = &motor.events()[first.parse::<usize>().expect(place)];
                assert!(matches(last, event), "{place}\n{event}");
            }
            "last-event" => {
                let events = motor.events();
                assert!(
                    events.last().is_some_and(|event| matches(rest, event)),
                    "{place}\n{events:?}"
                );
            }
            "events" => assert_eq!(is_like(last).to_string(), first, "{place}"),
            "fault-word" => {
                assert_eq!(format!("{:04X}", motor.motor.fault_word()), rest, "{place}")
            }
            "own-timeout" => {
                let timeout = motor.motor.own_timeout().expect(place);
                assert_eq!(timeout.as_millis().to_string(), rest, "{place}");
            }
            "bitrate" => assert_eq!(motor.motor.bitrate().to_string(), rest, "{place}"),
            _ => panic!("no such line: {place}"),
        }
    }

    /// The motor hears a frame, by its name or in hexadecimal.
    fn say(&self, motor: &mut TestMotor, frame: &str) -> Vec<String> {
        let frame = self.frames.get(frame).unwrap_or(&frame);
        match frame.split_once('#') {
            Some((id, data)) => motor.ask(u16::from_str_radix(id, 16).unwrap(), &bytes(data)),
            None => motor.ask_serial(&bytes(frame)),
        }
    }
}

fn motor(words: &str) -> TestMotor {
    let mut words = words.split(' ');
    let protocol = words.next().and_then(Protocol::from_name).expect("a protocol");
    let node = words.next().and_then(|node| node.parse().ok()).expect("a node");
    TestMotor::new(protocol, node, words.next() == Some("serial"))
}

fn bytes(hex: &str) -> Vec<u8> {
    assert!(hex.len().is_multiple_of(2), "{hex}");
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn injection(name: &str, value: &str) -> Option<Injection> {
    let on = value == "on";
    assert!(on || value == "off" || value.starts_with(|digit: char| digit.is_ascii_hexdigit()));
    if let Some(switch) = Injection::switch(name, on) {
        return Some(switch);
    }
    Some(match name {
        "fault-bits" => Injection::FaultBits(u16::from_str_radix(value, 16).ok()?),
        "late-reply" => Injection::LateReply(Duration::from_millis(value.parse().ok()?)),
        "lose-replies" => Injection::LoseReplies(value.parse().ok()?),
        _ => return None,
    })
}

/// Compares what was said with `= REPLY …`; with nothing where that is empty.
fn assert_replies(said: &[String], expected: &str, place: &str) {
    let Some(expected) = expected.strip_prefix("= ") else {
        return assert_eq!(expected, "", "{place}");
    };
    let expected: Vec<&str> = expected.split(' ').filter(|reply| *reply != "-").collect();
    let is_same = |(said, expected): (&String, &&str)| match expected.strip_prefix('~') {
        Some(other) => said != other && said.len() == other.len() && said[..4] == other[..4],
        None => matches(expected, said),
    };
    let are_same = said.len() == expected.len() && said.iter().zip(&expected).all(is_same);
    assert!(are_same, "{place}\nsaid: {said:?}");
}

/// Whether a text is a pattern, in which one `*` stands for anything.
fn matches(pattern: &str, text: &str) -> bool {
    pattern.split_once('*').map_or(pattern == text, |(start, end)| {
        text.len() >= start.len() + end.len() && text.starts_with(start) && text.ends_with(end)
    })
}

fn assert_within(value: f64, range: &str, place: &str) {
    let number = |text: &str| text.parse::<f64>().expect(place);
    let (min, max) = match range.split_once("..") {
        Some((min, max)) => (number(min), number(max)),
        None => (number(range) - TOLERANCE, number(range) + TOLERANCE),
    };
    assert!((min..=max).contains(&value), "{place}\nit is {value}");
}

/// Plays each test of a script; there are so many.
fn play(text: &str, tests: usize) {
    let script = Script::read(text);
    let played = script.parts.iter().filter(|(_, is_test, _)| *is_test);
    let played = played.map(|(name, _, lines)| script.play(lines, &mut None, name));
    assert_eq!(played.count(), tests);
}

#[test]
fn rmd() {
    play(include_str!("scripts/rmd.txt"), 40);
}

#[test]
fn thruster() {
    play(include_str!("scripts/thruster.txt"), 24);
}

#[test]
fn d5() {
    play(include_str!("scripts/d5.txt"), 14);
}
