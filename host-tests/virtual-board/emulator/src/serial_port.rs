//! A serial port of the part, with what the emulator's model of it leaves out.
//!
//! The emulator's [`Usart`] moves whole words at the right times. Added here, after the register
//! descriptions in stm32-metapac (`usart_v4`) and the driver of embassy-stm32:
//!
//! - character match: CMF and CMIE, with the character in CR2.ADD, cleared by ICR.CMCF. The
//!   firmware wakes on the delimiter of the host protocol with it. It is raised as the word leaves
//!   RDR; where the receiver's DMA takes it, as in the firmware, that is the instant it arrives.
//! - [`Settings`]: the far end learns the port's bit time and whether its driver-enable output is
//!   on.
//! - a framing error in a word of the far end's choice ([`FarEnd::damages`]).
//! - the far end's events survive a reset of the port alone, as by a bit in the RCC.

pub mod bench;
mod low_power;
mod settings;

pub use settings::{DriverEnable, Settings};

use rigless::chip::Timeline;
use rigless::chip::uart::{Errors, Peer, Rate};
use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::usart1::{Register, cr1, cr2, cr3, icr, isr};
use rigless::soc::stm32h743::peripherals::usart::{DEFAULT_KERNEL_HZ, Usart};
use rigless::time::{EventId, VirtualNanos};

use low_power::LowPower;

/// Position of the port's only interrupt.
const INTERRUPT: usize = 0;
/// The name that the draws of a damaged word go by.
const DAMAGED_WORD: &str = "damaged word";

/// What hangs on a serial port: a far end as the emulator has it, and what its seam leaves out.
pub trait FarEnd: Peer {
    /// The port has been set up, or set up anew.
    fn port_set_up(&mut self, _settings: Settings) {}

    /// Whether the word that it handed over last arrives with a framing error.
    fn damages(&mut self) -> bool {
        false
    }
}

/// How the port reaches its far end as a [`FarEnd`], whatever its type.
#[derive(Debug, Clone, Copy)]
struct Hooks {
    set_up: fn(&mut Usart, Settings),
    damages: fn(&mut Usart) -> bool,
}

impl Hooks {
    fn of<P: FarEnd>() -> Self {
        Self {
            set_up: |usart, settings| {
                if let Some(peer) = usart.chip_mut::<P>() {
                    peer.port_set_up(settings);
                }
            },
            damages: |usart| usart.chip_mut::<P>().is_some_and(FarEnd::damages),
        }
    }
}

/// One serial port and its far end.
#[derive(Debug)]
pub struct SerialPort {
    usart: Usart,
    hooks: Option<Hooks>,
    settings: Settings,
    kernel_hz: u64,
    /// Set where the port is an LPUART.
    low_power: Option<LowPower>,
    /// CMF.
    matched: bool,
    /// The interrupt is raised for CMF.
    raised: bool,
}

store!(SerialPort {
    values: [settings, kernel_hz, low_power, matched, raised],
    parts: [usart],
    built: [hooks]
});

impl Default for SerialPort {
    fn default() -> Self {
        Self::new()
    }
}

impl SerialPort {
    /// A port out of reset with nothing on its pins.
    #[must_use]
    pub fn new() -> Self {
        Self {
            usart: Usart::new(),
            hooks: None,
            settings: Settings::default(),
            kernel_hz: DEFAULT_KERNEL_HZ,
            low_power: None,
            matched: false,
            raised: false,
        }
    }

    /// An LPUART: the same but for its divider.
    #[must_use]
    pub fn low_power() -> Self {
        Self { low_power: Some(LowPower::default()), ..Self::new() }
    }

    /// Hangs a far end on the port, in place of what was there.
    pub fn attach<P: FarEnd>(&mut self, mut peer: P) {
        peer.port_set_up(self.settings);
        self.usart.attach(peer);
        self.hooks = Some(Hooks::of::<P>());
    }

    /// The far end, as the type that was hung there.
    pub fn peer_mut<P: FarEnd>(&mut self) -> Option<&mut P> {
        self.usart.chip_mut()
    }

    /// Changes the far end at the instant of `context`; `None` if it is of another type.
    pub fn drive<P: FarEnd, T>(
        &mut self,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
        change: impl FnOnce(&mut P, &mut Timeline<'_, '_>) -> T,
    ) -> Option<T> {
        let answer = change(self.usart.chip_mut()?, &mut Timeline::new(context));
        Device::poll(self, registers, context);
        Some(answer)
    }

    /// How the firmware has set the port up.
    #[must_use]
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Cuts the line, both ways, or mends it.
    pub fn silence(&mut self, silent: bool) {
        // Whether anything hangs there makes no difference.
        let _ = self.usart.silence(silent);
    }

    /// How the line garbles what arrives, at random.
    pub fn errors_mut(&mut self) -> &mut Errors {
        self.usart.errors_mut()
    }

    /// The whole part has been reset; what hangs on the port has not.
    pub fn part_reset(&mut self, context: &mut DeviceContext<'_>) {
        let mut fresh = Usart::new();
        fresh.inherit(&mut self.usart);
        self.usart = fresh;
        self.kernel_hz = DEFAULT_KERNEL_HZ;
        (self.matched, self.raised) = (false, false);
        self.tell_settings(Settings::default());
        self.usart.chips_restarted(context);
    }

    fn tell_settings(&mut self, settings: Settings) {
        if settings != self.settings {
            self.settings = settings;
            if let Some(hooks) = self.hooks {
                (hooks.set_up)(&mut self.usart, settings);
            }
        }
    }

    /// Puts CMF beside the flags of the model, and the interrupt for it.
    fn refresh(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let control = registers.get(Register::Cr1);
        self.matched &= cr1::UE.is_set(control);
        let flags = registers.get(Register::Isr) & !isr::CMF.mask();
        registers.set(Register::Isr, if self.matched { flags | isr::CMF.mask() } else { flags });
        let raise = self.matched && cr1::CMIE.is_set(control);
        if raise {
            // Again each time: the model may have lowered its own.
            context.interrupt(INTERRUPT, Level::High);
        } else if self.raised {
            context.interrupt(INTERRUPT, Level::from(raised_by_model(registers)));
        }
        self.raised = raise;
    }
}

/// Whether the model holds the interrupt up, from its flags and enables (RM0433 rev 9 table 410, as
/// the model has it).
fn raised_by_model(registers: &RegisterFile) -> bool {
    let control = registers.get(Register::Cr1);
    let control_3 = registers.get(Register::Cr3);
    let flags = registers.get(Register::Isr);
    let errors = isr::FE.mask() | isr::NF.mask() | isr::ORE.mask();
    let sources = [
        (cr1::TXEIE.is_set(control), isr::TXE.mask()),
        (cr1::TCIE.is_set(control), isr::TC.mask()),
        (cr1::RXNEIE.is_set(control), isr::RXNE.mask() | isr::ORE.mask()),
        (cr1::IDLEIE.is_set(control), isr::IDLE.mask()),
        (cr1::PEIE.is_set(control), isr::PE.mask()),
        (cr1::TXFEIE.is_set(control), isr::TXFE.mask()),
        (cr1::RXFFIE.is_set(control), isr::RXFF.mask()),
        (cr3::CTSIE.is_set(control_3), isr::CTSIF.mask()),
        (cr3::EIE.is_set(control_3), errors),
        (cr3::TXFTIE.is_set(control_3), isr::TXFT.mask()),
        (cr3::RXFTIE.is_set(control_3), isr::RXFT.mask()),
    ];
    cr1::UE.is_set(control)
        && sources.iter().any(|(enabled, sources)| *enabled && flags & sources != 0)
}

/// The character that CMF waits for.
fn character(registers: &RegisterFile) -> u64 {
    let control_2 = registers.get(Register::Cr2);
    cr2::ADD4_7.get(control_2) << 4 | cr2::ADD0_3.get(control_2)
}

impl Device for SerialPort {
    type Register = Register;

    fn reset(&mut self) {
        self.usart.reset();
        (self.matched, self.raised) = (false, false);
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.usart.reset_line(registers, context);
        (self.matched, self.raised) = (false, false);
        self.tell_settings(Settings::of(registers, self.kernel_hz));
        self.usart.chips_restarted(context);
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let hz = self.low_power.as_mut().map_or(hz, |low_power| low_power.follow(hz));
        self.kernel_hz = hz;
        self.tell_settings(Settings::of(registers, hz));
        self.usart.on_clock(hz, registers, context);
        self.refresh(registers, context);
    }

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        if let (Register::Brr, Some(low_power)) = (register, self.low_power) {
            return Some(low_power.divider());
        }
        let unread = isr::RXNE.is_set(registers.get(Register::Isr));
        let answer = self.usart.read(register, registers, context);
        if register == Register::Rdr {
            self.matched |= unread && answer == Some(character(registers));
            self.refresh(registers, context);
        }
        answer
    }

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        self.usart.peek(register, registers, now)
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == Register::Icr && icr::CMCF.is_set(value) {
            self.matched = false;
        }
        let value = match &mut self.low_power {
            Some(low_power) if register == Register::Brr => {
                let hz = low_power.divide_by(value);
                self.kernel_hz = hz;
                registers.set(register, low_power::DIVIDER);
                self.usart.on_clock(hz, registers, context);
                low_power::DIVIDER
            }
            _ => value,
        };
        // First, so that what the port is told now is true of the words that follow.
        self.tell_settings(Settings::of(registers, self.kernel_hz));
        self.usart.write(register, value, registers, context);
        self.refresh(registers, context);
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let damaged = self.hooks.is_some_and(|hooks| (hooks.damages)(&mut self.usart));
        let usual = self.usart.errors_mut().framing;
        if damaged {
            self.usart.errors_mut().framing =
                Rate { name: DAMAGED_WORD, per_million: Rate::EVERY_WORD };
        }
        self.usart.on_event(event, registers, context);
        self.usart.errors_mut().framing = usual;
        self.refresh(registers, context);
    }

    fn poll(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.usart.poll(registers, context);
        self.refresh(registers, context);
    }
}

#[cfg(test)]
mod tests;
