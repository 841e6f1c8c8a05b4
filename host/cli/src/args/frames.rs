//! The arguments of `decode` and `encode`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::failure::Failure;

#[derive(Debug, Args)]
pub struct DecodeArgs {
    /// The captures, one after the other; `-` is standard input, as is no file at all
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Whose frames they are; `auto` goes by CAN ids and by the first bytes of a frame
    #[arg(long, value_enum, default_value_t = ProtocolChoice::Auto)]
    pub protocol: ProtocolChoice,
    /// Take lines of this kind only; without it each line is taken for what it looks like
    #[arg(long, value_enum)]
    pub bus: Option<BusKind>,
    /// Which way frames go that do not say so (RMD on RS485 and CAN id 300); without it guessed
    /// from their order and form
    #[arg(long, value_enum)]
    pub direction: Option<DirectionChoice>,
    /// The version of the protocol that the RMD motors speak: unknown, v3_6, v3_7, v3_9, v4_2, v4_3
    /// or v4_4
    #[arg(long, default_value = "v3_6", value_name = "DIALECT", value_parser = dialect_of)]
    pub dialect: rmd::Dialect,
    /// Thrusters return frames without a header, although the capture does not show them being set
    /// so
    #[arg(long)]
    pub headerless: bool,
}

#[derive(Debug, Args)]
pub struct EncodeArgs {
    /// Whose command it is
    #[arg(long, value_enum)]
    pub protocol: Option<CodecChoice>,
    /// The motor, a number or `all`
    #[arg(long, value_name = "NODE|all")]
    pub node: Option<String>,
    /// The kind of bus
    #[arg(long, value_enum)]
    pub bus: Option<BusKind>,
    /// CAN id of a D5 frame, in hexadecimal; the number of the motor without it
    #[arg(long, value_name = "ID")]
    pub can_id: Option<String>,
    /// List every command with its fields, units and ranges
    #[arg(long)]
    pub list: bool,
    /// The command and its fields
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "COMMAND [--FIELD VALUE]"
    )]
    pub words: Vec<String>,
}

impl EncodeArgs {
    /// Whether `--json` stands among the words of the command.
    pub fn asks_for_json(&self) -> bool {
        self.words.iter().any(|word| word == "--json")
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProtocolChoice {
    Auto,
    Rmd,
    Thruster,
    D5,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CodecChoice {
    Rmd,
    Thruster,
    D5,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BusKind {
    Can,
    #[value(alias = "serial")]
    Rs485,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DirectionChoice {
    Request,
    Reply,
}

/// One of the values of an option, where clap does not read it.
pub fn choice<T: ValueEnum>(option: &str, text: &str) -> Result<T, Failure> {
    T::from_str(text, true).map_err(|_| {
        let values = T::value_variants().iter().filter_map(ValueEnum::to_possible_value);
        let names: Vec<String> = values.map(|value| value.get_name().to_owned()).collect();
        Failure::Usage(format!("{option} is {}, not `{text}`", names.join(" or ")))
    })
}

/// A dialect by its name; else which there are.
pub fn dialect_of(name: &str) -> Result<rmd::Dialect, String> {
    let names = rmd::Dialect::ALL.map(rmd::Dialect::name);
    let named = rmd::Dialect::ALL.into_iter().find(|dialect| dialect.name() == name);
    named.ok_or_else(|| format!("there are {}", names.join(", ")))
}
