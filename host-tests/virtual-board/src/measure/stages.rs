//! Which stage of the work each instruction belongs to, from a trace of the program counter.
//!
//! A stage is named by functions. An instruction belongs to the innermost function under way that
//! names one: what copies memory counts where it was called. Which functions are under way follows
//! from the trace: who is entered at its begin was called or has interrupted, who is entered in its
//! midst goes on.

use std::fs;
use std::path::Path;

use object::{Object, ObjectSymbol, SymbolKind};

use super::NotMeasurable;
use crate::machine::{mangled, path};

/// How many stages there are.
pub(crate) const COUNT: usize = STAGES.len();

/// Instructions by stage, in the order of [`STAGES`].
pub(crate) type Counts = [u64; COUNT];

/// The stages, and the paths that their functions begin with; the first that fits counts. The
/// handlers of interrupts have names in capitals.
pub(crate) const STAGES: [(&str, &[&str]); 11] = [
    ("interrupts", &[]),
    ("core: events", &["gateway::gateway::Gateway::handle"]),
    (
        "core: frames for the buses",
        &[
            "motor_gateway::can_bus::CanBus::serve",
            "motor_gateway::shared_gateway::SharedGateway::poll_transmit",
        ],
    ),
    ("core: frames for the hosts", &["motor_gateway::shared_gateway::SharedGateway::poll_host"]),
    ("core: the rest", &["motor_gateway::shared_gateway"]),
    ("host protocol", &["host_protocol", "gateway::link", "postcard"]),
    ("motor protocols", &["rmd", "thruster", "d5"]),
    ("CAN controller", &["motor_gateway::fdcan"]),
    ("UART", &["motor_gateway::line", "embassy_stm32::usart", "embassy_stm32::dma"]),
    ("tasks", &["embassy_executor::raw::TaskStorage$LT$F$GT$", "motor_gateway"]),
    ("executor", &["embassy_executor", "embassy_sync", "embassy_time", "embassy_stm32", "main"]),
];

/// A function of the image.
#[derive(Debug, Clone)]
pub(crate) struct Function {
    pub(crate) begin: u64,
    end: u64,
    stage: Option<usize>,
    pub(crate) path: String,
}

/// The functions of an image.
#[derive(Debug, Clone)]
pub(crate) struct Functions(Vec<Function>);

impl Functions {
    /// Of the file of an image.
    ///
    /// # Errors
    ///
    /// As [`Functions::read`] tells, or if the file cannot be read.
    pub(crate) fn of(image: &Path) -> Result<Self, NotMeasurable> {
        let file = fs::read(image).map_err(|error| error.to_string());
        file.and_then(|file| Self::read(&file))
            .map_err(|error| NotMeasurable(format!("{}: {error}", image.display())))
    }

    /// Of an ELF file.
    ///
    /// # Errors
    ///
    /// In words, if it is none or a stage has no function in it.
    pub(crate) fn read(file: &[u8]) -> Result<Self, String> {
        let file = object::File::parse(file).map_err(|error| error.to_string())?;
        let mut functions = Vec::new();
        let mut has_functions = [false; COUNT];
        for symbol in file.symbols() {
            let (Ok(name), SymbolKind::Text) = (symbol.name(), symbol.kind()) else { continue };
            let stage = stage_of(name);
            if let Some(stage) = stage {
                has_functions[stage] = true;
            }
            let begin = symbol.address() & !1;
            functions.push(Function { begin, end: begin + symbol.size(), stage, path: path(name) });
        }
        // Functions of one text are one function with several names.
        functions.sort_by_key(|function| (function.begin, function.stage.is_none()));
        functions.dedup_by_key(|function| function.begin);
        match has_functions.iter().position(|has| !has) {
            Some(stage) => Err(format!("the image has no function of {:?}", STAGES[stage].0)),
            None => Ok(Self(functions)),
        }
    }

    /// The function that has an instruction.
    pub(crate) fn at(&self, address: u64) -> Option<&Function> {
        let behind = self.0.partition_point(|function| function.begin <= address);
        self.0.get(behind.checked_sub(1)?).filter(|function| address < function.end)
    }
}

#[cfg(test)]
impl Functions {
    /// The function with that path.
    pub(super) fn named(&self, path: &str) -> &Function {
        self.0.iter().find(|function| function.path == path).expect("a function of the image")
    }
}

/// The stage that a function names.
fn stage_of(name: &str) -> Option<usize> {
    if name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_') {
        return Some(0);
    }
    let is_in = |path: &&str| {
        name == *path
            || name.strip_prefix("_ZN").is_some_and(|name| name.starts_with(&mangled(path)))
    };
    STAGES.iter().position(|(_, paths)| paths.iter().any(is_in))
}

/// A trace as it comes.
#[derive(Debug)]
pub(super) struct Stages {
    functions: Functions,
    /// The functions under way, the innermost last, by where they begin, each with its stage or
    /// that of its callers.
    under_way: Vec<(u64, u64, Option<usize>)>,
    counts: Counts,
}

impl Stages {
    /// Of an image with these functions.
    pub(super) fn new(functions: Functions) -> Self {
        Self { functions, under_way: Vec::new(), counts: [0; COUNT] }
    }

    /// The next instruction that is executed.
    pub(super) fn executed(&mut self, address: u64) {
        let is_last = |(begin, end, _): &(u64, u64, _)| (*begin..*end).contains(&address);
        if !self.under_way.last().is_some_and(is_last) {
            let Some(&Function { begin, end, stage, .. }) = self.functions.at(address) else {
                return;
            };
            let known = self.under_way.iter().rposition(|(other, ..)| *other == begin);
            match known.filter(|_| address != begin) {
                Some(at) => self.under_way.truncate(at + 1),
                None => {
                    let caller = self.under_way.last().and_then(|(.., stage)| *stage);
                    self.under_way.push((begin, end, stage.or(caller)));
                }
            }
        }
        // Who was under way before the trace began is the executor.
        let stage = self.under_way.last().and_then(|(.., stage)| *stage).unwrap_or(COUNT - 1);
        self.counts[stage] += 1;
    }

    /// What has been counted so far.
    pub(super) fn counts(&self) -> Counts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(name: &str) -> Option<&'static str> {
        stage_of(name).map(|stage| STAGES[stage].0)
    }

    #[test]
    fn functions_name_their_stages() {
        assert_eq!(stage("FDCAN1_IT1"), Some("interrupts"));
        assert_eq!(stage("_ZN3rmd5reply6decode17h0123456789abcdefE"), Some("motor protocols"));
        assert_eq!(stage("_ZN13motor_gateway5tasks3can3canE"), Some("tasks"));
        assert_eq!(stage("_ZN13motor_gateway5fdcan3canE"), Some("CAN controller"));
        let polled = "_ZN16embassy_executor3raw20TaskStorage$LT$F$GT$4poll17h0123456789abcdefE";
        assert_eq!(stage(polled), Some("tasks"));
        assert_eq!(stage("_ZN4core3fmt5write17h0123456789abcdefE"), None);
    }

    /// A task at 100, a copy at 200 and an interrupt at 300, of 50 bytes each.
    #[test]
    fn a_function_without_a_stage_counts_where_it_was_called() {
        let function =
            |(begin, stage)| Function { begin, end: begin + 50, stage, path: String::new() };
        let functions = [(100, Some(9)), (200, None), (300, Some(0))].map(function).to_vec();
        let mut stages = Stages::new(Functions(functions));
        // The task copies, is interrupted in that by a handler that copies too, and goes on.
        for address in [100, 102, 200, 202, 300, 302, 200, 202, 304, 204, 206, 104] {
            stages.executed(address);
        }
        assert_eq!((stages.counts()[9], stages.counts()[0]), (7, 5));
    }
}
