//! Turns of the tasks: the longest ones, and those behind the cause of a stop in their order. None is
//! interrupted by another task, so a stop waits for the one under way: for the eyes of who looks for
//! the cause of a late stop.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::time::Duration;

use crate::machine::Machine;
use crate::measure::Functions;

/// How often the board is looked at, and how long each time: two periods of a cycle of 16 axes.
const LOOKS: u32 = 80;
const LOOK: Duration = Duration::from_micros(100);
/// Behind the cause of a stop finer, until the last stop has left.
const LOOKS_BEHIND: u32 = 500;
const LOOK_BEHIND: Duration = Duration::from_micros(10);
/// How many turns are told, and of each how many functions.
const TURNS: usize = 6;
const FUNCTIONS: usize = 8;
/// What polls a task.
const POLL: &str = "embassy_executor::raw::TaskStorage";

/// Of a board in some situation, as text: instructions of each turn, with those of interrupts
/// meanwhile, by function.
pub(super) fn longest(machine: &mut Machine, functions: &Functions) -> String {
    let executed = executed(machine, LOOKS, LOOK);
    let mut turns = turns(&executed, |(_, address)| is_poll(functions, *address));
    turns.sort_by_key(|turn| Reverse(turn.len()));
    turns.truncate(TURNS);
    turns.into_iter().map(|turn| told(paths(&executed[turn], functions))).collect()
}

/// The same of every turn from now on, in their order, each with when it begins.
pub(super) fn in_order(machine: &mut Machine, functions: &Functions) -> String {
    let begin = machine.now();
    let executed = executed(machine, LOOKS_BEHIND, LOOK_BEHIND);
    let turns = turns(&executed, |(_, address)| is_poll(functions, *address));
    let tell = |turn: Range<usize>| {
        let at = executed[turn.start].0.saturating_sub(begin);
        format!("{:8} us\n{}", at.as_micros(), told(paths(&executed[turn], functions)))
    };
    turns.into_iter().map(tell).collect()
}

/// The instructions that are executed while the board is looked at so often, so long each time: when
/// the look ended, and where it stands.
fn executed(machine: &mut Machine, looks: u32, look: Duration) -> Vec<(Duration, u64)> {
    let code = machine.code();
    machine.trace(code.clone(), true);
    let mut executed = Vec::new();
    for _ in 0..looks {
        machine.run_for(look);
        let now = machine.now();
        executed.extend(machine.take_hits().iter().map(|hit| (now, hit.address)));
    }
    machine.trace(code, false);
    executed
}

/// Whether a task's poll begins there.
fn is_poll(functions: &Functions, address: u64) -> bool {
    let function = functions.at(address);
    function.is_some_and(|at| at.begin == address && at.path.starts_with(POLL))
}

fn paths<'a>(
    executed: &'a [(Duration, u64)],
    functions: &'a Functions,
) -> impl Iterator<Item = &'a str> {
    let path = |address| functions.at(address).map_or("?", |at| at.path.as_str());
    executed.iter().map(move |(_, address)| path(*address))
}

/// From each poll of a task to the next.
fn turns<T>(executed: &[T], is_poll: impl Fn(&T) -> bool) -> Vec<Range<usize>> {
    let polls: Vec<usize> = (0..executed.len()).filter(|at| is_poll(&executed[*at])).collect();
    polls.windows(2).map(|two| two[0]..two[1]).collect()
}

fn told<'a>(paths: impl Iterator<Item = &'a str>) -> String {
    let mut counts = BTreeMap::<&str, usize>::new();
    paths.for_each(|path| *counts.entry(path).or_default() += 1);
    let mut text = format!("{:8} instructions\n", counts.values().sum::<usize>());
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| Reverse(*count));
    for (path, count) in counts.into_iter().take(FUNCTIONS) {
        let _ = writeln!(text, "{count:12} {path}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_ends_where_the_next_task_is_polled() {
        assert_eq!(turns(&[1, 9, 2, 2, 9, 3, 9], |address| *address == 9), [1..4, 4..6]);
    }

    #[test]
    fn the_function_with_most_of_it_is_told_first() {
        let text = told(["a::b", "c", "c"].into_iter());
        assert_eq!(text, "       3 instructions\n           2 c\n           1 a::b\n");
    }
}
