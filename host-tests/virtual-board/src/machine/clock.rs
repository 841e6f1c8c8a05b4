//! Sets the image's clock ahead, as if it had run for hours.

use std::time::Duration;

use rigless::mcu::Operate as _;
use rigless::soc::Width;

use super::Machine;
use crate::nodes::instant;

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

/// What the timer counts (TIM2 CNT, both chips), and the bits of it that the driver looks at.
const COUNT: u64 = 0x4000_0024;
const COUNT_BITS: u64 = 0xFFFF;

impl Machine {
    /// Starts the board, and has the image's clock set ahead by `us`, or by up to 66 ms less, before
    /// there is a task that waits for it. `twin`: another board with this image, which has not
    /// started; it shows which word counts.
    /// Panics if the image has no such clock.
    pub fn start_ahead(&mut self, us: u64, mut twin: Self) {
        twin.run_for(STARTED);
        let at = twin.clock_periods().0;
        self.hold_at(BEFORE_TASKS, STARTED).expect("the image starts");
        let passed = self.read_word(at);
        let periods = u32::try_from(us / PERIOD_US / STEP * STEP).expect("less than a century");
        self.write_memory(at, &(passed + periods).to_le_bytes());
        self.let_go();
    }

    /// How many halves of the timer's range the image's clock has counted, and whether the timer is
    /// in such a half; as long as these are few, but some.
    /// Panics if the image has no such clock.
    pub fn clock_agrees(&mut self) -> (u32, bool) {
        let (_, periods) = self.clock_periods();
        let now = instant(self.now());
        let count = self.part_mut().read(now, COUNT, Width::W32).expect("a register") & COUNT_BITS;
        (periods, count / PERIOD_US == u64::from(periods) % STEP)
    }

    /// Where that number stands, and it.
    fn clock_periods(&mut self) -> (u64, u32) {
        let driver = self.names.get(DRIVER);
        // Beside the periods: a queue and an alarm, which are no such numbers.
        let words = (driver.address..driver.address + driver.size).step_by(4);
        let mut periods = words
            .map(|at| (at, self.read_word(at)))
            .filter(|(_, word)| (1..FEW).contains(word))
            .collect::<Vec<_>>();
        let found = periods.pop().expect("the clock runs");
        assert!(periods.is_empty(), "one word of the clock counts");
        found
    }
}
