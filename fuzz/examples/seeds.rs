//! Writes the seeds of each target into a folder of its name: `.ci/fuzz` runs
//! `cargo run --example seeds -- FOLDER` in this folder.
//!
//! From the golden vectors one input for each command and direction of a codec, all frames in one
//! line for a deframer, one input for each host message; random steps for the whole core.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use checks::frames::Input;
use host_protocol::Deframer;

type Seeds = BTreeMap<String, Vec<u8>>;

fn main() {
    let root = std::env::args().nth(1).expect("the folder to write to");
    let seeds = [
        ("rmd", codec("rmd", "141#9C00000000000000")),
        ("thruster", codec("thruster", "30B#51560000")),
        ("d5", codec("d5", "00B#D50B050100000011")),
        ("rmd_rs485", lines("rmd", "rs485", |frame| [&frame[1..2], &frame[3..11]].concat())),
        ("d5_serial", lines("d5", "can", |frame| [&frame[..1], frame].concat())),
        ("host_messages", host_messages()),
        ("host_stream", host_stream()),
        ("promises_hosts", steps()),
        ("promises_buses", steps()),
        ("promises_bad_hosts", steps()),
    ];
    for (target, seeds) in seeds {
        let folder = Path::new(&root).join(target);
        fs::create_dir_all(&folder).expect("the folder of seeds can be written");
        for (name, bytes) in seeds {
            fs::write(folder.join(name), bytes).expect("a seed can be written");
        }
    }
}

/// The lines of a vector file, cut into columns.
fn vectors(file: &str) -> Vec<Vec<String>> {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../host-tests/vectors/{file}.txt"));
    let text = fs::read_to_string(path).expect("the vectors can be read");
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| line.split(" | ").map(str::to_owned).collect()).collect()
}

fn unhex(text: &str) -> Vec<u8> {
    let digits = text.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).expect("hex"));
    digits.map(|pair| u8::from_str_radix(pair, 16).expect("hex")).collect()
}

fn frame(text: &str) -> Option<(u16, Vec<u8>)> {
    let (id, data) = text.split_once('#')?;
    Some((u16::from_str_radix(id, 16).expect("hex"), unhex(data)))
}

/// The first frame of each meaning in each direction; a reply waits for the request before it.
fn codec(file: &str, first: &str) -> Seeds {
    let mut seeds = Seeds::new();
    let (_, mut pending) = frame(first).expect("id#data");
    for columns in vectors(file) {
        let Some((id, data)) = frame(&columns[3]) else { continue };
        let meaning: String = columns[4].chars().take_while(char::is_ascii_alphanumeric).collect();
        let name = format!("{}-{meaning}", columns[1]);
        seeds.entry(name).or_insert_with(|| Input::bytes(id, &data, &pending));
        if columns[1] == "request" {
            pending = data;
        }
    }
    seeds
}

/// Lines of eight frames each, every fourth frame cut, with garbage behind it.
fn lines(file: &str, bus: &str, seed: impl Fn(&[u8]) -> Vec<u8>) -> Seeds {
    const WHOLE: u8 = 0x80;
    const CUT_BY_3: u8 = 0x83;
    let vectors = vectors(file);
    let frames = vectors.iter().filter(|columns| columns[2] == bus).map(|columns| {
        match frame(&columns[3]) {
            Some((_, data)) => data,
            None => unhex(&columns[3]),
        }
    });
    let frames: Vec<_> = frames.collect();
    let chunks = frames.chunks(8).enumerate().map(|(index, chunk)| {
        let mut line = vec![20];
        for (at, frame) in chunk.iter().enumerate() {
            line.push(if at % 4 == 3 { CUT_BY_3 } else { WHOLE });
            line.extend(seed(frame));
            if at % 4 == 3 {
                line.extend([5, 0x3E, 0x01, 0x08, 0xD5, 0x5D]);
            }
        }
        (format!("frames-{index:02}"), line)
    });
    chunks.collect()
}

/// Kind, number and body of every frame of the host protocol's vectors, by name.
fn messages() -> Vec<(String, u8, u16, Vec<u8>)> {
    let mut messages = Vec::new();
    for columns in vectors("host-protocol") {
        let mut deframer = Deframer::new();
        for byte in unhex(&columns[1]) {
            if let Some(Ok(frame)) = deframer.push(byte) {
                let name = columns[0].split(':').next().unwrap_or_default().to_owned();
                messages.push((name, frame.kind as u8, frame.number, frame.body.to_vec()));
            }
        }
    }
    messages
}

fn host_messages() -> Seeds {
    let mut seeds = Seeds::new();
    for (name, kind, number, body) in messages() {
        let bytes = [&[kind - 1][..], &number.to_le_bytes(), &body].concat();
        seeds.entry(format!("{kind}-{name}")).or_insert(bytes);
    }
    seeds
}

fn host_stream() -> Seeds {
    let frames = vectors("host-protocol").into_iter().map(|columns| unhex(&columns[1]));
    let frames: Vec<_> = frames.filter(|frame| frame.len() < 0x40).collect();
    let chunks = frames.chunks(8).enumerate().map(|(index, chunk)| {
        let pieces = chunk.iter().map(|frame| {
            let length = u8::try_from(frame.len()).expect("short");
            [&[length], &frame[..], &[0x80, 0, 1, 0, 2, 0, 0, 0, 0, 0, 2, 0x55, 0x00]].concat()
        });
        (format!("frames-{index:02}"), pieces.collect::<Vec<_>>().concat())
    });
    chunks.collect()
}

/// Steps that the model check would choose at random: a few, and many.
fn steps() -> Seeds {
    let random = |(name, length): (&str, usize)| {
        let mut random = fastrand::Rng::with_seed(1);
        (name.to_owned(), std::iter::repeat_with(|| random.u8(..)).take(length).collect())
    };
    [("short", 120), ("long", 500)].into_iter().map(random).collect()
}
