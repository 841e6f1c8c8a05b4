//! Where instructions go: by function, and by line of the source.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use addr2line::Loader;

use super::NotMeasurable;
use super::stages::Functions;

/// How often each instruction was executed, by its address.
pub(crate) type Executed = BTreeMap<u64, u64>;

/// What is less than this share of all is not shown: one of so many.
const LEAST_SHARE: u64 = 500;

/// Turns counts by address into names.
pub(crate) struct Profiler {
    functions: Functions,
    sources: Loader,
}

impl Profiler {
    /// Of an image with the debugger's information in it.
    ///
    /// # Errors
    ///
    /// In words, if there is none.
    pub(crate) fn new(image: &Path, functions: Functions) -> Result<Self, NotMeasurable> {
        let sources = Loader::new(image)
            .map_err(|error| NotMeasurable(format!("{}: {error}", image.display())))?;
        Ok(Self { functions, sources })
    }

    /// A table of the functions, and one of the lines, that took most, each figure divided by
    /// `times`. A line is told with the lines that it was called from, where that call is inlined.
    pub(crate) fn table(&self, what: &str, executed: &Executed, times: u64) -> String {
        let (mut functions, mut lines) = (BTreeMap::new(), BTreeMap::new());
        for (&address, &count) in executed {
            let function = self.functions.at(address);
            // A generic function is there once for each of its types.
            let name = function.map_or_else(
                || "?".to_owned(),
                |function| format!("{} {:#x}", function.path, function.begin),
            );
            let (instructions, calls) = functions.entry(name).or_insert((0, 0));
            *instructions += count;
            if function.is_some_and(|function| function.begin == address) {
                *calls += count;
            }
            *lines.entry(self.line(address)).or_insert(0) += count;
        }
        let all: u64 = executed.values().sum();
        let functions = sorted(functions, all, |(instructions, _)| *instructions);
        let lines = sorted(lines, all, |instructions| *instructions);
        let mut text = String::new();
        writeln!(text, "{what}: {} instructions\n  self   calls", all / times).expect("a string");
        for (name, (instructions, calls)) in functions {
            let (whole, tenths) = (calls / times, calls * 10 / times % 10);
            writeln!(text, "{:>6} {whole:>5}.{tenths} {name}", instructions / times)
                .expect("a string");
        }
        writeln!(text, "  self line").expect("a string");
        for (line, instructions) in lines {
            writeln!(text, "{:>6} {line}", instructions / times).expect("a string");
        }
        text
    }

    /// The lines of this project that an instruction is of, the outermost first; where there is
    /// none, the outermost of another.
    fn line(&self, address: u64) -> String {
        let (mut lines, mut outermost) = (Vec::new(), String::new());
        if let Ok(mut frames) = self.sources.find_frames(address) {
            while let Ok(Some(frame)) = frames.next() {
                let Some(location) = frame.location else { continue };
                let (Some(file), Some(line)) = (location.file, location.line) else { continue };
                outermost = format!("{}:{line}", short(file));
                if !file.contains("/rustc/") && !file.contains("/registry/") {
                    lines.push(outermost.clone());
                }
            }
        }
        if lines.is_empty() {
            return format!("({outermost})");
        }
        lines.reverse();
        lines.join(" > ")
    }
}

/// Of a path the file, and of a `mod.rs` its folder, too.
fn short(file: &str) -> String {
    let path = PathBuf::from(file);
    let parts = if path.ends_with("mod.rs") { 2 } else { 1 };
    let skipped = path.components().count().saturating_sub(parts);
    path.iter().skip(skipped).collect::<PathBuf>().display().to_string()
}

/// The greatest first, without what is small.
fn sorted<T>(of: BTreeMap<String, T>, all: u64, count: fn(&T) -> u64) -> Vec<(String, T)> {
    let mut of: Vec<_> =
        of.into_iter().filter(|(_, value)| count(value) * LEAST_SHARE >= all).collect();
    of.sort_by_key(|(_, value)| std::cmp::Reverse(count(value)));
    of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::image_path;

    #[test]
    fn a_file_is_told_by_its_name_and_a_module_by_its_folder() {
        assert_eq!(short("/work/crates/gateway/src/set.rs"), "set.rs");
        assert_eq!(short("crates/gateway/src/bus/mod.rs"), "bus/mod.rs");
    }

    #[test]
    fn counts_are_of_functions_and_of_the_lines_they_came_from() {
        let image = image_path().unwrap();
        let functions = Functions::read(&std::fs::read(&image).unwrap()).unwrap();
        let handler = functions.named("gateway::gateway::Gateway::handle");
        let begin = handler.begin;
        let profiler = Profiler::new(&image, functions).unwrap();
        let table = profiler.table("all", &Executed::from([(begin, 6), (begin + 2, 4)]), 2);
        let [first, _, function, _, lines @ ..] = &table.lines().collect::<Vec<_>>()[..] else {
            panic!("{table}")
        };
        assert_eq!(*first, "all: 5 instructions");
        assert!(
            function.starts_with("     5     3.0 gateway::gateway::Gateway::handle"),
            "{table}"
        );
        assert!(!lines.is_empty() && lines.iter().all(|line| line.contains(".rs:")), "{table}");
    }
}
