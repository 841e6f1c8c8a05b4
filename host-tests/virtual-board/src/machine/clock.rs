//! Sets the image's clock ahead, as if it had run for hours.

use std::time::Duration;

use super::Machine;

/// What embassy's clock counts in: half the range of a timer of 16 bits (embassy-stm32, time driver).
const DRIVER: &str = "embassy_stm32::time_driver::driver::DRIVER";
const PERIOD_US: u64 = 1 << 15;
/// The timer itself knows whether a period is even.
const STEP: u64 = 2;
/// Called when the clock runs, and before there is a task that waits for it.
const BEFORE_TASKS: &str = "motor_gateway::shared_gateway::SharedGateway::place";
/// A start has called it by then.
const STARTED: Duration = Duration::from_millis(200);
/// More periods have not passed then.
const FEW: u32 = 16;

impl Machine {
    /// Starts the board, and has the image's clock set ahead by `us`, or by up to 66 ms less, before
    /// there is a task that waits for it.
    /// Panics if the image has no such clock. For an STM32H743.
    pub fn start_ahead(&mut self, us: u64) {
        self.hold_at(BEFORE_TASKS, STARTED).expect("the image starts");
        let driver = self.names.get(DRIVER);
        // Beside the periods: a queue and an alarm, both empty, so zeros and ones.
        let words = (driver.address..driver.address + driver.size).step_by(4);
        let mut periods = words
            .map(|at| (at, self.read_word(at)))
            .filter(|(_, word)| (1..FEW).contains(word))
            .collect::<Vec<_>>();
        let (at, passed) = periods.pop().expect("the clock runs");
        assert!(periods.is_empty(), "one word of the clock counts");
        let periods = u32::try_from(us / PERIOD_US / STEP * STEP).expect("less than a century");
        self.write_memory(at, &(passed + periods).to_le_bytes());
        self.let_go();
    }
}
