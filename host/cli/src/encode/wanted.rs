//! What the words after `mgw encode` ask for. Field names depend on the command, so these words are
//! read here and not by clap; its options may stand among them too.

use crate::args::{BusKind, CodecChoice, EncodeArgs, choice};
use crate::failure::Failure;

/// A frame to build, or a list to print.
#[derive(Debug)]
pub struct Wanted {
    pub protocol: CodecChoice,
    pub to: Option<To>,
    pub bus: Option<BusKind>,
    pub can_id: Option<String>,
    pub list: bool,
    /// Commands that are not to be had here.
    left_out: &'static [&'static str],
    command: Option<String>,
    /// Names and values of fields as they were typed, names with `_`.
    pub fields: Vec<(String, String)>,
}

/// To whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum To {
    Node(u8),
    All,
}

impl Wanted {
    /// Reads the options and the words.
    pub fn new(args: &EncodeArgs) -> Result<Self, Failure> {
        let (mut protocol, mut bus) = (args.protocol, args.bus);
        let (mut node, mut can_id) = (args.node.clone(), args.can_id.clone());
        let mut list = args.list;
        let (mut command, mut fields) = (None, Vec::new());
        let mut words = args.words.iter();
        while let Some(word) = words.next() {
            let Some(option) = word.strip_prefix("--") else {
                if command.is_some() {
                    return Err(usage(format!(
                        "`{word}` is one word too many. Write fields as --FIELD VALUE"
                    )));
                }
                command = Some(word.replace('-', "_"));
                continue;
            };
            let (name, given) = match option.split_once('=') {
                Some((name, value)) => (name, Some(value.to_owned())),
                None => (option, None),
            };
            match name {
                "list" => list = true,
                // Seen to before the command runs.
                "json" => {}
                _ => {
                    let value = given.or_else(|| words.next().cloned());
                    let value = value.ok_or_else(|| usage(format!("`{word}` has no value")))?;
                    match name {
                        "protocol" => once(&mut protocol, name, choice("--protocol", &value)?)?,
                        "bus" => once(&mut bus, name, choice("--bus", &value)?)?,
                        "node" => once(&mut node, name, value)?,
                        "can-id" => once(&mut can_id, name, value)?,
                        field => fields.push((field.replace('-', "_"), value)),
                    }
                }
            }
        }
        if list && (command.is_some() || !fields.is_empty()) {
            return Err(usage(
                "--list lists all commands: give it no command and no fields".into(),
            ));
        }
        let protocol = protocol
            .ok_or_else(|| usage("whose command? Give --protocol rmd, thruster or d5".into()))?;
        if can_id.is_some() && protocol != CodecChoice::D5 {
            return Err(usage(
                "--can-id is for d5: the other protocols have ids of their own".into(),
            ));
        }
        let to = node.as_deref().map(to).transpose()?;
        Ok(Self { protocol, to, bus, can_id, list, left_out: &[], command, fields })
    }

    /// A command for one motor, as `mgw native` takes it from its options: all but `left_out`.
    pub fn of(
        protocol: CodecChoice,
        node: u8,
        command: &str,
        fields: Vec<(String, String)>,
        left_out: &'static [&'static str],
    ) -> Self {
        let command = Some(command.replace('-', "_"));
        let fields =
            fields.into_iter().map(|(name, value)| (name.replace('-', "_"), value)).collect();
        let to = Some(To::Node(node));
        Self { protocol, to, bus: None, can_id: None, list: false, left_out, command, fields }
    }

    /// Whether a command of the table is not to be had here.
    pub fn leaves_out(&self, name: &str) -> bool {
        self.left_out.contains(&name)
    }

    /// The name of the command.
    pub fn command(&self) -> Result<&str, Failure> {
        self.command.as_deref().ok_or_else(|| usage("which command? --list shows them all".into()))
    }

    /// To whom it goes.
    pub fn to(&self) -> Result<To, Failure> {
        self.to.ok_or_else(|| usage("to which motor? Give --node and its number, or `all`".into()))
    }
}

/// Takes the value of an option that may be given once.
fn once<T>(place: &mut Option<T>, option: &str, value: T) -> Result<(), Failure> {
    match place.replace(value) {
        None => Ok(()),
        Some(_) => Err(usage(format!("--{option} is given twice. Give it once"))),
    }
}

fn to(text: &str) -> Result<To, Failure> {
    if text == "all" {
        return Ok(To::All);
    }
    number(text)
        .and_then(|number| (0..=u8::MAX).find(|node| f64::from(*node) == number))
        .map(To::Node)
        .ok_or_else(|| usage(format!("`{text}` is no node. Give the number of a motor, or `all`")))
}

/// A number, decimal or with `0x`, or a switch as a word.
pub fn number(text: &str) -> Option<f64> {
    const HEX: u32 = 16;
    match text {
        "true" | "on" => return Some(1.0),
        "false" | "off" => return Some(0.0),
        _ => {}
    }
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, HEX).ok().map(f64::from),
        None => text.parse().ok(),
    }
}

fn usage(text: String) -> Failure {
    Failure::Usage(text)
}
