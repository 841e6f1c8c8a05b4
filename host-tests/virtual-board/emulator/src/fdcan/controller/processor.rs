//! The controller's registers, as the processor sees them.

use rigless::device::DeviceContext;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::time::VirtualNanos;

use super::{Activity, Controller, Kept, Presence, RECOVERY_SEQUENCES};
use crate::fdcan::registers::{cccr, reset};

impl Controller {
    /// What a register reads, and what reading does.
    pub fn read(&mut self, register: Register, now: VirtualNanos, activity: Activity) -> u32 {
        match register {
            Register::FdcanEcr => {
                let counted = self.counted();
                self.kept.errors.read_ecr(counted)
            }
            Register::FdcanPsr => self.kept.errors.read_psr(activity as u32),
            _ => self.peek(register, now, activity),
        }
    }

    /// What a register reads, with nothing changed.
    pub fn peek(&self, register: Register, now: VirtualNanos, activity: Activity) -> u32 {
        let Kept { interrupts, receiver, transmitter, events, .. } = &self.kept;
        match register {
            Register::FdcanCrel => reset::CREL,
            Register::FdcanEndn => reset::ENDN,
            Register::FdcanDbtp => self.kept.dbtp,
            Register::FdcanTest => self.kept.test,
            Register::FdcanRwd => self.kept.rwd,
            Register::FdcanCccr => self.kept.cccr,
            Register::FdcanNbtp => self.kept.nbtp,
            Register::FdcanTscc => self.kept.timestamp.config(),
            Register::FdcanTscv => u32::from(self.kept.timestamp.at(now)),
            Register::FdcanTocc => self.kept.tocc,
            Register::FdcanTocv => reset::TOCV,
            Register::FdcanEcr => self.kept.errors.ecr(self.counted()),
            Register::FdcanPsr => self.kept.errors.psr(activity as u32),
            Register::FdcanTdcr => self.kept.tdcr,
            Register::FdcanIr => interrupts.flags,
            Register::FdcanIe => interrupts.enabled,
            Register::FdcanIls => interrupts.select,
            Register::FdcanIle => interrupts.line_enable,
            Register::FdcanGfc => receiver.filters.global,
            Register::FdcanSidfc => receiver.filters.standard,
            Register::FdcanXidfc => receiver.filters.extended,
            Register::FdcanXidam => receiver.filters.extended_mask,
            Register::FdcanHpms => receiver.high_priority(),
            Register::FdcanNdat1 => receiver.new_data(0),
            Register::FdcanNdat2 => receiver.new_data(1),
            Register::FdcanRxf0c => receiver.fifos[0].config,
            Register::FdcanRxf0s => receiver.fifo_status(0, interrupts),
            Register::FdcanRxbc => receiver.buffers,
            Register::FdcanRxf1c => receiver.fifos[1].config,
            Register::FdcanRxf1s => receiver.fifo_status(1, interrupts),
            Register::FdcanRxesc => receiver.element_sizes,
            Register::FdcanTxbc => transmitter.config,
            Register::FdcanTxfqs => transmitter.status(),
            Register::FdcanTxesc => transmitter.element_size,
            Register::FdcanTxbrp => transmitter.pending(),
            Register::FdcanTxbcr => transmitter.cancel_requests(),
            Register::FdcanTxbto => transmitter.sent(),
            Register::FdcanTxbcf => transmitter.cancelled(),
            Register::FdcanTxbtie => transmitter.sent_interrupts,
            Register::FdcanTxbcie => transmitter.cancelled_interrupts,
            Register::FdcanTxefc => events.config,
            Register::FdcanTxefs => events.status(interrupts),
            // Acknowledgements and requests read 0 once they are carried out; so do the registers
            // of TTCAN.
            _ => 0,
        }
    }

    /// A register is written.
    pub fn write(&mut self, register: Register, value: u32, context: &mut DeviceContext<'_>) {
        let now = context.now();
        match register {
            Register::FdcanCccr => self.write_cccr(value, context),
            Register::FdcanTscv => self.kept.timestamp.clear(now),
            // The timeout counter does not run: enabling it is refused below.
            Register::FdcanTocv => {}
            Register::FdcanIr => self.kept.interrupts.clear(value),
            Register::FdcanIe => self.kept.interrupts.enable(value),
            Register::FdcanIls => self.kept.interrupts.select_lines(value),
            Register::FdcanIle => self.kept.interrupts.enable_lines(value),
            Register::FdcanNdat1 => self.kept.receiver.clear_new_data(0, value),
            Register::FdcanNdat2 => self.kept.receiver.clear_new_data(1, value),
            Register::FdcanRxf0a => self.kept.receiver.acknowledge(0, value),
            Register::FdcanRxf1a => self.kept.receiver.acknowledge(1, value),
            Register::FdcanTxefa => self.kept.events.acknowledge(value),
            Register::FdcanTxbtie => self.kept.transmitter.sent_interrupts = value,
            Register::FdcanTxbcie => self.kept.transmitter.cancelled_interrupts = value,
            Register::FdcanTxbar if !self.is_set(cccr::CCE) => {
                if !self.kept.transmitter.request(value) {
                    context.tell("TXBAR", "a request for the FIFO away from its put index");
                }
            }
            Register::FdcanTxbcr if !self.is_set(cccr::CCE) => {
                let outcome = self.kept.transmitter.cancel(value, self.kept.sending);
                self.raise(outcome);
            }
            Register::FdcanTxbar | Register::FdcanTxbcr => {
                context.tell(name(register), "written while CCE is set");
            }
            Register::FdcanTest if !self.is_set(cccr::TEST) => {
                if value != self.kept.test {
                    context.tell("TEST", "written while CCCR.TEST is clear");
                }
            }
            _ => self.write_configuration(register, value, context),
        }
    }

    /// The registers that can be written only while INIT and CCE are set.
    fn write_configuration(
        &mut self,
        register: Register,
        value: u32,
        context: &mut DeviceContext<'_>,
    ) {
        if self.kept.cccr & (cccr::INIT | cccr::CCE) != cccr::INIT | cccr::CCE {
            context.tell(name(register), "written without INIT and CCE, so it keeps what it holds");
            return;
        }
        if self.lay_out(register, value) {
            return;
        }
        match register {
            Register::FdcanNbtp => {
                self.kept.nbtp = value & 0xFFFF_FF7F;
                self.follow_bit(context.now());
            }
            // Bit rates of CAN FD and their delay compensation: nothing uses them, as FDOE is
            // refused.
            Register::FdcanDbtp => self.kept.dbtp = value,
            Register::FdcanTdcr => self.kept.tdcr = value,
            Register::FdcanTest => {
                self.kept.test = value;
                context.tell("TEST", "test modes are not modelled");
            }
            Register::FdcanRwd => {
                self.kept.rwd = value & 0xFF;
                if self.kept.rwd != 0 {
                    context.tell("RWD", "the watchdog of the message RAM is not modelled");
                }
            }
            Register::FdcanTscc => {
                if !self.kept.timestamp.configure(context.now(), value) {
                    context.tell("TSCC", "the external timestamp counter is not modelled");
                }
            }
            Register::FdcanTocc => {
                self.kept.tocc = value & 0xFFFF_0007;
                if value & 1 != 0 {
                    context.tell("TOCC", "the timeout counter is not modelled");
                }
            }
            // Read-only registers keep what they hold; TTCAN is refused.
            Register::FdcanCrel
            | Register::FdcanEndn
            | Register::FdcanEcr
            | Register::FdcanPsr
            | Register::FdcanHpms
            | Register::FdcanRxf0s
            | Register::FdcanRxf1s
            | Register::FdcanTxfqs
            | Register::FdcanTxbrp
            | Register::FdcanTxbto
            | Register::FdcanTxbcf
            | Register::FdcanTxefs => {}
            _ => context.tell(name(register), "TTCAN is not modelled"),
        }
    }

    /// Filters and queues; false of another register.
    pub fn lay_out(&mut self, register: Register, value: u32) -> bool {
        let Kept { receiver, transmitter, events, .. } = &mut self.kept;
        match register {
            Register::FdcanGfc => receiver.filters.global = value & 0x3F,
            Register::FdcanSidfc => receiver.filters.standard = value & 0x00FF_FFFC,
            Register::FdcanXidfc => receiver.filters.extended = value & 0x007F_FFFC,
            Register::FdcanXidam => receiver.filters.extended_mask = value & 0x1FFF_FFFF,
            Register::FdcanRxf0c => receiver.fifos[0].config = value & 0xFF7F_FFFC,
            Register::FdcanRxf1c => receiver.fifos[1].config = value & 0xFF7F_FFFC,
            Register::FdcanRxbc => receiver.buffers = value & 0x0000_FFFC,
            Register::FdcanRxesc => receiver.element_sizes = value & 0x0000_0777,
            Register::FdcanTxbc => transmitter.config = value & 0x7F3F_FFFC,
            Register::FdcanTxesc => transmitter.element_size = value & 0x7,
            Register::FdcanTxefc => events.config = value & 0x3F3F_FFFC,
            _ => return false,
        }
        true
    }

    fn write_cccr(&mut self, value: u32, context: &mut DeviceContext<'_>) {
        let old = self.kept.cccr;
        let configurable = old & (cccr::INIT | cccr::CCE) == cccr::INIT | cccr::CCE;
        let mut new = old & (cccr::CSA | cccr::INIT | cccr::CCE);
        new = new & !cccr::INIT | value & (cccr::INIT | cccr::CSR);
        // CCE follows only while INIT is set, and ends with it.
        if old & cccr::INIT != 0 {
            new = new & !cccr::CCE | value & cccr::CCE;
        }
        if new & cccr::INIT == 0 {
            new &= !cccr::CCE;
        }
        if new & cccr::CSR == 0 {
            new &= !cccr::CSA;
        }
        new |= if configurable { value & cccr::PROTECTED } else { old & cccr::PROTECTED };
        new |= value & cccr::SET_PROTECTED & if configurable { u32::MAX } else { old };
        for (bits, reason) in [
            (cccr::FDOE | cccr::BRSE | cccr::NISO, "CAN FD is not modelled"),
            (cccr::TEST, "test modes are not modelled"),
        ] {
            if new & !old & bits != 0 {
                context.tell("CCCR", reason);
            }
        }
        self.kept.cccr = new;
        if new & !old & cccr::CCE != 0 {
            self.kept.receiver.restart();
            self.kept.transmitter.restart();
            self.kept.events.restart();
        }
        if new & !old & cccr::INIT != 0 {
            self.leave_bus();
        } else if old & !new & cccr::INIT != 0 {
            let left = if self.kept.errors.is_bus_off() { RECOVERY_SEQUENCES } else { 1 };
            self.kept.presence = Presence::Waiting { left, since: context.now() };
        }
    }
}

/// The name of a register in the emulator's table.
fn name(register: Register) -> &'static str {
    use rigless::soc::Layout;
    register.spec().name
}
