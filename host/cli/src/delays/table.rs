//! The table of reply delays as text: one line for each motor model, firmware, protocol, bus and
//! command. docs/reply-delays.md describes it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::histogram::Histogram;

/// The first line.
pub const HEADER: &str = "reply-delays 1";
/// What stands between two columns, and between two parts of one.
const COLUMN: char = ' ';
const PART: char = ',';
/// What is not known.
pub const UNKNOWN: &str = "unknown";

/// The columns, in their order. docs/reply-delays.md has a row for each.
pub const COLUMNS: [&str; 15] = [
    "protocol", "model", "firmware", "bus", "bitrate", "command", "where", "count", "min", "p50",
    "p99", "max", "when", "gateway", "buckets",
];

/// What a line is about.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// `rmd`, `thruster` or `d5`.
    pub protocol: String,
    /// As the motor tells it, or somebody who knows.
    pub model: String,
    /// The same.
    pub firmware: String,
    /// `can` or `rs485`.
    pub bus: String,
    /// bit/s.
    pub bitrate: u32,
    /// As the codec calls it.
    pub command: String,
    /// Who measured; `simulator` where it is none that has hardware.
    pub place: String,
}

/// What is known of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// The delays, µs.
    pub delays: Histogram,
    /// The days on which it was measured, `2026-11-24`.
    pub days: BTreeSet<String>,
    /// The versions of the gateways that told the times.
    pub gateways: BTreeSet<String>,
}

/// Lines by what they are about.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    entries: BTreeMap<Key, Entry>,
}

impl Table {
    /// Adds an entry to what there is about the same.
    pub fn add(&mut self, key: Key, entry: Entry) {
        match self.entries.get_mut(&key) {
            Some(there) => {
                there.delays.add(&entry.delays);
                there.days.extend(entry.days);
                there.gateways.extend(entry.gateways);
            }
            None => drop(self.entries.insert(key, entry)),
        }
    }

    /// Adds a whole table.
    pub fn merge(&mut self, other: Self) {
        other.entries.into_iter().for_each(|(key, entry)| self.add(key, entry));
    }

    /// Every entry, in the order of their lines.
    pub fn entries(&self) -> impl Iterator<Item = (&Key, &Entry)> {
        self.entries.iter()
    }

    /// Whether a text is a table, well formed or not.
    pub fn begins(text: &str) -> bool {
        lines(text).next().is_some_and(|(_, line)| line.starts_with("reply-delays"))
    }

    /// Reads a table.
    ///
    /// # Errors
    /// The number of the first line that is wrong, what is wrong there and what is allowed.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut lines = lines(text);
        match lines.next() {
            Some((_, HEADER)) => {}
            Some((number, line)) => {
                return Err(format!(
                    "line {number}: `{line}` is not `{HEADER}`, which comes first"
                ));
            }
            None => return Err(format!("line 1: it is empty; the first line is `{HEADER}`")),
        }
        let mut table = Self::default();
        for (number, line) in lines {
            let (key, entry) = parse_line(line).map_err(|what| format!("line {number}: {what}"))?;
            if table.entries.contains_key(&key) {
                return Err(format!(
                    "line {number}: a line above is about the same; merge them with `mgw delays`"
                ));
            }
            table.add(key, entry);
        }
        Ok(table)
    }
}

/// The lines that say something, and their numbers.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines().map(str::trim_end));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn parse_line(line: &str) -> Result<(Key, Entry), String> {
    let columns: Vec<&str> = line.split(COLUMN).collect();
    let columns: [&str; COLUMNS.len()] = columns.as_slice().try_into().map_err(|_| {
        format!(
            "{} columns; a line has {}, one space between: {}",
            columns.len(),
            COLUMNS.len(),
            COLUMNS.join(" ")
        )
    })?;
    let [
        protocol,
        model,
        firmware,
        bus,
        bitrate,
        command,
        place,
        count,
        min,
        p50,
        p99,
        max,
        when,
        gateway,
        buckets,
    ] = columns;
    let key = Key {
        protocol: one_of("protocol", protocol, &["rmd", "thruster", "d5"])?,
        model: word("model", model)?,
        firmware: word("firmware", firmware)?,
        bus: one_of("bus", bus, &["can", "rs485"])?,
        bitrate: number("bitrate", bitrate)?,
        command: word("command", command)?,
        place: word("where", place)?,
    };
    let delays =
        Histogram::stated(number("min", min)?, number("max", max)?, parse_buckets(buckets)?)?;
    let stated = [
        ("count", number::<u64>("count", count)?, delays.count()),
        ("p50", number::<u64>("p50", p50)?, delays.percentile(50).into()),
        ("p99", number::<u64>("p99", p99)?, delays.percentile(99).into()),
    ];
    for (name, stated, counted) in stated {
        if stated != counted {
            return Err(format!("{name} is {stated}, and the buckets say {counted}"));
        }
    }
    let days = parts("when", when, is_day, "days, as 2026-11-24")?;
    let gateways = parts("gateway", gateway, is_word, WORD)?;
    Ok((key, Entry { delays, days, gateways }))
}

/// What a word may have.
const WORD: &str = "letters, digits and . _ - + only, 1 to 64 of them";

/// Whether a text can stand in a line.
fn is_word(text: &str) -> bool {
    let is_plain = |at: char| at.is_ascii_alphanumeric() || matches!(at, '.' | '_' | '-' | '+');
    (1..=64).contains(&text.len()) && text.chars().all(is_plain)
}

/// A text of a motor or a person as a word: what a word has not becomes `_`.
pub fn to_word(text: &str) -> String {
    let text = text.trim().trim_end_matches('\0');
    let plain = text.chars().map(|at| if is_word(&at.to_string()) { at } else { '_' });
    let word: String = plain.take(64).collect();
    if word.is_empty() { UNKNOWN.to_owned() } else { word }
}

/// A word that somebody has typed.
///
/// # Errors
/// It is none, and what is allowed.
pub fn typed_word(text: &str) -> Result<String, String> {
    if is_word(text) { Ok(text.to_owned()) } else { Err(format!("takes {WORD}")) }
}

/// Four, two and two digits.
fn is_day(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let is =
        |part: &str, digits| part.len() == digits && part.bytes().all(|at| at.is_ascii_digit());
    matches!(parts.as_slice(), [year, month, day] if is(year, 4) && is(month, 2) && is(day, 2))
}

fn word(name: &str, text: &str) -> Result<String, String> {
    if is_word(text) {
        Ok(text.to_owned())
    } else {
        Err(format!("{name} `{text}` may have {WORD}"))
    }
}

fn one_of(name: &str, text: &str, all: &[&str]) -> Result<String, String> {
    if all.contains(&text) {
        Ok(text.to_owned())
    } else {
        Err(format!("{name} `{text}` is none of {}", all.join(", ")))
    }
}

/// Without a sign or zeros before it, so that a number has one text.
fn number<T: std::str::FromStr + ToString>(name: &str, text: &str) -> Result<T, String> {
    let number = text.parse::<T>().ok().filter(|number| number.to_string() == text);
    number.ok_or_else(|| format!("{name} `{text}` is no whole number, or too large"))
}

fn parts(
    name: &str,
    text: &str,
    is: impl Fn(&str) -> bool,
    allowed: &str,
) -> Result<BTreeSet<String>, String> {
    let parts: Vec<&str> = text.split(PART).collect();
    if let Some(wrong) = parts.iter().find(|part| !is(part)) {
        return Err(format!("{name} `{wrong}` is wrong; it takes {allowed}, commas between"));
    }
    let set: BTreeSet<String> = parts.iter().map(|part| (*part).to_owned()).collect();
    if !parts.is_sorted() || set.len() != parts.len() {
        return Err(format!("{name} `{text}` is not in order, each once"));
    }
    Ok(set)
}

fn parse_buckets(text: &str) -> Result<BTreeMap<u32, u64>, String> {
    let mut counts = BTreeMap::new();
    for part in text.split(PART) {
        let (bucket, count) =
            part.split_once(':').ok_or_else(|| format!("bucket `{part}` is not BUCKET:COUNT"))?;
        let bucket = number("bucket", bucket)?;
        if counts.keys().next_back().is_some_and(|before| *before >= bucket) {
            return Err(format!("bucket {bucket} is not in order, each once"));
        }
        counts.insert(bucket, number("the count of a bucket", count)?);
    }
    Ok(counts)
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{HEADER}")?;
        writeln!(f, "# {}", COLUMNS.join(" "))?;
        for (key, entry) in &self.entries {
            let Key { protocol, model, firmware, bus, bitrate, command, place } = key;
            let delays = &entry.delays;
            let list = |set: &BTreeSet<String>| set.iter().cloned().collect::<Vec<_>>().join(",");
            let buckets: Vec<String> =
                delays.counts().map(|(bucket, count)| format!("{bucket}:{count}")).collect();
            writeln!(
                f,
                "{protocol} {model} {firmware} {bus} {bitrate} {command} {place} {} {} {} {} {} {} \
                 {} {}",
                delays.count(),
                delays.least(),
                delays.percentile(50),
                delays.percentile(99),
                delays.most(),
                list(&entry.days),
                list(&entry.gateways),
                buckets.join(",")
            )?;
        }
        Ok(())
    }
}
