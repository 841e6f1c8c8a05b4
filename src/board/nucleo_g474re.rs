//! NUCLEO-G474RE: three FDCANs, one RS485 port, host links on the ST-LINK's virtual COM port, on
//! the header and on USB.
//!
//! | Function | Pins | |
//! |---|---|---|
//! | bus 0, CAN | PB8 RX, PB9 TX (D15, D14) | FDCAN1, to a transceiver; see below |
//! | bus 1, CAN | PB12 RX, PB13 TX (CN10 16, 30) | FDCAN2, to a transceiver |
//! | bus 2, CAN | PA8 RX (D7), PA15 TX (CN7 17) | FDCAN3, to a transceiver |
//! | bus 3, RS485 | PB11 RX, PB10 TX, PB14 DE (CN10 18, D6, CN10 28) | USART3, to a transceiver with RE# tied to ground |
//! | host link 0 | PA3 RX, PA2 TX | LPUART1, the virtual COM port |
//! | host link 1 | PC5 RX, PC4 TX (D0, D1) | USART1, on the header |
//! | host link 2, USB | PA11 D−, PA12 D+ (CN10 14, 12) | the board has no connector for it |
//! | e-stop input | PA4 (A2) | normally closed to ground, internal pull-up; EXTI line 4 |
//! | enable output | PB0 (A3) | active high, needs 10 kΩ to ground |
//! | light | PA5 | LD2; its patterns are in `src/tasks/light.rs` |
//!
//! PB8 is also BOOT0, and FDCAN1 has no other input on this package that leaves USB free. A
//! transceiver holds it high, so that every reset, the watchdog's too, would start the ROM
//! bootloader instead of this firmware. The option nSWBOOT0 = 0 (with nBOOT0 = 1) makes the chip
//! ignore the pin; without it bus 0 offers no bitrate. Once, with bus 0 unplugged:
//! `STM32_Programmer_CLI -c port=SWD -ob nSWBOOT0=0 nBOOT0=1`.
//!
//! Not used on purpose: PA13 and PA14 are SWD, PB3 is SWO, PC13 the button; PB4 and PB6 have the
//! pull-downs of USB-C's dead-battery mode while PA9 and PA10 are high at reset; A4 and A5 hang on
//! solder bridges. The virtual COM port and D0, D1 are as delivered: with the solder bridges that
//! lead PA2 and PA3 to D1 and D0 changed, host link 0 is there instead. Header pins and crystal are
//! those of Zephyr's files for the board (boards/st/nucleo_g474re).

use embassy_stm32::can::{IT0InterruptHandler, IT1InterruptHandler};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt::typelevel::{Binding, EXTI4};
use embassy_stm32::peripherals::{
    DMA1_CH1, DMA1_CH2, DMA1_CH3, DMA1_CH4, DMA1_CH5, DMA1_CH6, FDCAN1, FDCAN2, FDCAN3, LPUART1,
    PA8, PA11, PA12, PA15, PB8, PB9, PB12, PB13, USART1, USART3, USB,
};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Hsi48Config, Pll, PllMul, PllPreDiv, PllQDiv,
    PllRDiv, PllSource, Sysclk, frequency, mux,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::{Config, Peri, bind_interrupts, dma, interrupt, pac, uid, usb};
use embassy_usb::driver::{Bus, EndpointAddress};
use gateway::{Board, BusPort};
use host_protocol::{BootReason, BusKind, BusLimit, DEFAULT_BAUD};
use static_cell::StaticCell;

use super::clock;
use super::host_links::HostLinks;
use super::ports::{Ports, can_port};
use super::serial::{self, HOST_MESSAGE, HOST_RING, RS485_MESSAGE, RS485_RING};
use crate::dma_memory;
use crate::fdcan::{self, FdcanPort, Timing};
use crate::line;

// First of all: after a start by the ROM bootloader (DFU) that ROM may still lie at address 0. Only
// MEM_MODE is cleared; FB_MODE, the order of the flash banks, stays. It touches no RAM.
core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, ={apb2enr}",
    "ldr r1, [r0]",
    "orr r1, r1, #1", // SYSCFGEN
    "str r1, [r0]",
    "ldr r1, [r0]", // two cycles, as the clock needs
    "ldr r0, ={memrmp}",
    "ldr r1, [r0]",
    "bic r1, r1, #7", // MEM_MODE: main flash
    "str r1, [r0]",
    "dsb",
    "bx lr",
    apb2enr = const RCC_APB2ENR,
    memrmp = const SYSCFG_MEMRMP,
);
/// The clock of SYSCFG, and its memory map (RM0440, RCC and SYSCFG chapters).
const RCC_APB2ENR: u32 = 0x4002_1060;
const SYSCFG_MEMRMP: u32 = 0x4001_0000;

/// The main regulator's voltage suffices for 150 MHz only (RM0440, PWR_CR5).
const PWR_CR5_R1MODE: u32 = 1 << 8;
/// At least 1 us at half the frequency.
const BOOST_CYCLES: u32 = 100;

/// Bytes of the region FLIGHT.
pub const FLIGHT_BYTES: usize = 12 * 1024;
/// Its name.
pub const NAME: &str = "nucleo-g474re";
/// CAN buses, numbered first.
pub const CAN_BUSES: usize = 3;
/// RS485 buses, numbered after them.
pub const RS485_BUSES: usize = 1;
/// Host links on UARTs, numbered first.
pub const HOST_UARTS: usize = 2;

/// The crystal X3.
const HSE_HZ: u32 = 24_000_000;
/// The chip's own oscillator, from which it starts. About 1 % off, 2 % over temperature: enough for
/// UARTs, not for CAN.
const HSI_HZ: u32 = 16_000_000;
const _: () = assert!(HSI_HZ / 4 * 84 == PLL_VCO_HZ);
/// 24 MHz / 2 × 28 = 336 MHz. The processor gets half of it, 168 MHz: 170 MHz is the most, but
/// makes no 800 kbit/s.
const PLL_VCO_HZ: u32 = HSE_HZ / 2 * 28;
/// PLL Q: 336 MHz / 4 = 84 MHz, one clock for all three controllers. Below the 168 MHz of APB1,
/// which clocks their registers.
const CAN_KERNEL_HZ: u32 = PLL_VCO_HZ / 4;

/// 84 MHz, and 21 time quanta per bit for every bitrate: sample point (1 + 17) / 21 = 85.7 %, so
/// that prescaler = 84 MHz / 21 / bitrate = 4 MHz / bitrate.
pub static CAN_TIMINGS: [Timing; 8] = CAN_TIMING_TABLE;
const CAN_TIMING_TABLE: [Timing; 8] = [
    can_timing(1_000_000, 4), // 4 MHz / 4
    can_timing(800_000, 5),   // 4 MHz / 5
    can_timing(500_000, 8),   // 4 MHz / 8
    can_timing(250_000, 16),  // 4 MHz / 16
    can_timing(210_526, 19),  // 4 MHz / 19 = 210526.3
    can_timing(125_000, 32),  // 4 MHz / 32
    can_timing(100_000, 40),  // 4 MHz / 40
    can_timing(50_000, 80),   // 4 MHz / 80
];

const fn can_timing(bitrate: u32, prescaler: u16) -> Timing {
    Timing::checked(CAN_KERNEL_HZ, bitrate, prescaler, 17, 3)
}

/// From the 168 MHz of APB1: 168 MHz / 1458 = 115226, / 336, / 168, / 112, / 84.
const RS485_BITRATES: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];
/// The UARTs of the host links have the clock of APB1 and APB2, 168 MHz.
const _: () = assert!(serial::gives_host_bauds(168_000_000));

const CAN_BUS: BusPort =
    BusPort { kind: BusKind::Can, bitrates: &fdcan::bitrates(&CAN_TIMING_TABLE) };
/// A CAN bus that cannot run now: bus 0 while its input also decides where the chip starts from,
/// all of them without the crystal.
const OFF_CAN_BUS: BusPort = BusPort { kind: BusKind::Can, bitrates: &[] };
const RS485_BUS: BusPort = BusPort { kind: BusKind::Rs485, bitrates: &RS485_BITRATES };

bind_interrupts!(struct Irqs {
    FDCAN1_IT1 => fdcan::InterruptHandler<FDCAN1>, IT1InterruptHandler<FDCAN1>;
    FDCAN2_IT1 => fdcan::InterruptHandler<FDCAN2>, IT1InterruptHandler<FDCAN2>;
    FDCAN3_IT1 => fdcan::InterruptHandler<FDCAN3>, IT1InterruptHandler<FDCAN3>;
    USART3 => line::InterruptHandler<USART3>;
    LPUART1 => line::InterruptHandler<LPUART1>;
    USART1 => line::InterruptHandler<USART1>;
    DMA1_CHANNEL1 => line::RingInterruptHandler<LPUART1>, dma::InterruptHandler<DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<DMA1_CH2>;
    DMA1_CHANNEL3 => line::RingInterruptHandler<USART1>, dma::InterruptHandler<DMA1_CH3>;
    DMA1_CHANNEL4 => dma::InterruptHandler<DMA1_CH4>;
    DMA1_CHANNEL5 => line::RingInterruptHandler<USART3>, dma::InterruptHandler<DMA1_CH5>;
    DMA1_CHANNEL6 => dma::InterruptHandler<DMA1_CH6>;
    USB_LP => usb::InterruptHandler<USB>;
    EXTI4 => exti::InterruptHandler<EXTI4>;
});

// Safety: nothing raises the first line of an FDCAN, as `fdcan` routes every source to the second
// before it starts the controller. So the driver's handler for it stays out of the image; were it
// raised, the board would restart.
unsafe impl Binding<interrupt::typelevel::FDCAN1_IT0, IT0InterruptHandler<FDCAN1>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::FDCAN2_IT0, IT0InterruptHandler<FDCAN2>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::FDCAN3_IT0, IT0InterruptHandler<FDCAN3>> for Irqs {}

// Safety: the driver's half of a UART that waits for this handler, its receiver, is never used.
unsafe impl Binding<interrupt::typelevel::USART3, usart::InterruptHandler<USART3>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::LPUART1, usart::InterruptHandler<LPUART1>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::USART1, usart::InterruptHandler<USART1>> for Irqs {}

// Each has a message RAM of its own.
fdcan::instance!(FDCAN1, FDCANRAM1 + 0, all_to_second_line);
fdcan::instance!(FDCAN2, FDCANRAM2 + 0, all_to_second_line);
fdcan::instance!(FDCAN3, FDCANRAM3 + 0, all_to_second_line);
line::instance!(USART3, DMA1_CH5, Irqs, pac::DMA1.ch(4), pac::DMA1.isr(), 4);
line::instance!(LPUART1, DMA1_CH1, Irqs, pac::DMA1.ch(0), pac::DMA1.isr(), 0);
line::instance!(USART1, DMA1_CH3, Irqs, pac::DMA1.ch(2), pac::DMA1.isr(), 2);

/// One bit for each group of sources.
fn all_to_second_line(w: &mut pac::can::regs::Ils) {
    w.set_rxfifo(fdcan::FIFO, true);
    w.set_rxfifo(fdcan::OTHER_FIFO, true);
    w.set_smsg(true); // transmitted, cancelled
    w.set_tferr(true); // event FIFO
    w.set_misc(true);
    w.set_berr(true); // passive
    w.set_perr(true); // warning, bus-off
}

/// The USB controller.
pub type UsbDriver = usb::Driver<'static, USB>;

/// USB, and its pins.
pub struct UsbPort {
    controller: Peri<'static, USB>,
    d_plus: Peri<'static, PA12>,
    d_minus: Peri<'static, PA11>,
}

impl UsbPort {
    /// The driver, and the serial number, the chip's unique id in hex. Here nothing has to be
    /// waited for.
    pub async fn start(self) -> Option<(UsbDriver, &'static str)> {
        Some((UsbDriver::new(self.controller, Irqs, self.d_plus, self.d_minus), uid::uid_hex()))
    }
}

/// What leaves STAT_RX and STAT_TX as they are.
const KEPT: pac::usb::vals::Stat = pac::usb::vals::Stat::from_bits(0);

/// Has an endpoint begin with DATA0 when it is enabled next. Until then it is disabled: nothing
/// else flips its toggle meanwhile.
pub fn begin_with_data0(bus: &mut impl Bus, endpoint: EndpointAddress) {
    bus.endpoint_set_enabled(endpoint, false);
    let register = pac::USB.epr(endpoint.index());
    register.modify(|w| {
        // A 1 flips a toggle or a bit of a status, a 0 clears CTR (RM0440, USB_EPnR): only this
        // toggle flips.
        let (receives, transmits) = (w.dtog_rx(), w.dtog_tx());
        w.set_dtog_rx(receives && endpoint.is_out());
        w.set_dtog_tx(transmits && endpoint.is_in());
        w.set_stat_rx(KEPT);
        w.set_stat_tx(KEPT);
        w.set_ctr_rx(true);
        w.set_ctr_tx(true);
    });
}

/// Ends the halt of an endpoint, which begins with DATA0.
pub fn end_halt(bus: &mut impl Bus, endpoint: EndpointAddress) {
    begin_with_data0(bus, endpoint);
    bus.endpoint_set_enabled(endpoint, true);
}

/// Where the ROM bootloader's vector table lies (AN2606).
const ROM_BOOTLOADER: usize = 0x1FFF_0000;
/// SYSCFG_MEMRMP: that ROM also at address 0, as after a start by the BOOT0 pin (RM0440, SYSCFG
/// chapter).
const MEMORY_MODE_ROM: u8 = 1;

/// Leaves this firmware for good. To be called right after a reset.
pub fn start_rom_bootloader() -> ! {
    pac::RCC.apb2enr().modify(|w| w.set_syscfgen(true));
    pac::SYSCFG.memrmp().modify(|w| w.set_mem_mode(MEMORY_MODE_ROM));
    // Safety: a stack pointer and an entry point lie there, and nothing of this firmware is in use.
    unsafe { cortex_m::asm::bootload(ROM_BOOTLOADER as *const u32) }
}

/// The independent watchdog.
pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG;

/// The enable output: its port, and its number there.
pub const ENABLE_OUTPUT: (pac::gpio::Gpio, usize) = (pac::GPIOB, 0);

/// They are from reset on.
pub fn cache_instructions() {}

/// Sets clocks, pins and UARTs up. `crash_report` is what the run before has left.
pub fn start(boot: BootReason, crash_report: &'static str) -> (Board, Ports) {
    let mut config = Config::default();
    let has_clock = crystal_swings(boot);
    set_clocks(&mut config.rcc, has_clock);
    let p = clock::init(config);
    if has_clock {
        // Should it stop, the chip goes on with its oscillator and tells `has_lost_clock`.
        pac::RCC.cr().modify(|w| w.set_csson(true));
    }
    boost();
    // An output until the next reset: dropped, it would become an input.
    core::mem::forget(Output::new(p.PB0, Level::Low, Speed::Low));
    defmt::assert_eq!(frequency::<FDCAN1>(), Hertz(CAN_KERNEL_HZ));

    let uart = serial::config(DEFAULT_BAUD);
    let host_0 =
        defmt::unwrap!(Uart::new(p.LPUART1, p.PA3, p.PA2, p.DMA1_CH2, p.DMA1_CH1, Irqs, uart));
    let host_1 =
        defmt::unwrap!(Uart::new(p.USART1, p.PC5, p.PC4, p.DMA1_CH4, p.DMA1_CH3, Irqs, uart));
    let [first_bitrate, ..] = RS485_BITRATES;
    let uart = serial::config(first_bitrate);
    let rs485 = defmt::unwrap!(Uart::new_with_de(
        p.USART3, p.PB11, p.PB10, p.PB14, p.DMA1_CH6, p.DMA1_CH5, Irqs, uart
    ));
    let ports = Ports {
        can: [
            can_port!(p, FDCAN1, rx PB8, tx PB9),
            can_port!(p, FDCAN2, rx PB12, tx PB13),
            can_port!(p, FDCAN3, rx PA8, tx PA15),
        ],
        rs485: serial::rs485_line::<USART3>(
            rs485,
            dma_memory::buffer!(RS485_RING),
            dma_memory::buffer!(RS485_MESSAGE),
            first_bitrate,
        ),
        hosts: HostLinks {
            uarts: [
                serial::host_line::<LPUART1>(
                    host_0,
                    dma_memory::buffer!(HOST_RING),
                    dma_memory::buffer!(HOST_MESSAGE),
                ),
                serial::host_line::<USART1>(
                    host_1,
                    dma_memory::buffer!(HOST_RING),
                    dma_memory::buffer!(HOST_MESSAGE),
                ),
            ],
            usb: UsbPort { controller: p.USB, d_plus: p.PA12, d_minus: p.PA11 },
        },
        e_stop: ExtiInput::new(p.PA4, p.EXTI4, Pull::Up, Irqs),
        light: Output::new(p.PA5, Level::Low, Speed::Low),
    };
    (super::description(boot, crash_report, buses(has_clock)), ports)
}

/// Whether the crystal swings.
fn crystal_swings(boot: BootReason) -> bool {
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    clock::starts(boot, HSI_HZ, || pac::RCC.cr().read().hserdy())
}

/// Whether the crystal has stopped since the start: the chip then raises its non-maskable
/// interrupt.
pub fn has_lost_clock() -> bool {
    pac::RCC.cifr().read().cssf()
}

/// The same frequencies from either clock: without the crystal the PLL is fed by the chip's
/// oscillator, 16 MHz / 4 × 84.
fn set_clocks(rcc: &mut embassy_stm32::rcc::Config, has_clock: bool) {
    let (source, prediv, mul) = if has_clock {
        rcc.hse = Some(Hse { freq: Hertz(HSE_HZ), mode: HseMode::Oscillator });
        (PllSource::HSE, PllPreDiv::DIV2, PllMul::MUL28)
    } else {
        (PllSource::HSI, PllPreDiv::DIV4, PllMul::MUL84)
    };
    rcc.pll = Some(Pll {
        source,
        prediv,
        mul,
        divp: None,
        divq: Some(PllQDiv::DIV4), // 336 MHz / 4 = 84 MHz: FDCAN kernel
        divr: Some(PllRDiv::DIV2), // 336 MHz / 2 = 168 MHz: processor
    });
    rcc.hsi48 = Some(Hsi48Config { sync_from_usb: true }); // 48 MHz, trimmed by the host's frames
    rcc.mux.clk48sel = mux::Clk48sel::HSI48; // USB
    rcc.boost = true; // above 150 MHz
    rcc.sys = Sysclk::PLL1_R;
    rcc.ahb_pre = AHBPrescaler::DIV1; // 168 MHz
    rcc.apb1_pre = APBPrescaler::DIV1; // 168 MHz: LPUART1, USART3, FDCAN registers
    rcc.apb2_pre = APBPrescaler::DIV1; // 168 MHz: USART1
    rcc.mux.fdcansel = mux::Fdcansel::PLL1_Q;
}

/// Raises the core's voltage to what more than 150 MHz need, with half the frequency meanwhile
/// (RM0440, PWR chapter). `Config::rcc.boost` does not: embassy's table of registers has R1MODE at
/// bit 0. Nor can it be done before, as `init` resets PWR: for some microseconds the core has run
/// at 168 MHz without.
fn boost() {
    pac::RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV2));
    pac::PWR.cr5().modify(|w| w.0 &= !PWR_CR5_R1MODE);
    cortex_m::asm::delay(BOOST_CYCLES);
    pac::RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV1));
}

/// The buses that this chip can run, and why others cannot.
fn buses(has_clock: bool) -> (&'static [BusPort], Option<BusLimit>) {
    if !has_clock {
        defmt::error!(
            "CAN is off: the crystal does not swing, and the chip's own clock is not exact enough"
        );
        (&[OFF_CAN_BUS, OFF_CAN_BUS, OFF_CAN_BUS, RS485_BUS], Some(BusLimit::NoClock))
    } else if starts_from_flash_always() {
        (&[CAN_BUS, CAN_BUS, CAN_BUS, RS485_BUS], None)
    } else {
        defmt::error!(
            "bus 0 is off: its input is BOOT0 too; set the options nSWBOOT0 = 0 and nBOOT0 = 1"
        );
        (&[OFF_CAN_BUS, CAN_BUS, CAN_BUS, RS485_BUS], Some(BusLimit::BootPin))
    }
}

/// Whether the option bytes let no pin keep the chip from this firmware (RM0440, boot
/// configuration).
fn starts_from_flash_always() -> bool {
    let options = pac::FLASH.optr().read();
    let locked = pac::FLASH.sec1r().read().boot_lock();
    locked || (!options.n_swboot0() && options.n_boot0())
}

/// Why the chip was reset. Several flags may be set: the rarer cause counts. This chip
/// has one flag for power-on and brown-out.
pub fn boot_reason() -> BootReason {
    let flags = pac::RCC.csr().read();
    if flags.borrstf() {
        BootReason::PowerOn
    } else if flags.iwdgrstf() || flags.wwdgrstf() {
        BootReason::Watchdog
    } else if flags.sftrstf() {
        BootReason::Software
    } else if flags.pinrstf() {
        BootReason::Pin
    } else {
        BootReason::Unknown
    }
}

/// Makes room for the next reason.
pub fn forget_boot_reason() {
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
}
