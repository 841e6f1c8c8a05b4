//! NUCLEO-H743ZI and NUCLEO-H743ZI2: two FDCANs, one RS485 port, host links on the ST-LINK's
//! virtual COM port and on the header.
//!
//! | Function | Pins | |
//! |---|---|---|
//! | bus 0, CAN | PD0 RX, PD1 TX | FDCAN1, to a transceiver |
//! | bus 1, CAN | PB5 RX, PB6 TX | FDCAN2, to a transceiver |
//! | bus 2, RS485 | PD6 RX, PD5 TX, PD4 DE | USART2, to a transceiver with RE# tied to ground |
//! | host link 0 | PD9 RX, PD8 TX | USART3, the virtual COM port |
//! | host link 1 | PG9 RX, PG14 TX | USART6, on the header |
//! | host link 2, USB | PA11 D−, PA12 D+ | OTG_FS, the connector CN13 |
//! | e-stop input | PE11 (D5) | normally closed to ground, internal pull-up; EXTI line 11 |
//! | enable output | PE9 (D6) | active high, needs 10 kΩ to ground |
//! | light | PB0 | LD1; its patterns are in `src/tasks/light.rs` |

use embassy_stm32::can::{IT0InterruptHandler, IT1InterruptHandler};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt::typelevel::{Binding, EXTI15_10};
use embassy_stm32::peripherals::{
    DMA1_CH0, DMA1_CH1, DMA1_CH2, DMA1_CH3, DMA1_CH4, DMA1_CH5, FDCAN1, FDCAN2, PA11, PA12, PB5,
    PB6, PD0, PD1, USART2, USART3, USART6, USB_OTG_FS,
};
use embassy_stm32::rcc::{
    self, AHBPrescaler, APBPrescaler, Hse, HseMode, Hsi48Config, Pll, PllDiv, PllMul, PllPreDiv,
    PllSource, Sysclk, VoltageScale, frequency, mux,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::{Config, Peri, bind_interrupts, dma, interrupt, pac, uid, usb};
use embassy_time::{Duration, Instant, Timer};
use embassy_usb::driver::{Bus, Direction, EndpointAddress};
use gateway::{Board, BusPort};
use host_protocol::{BootReason, BusKind, BusLimit, DEFAULT_BAUD};
use static_cell::{ConstStaticCell, StaticCell};

use super::clock;
use super::host_links::HostLinks;
use super::ports::{Ports, can_port};
use super::serial::{self, HOST_MESSAGE, HOST_RING, RS485_MESSAGE, RS485_RING};
use crate::dma_memory;
use crate::fdcan::{self, FdcanPort, Timing};
use crate::line;

// Before the RAM is used: on revisions before X reads of the AXI SRAM can be wrong unless its port
// reads one word at a time (ES0392 2.2.9; ST's SystemInit does the same). It touches no RAM itself.
core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, ={idcode}",
    "ldr r0, [r0]",
    "lsrs r0, r0, #16", // REV_ID
    "cmp r0, #{first_sound}",
    "bhs 1f",
    "ldr r0, ={axi_sram_functions}",
    "movs r1, #1", // READ_ISS_OVERRIDE
    "str r1, [r0]",
    "dsb",
    "1: bx lr",
    idcode = const DBGMCU_IDCODE,
    first_sound = const FIRST_WITH_SOUND_READS,
    axi_sram_functions = const AXI_TARG7_FN_MOD,
);
/// DBGMCU_IDC: the revision of the chip in its upper half.
const DBGMCU_IDCODE: u32 = 0x5C00_1000;
/// AXI_TARG7_FN_MOD: how the interconnect accesses the AXI SRAM.
const AXI_TARG7_FN_MOD: u32 = 0x5100_8108;
/// REV_ID from which on the reads are right; ST's SystemInit compares with the same.
const FIRST_WITH_SOUND_READS: u32 = 0x2000;
/// REV_ID of revisions X and V (stm32h7xx_hal.h); Y has 0x1003.
const REVISION_X: u16 = 0x2001;
const REVISION_V: u16 = 0x2003;

/// Bytes of the region FLIGHT.
pub const FLIGHT_BYTES: usize = 256 * 1024;
/// Its name.
pub const NAME: &str = "nucleo-h743zi";
/// CAN buses, numbered first.
pub const CAN_BUSES: usize = 2;
/// RS485 buses, numbered after them.
pub const RS485_BUSES: usize = 1;
/// Host links on UARTs, numbered first.
pub const HOST_UARTS: usize = 2;

/// The ST-LINK clocks the chip with 8 MHz (its MCO output on the HSE input).
const HSE_HZ: u32 = 8_000_000;
/// The chip's own oscillator, from which it starts. About 1 % off, 2 % over temperature: enough for
/// UARTs, not for CAN.
const HSI_HZ: u32 = 64_000_000;
const _: () = assert!(HSI_HZ / 8 == HSE_HZ);
/// PLL1: 8 MHz × 100 = 800 MHz. The processor gets half of it, 400 MHz, the most at voltage scale
/// 1.
const PLL1_VCO_HZ: u32 = HSE_HZ * 100;
/// PLL1 Q: 800 MHz / 10 = 80 MHz. Must stay below the 100 MHz of APB1, which clocks the FDCAN
/// registers.
const CAN_KERNEL_HZ: u32 = PLL1_VCO_HZ / 10;

/// 80 MHz, and 20 time quanta per bit for every bitrate: sample point (1 + 16) / 20 = 85 %, so that
/// prescaler = 80 MHz / 20 / bitrate = 4 MHz / bitrate.
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
    Timing::checked(CAN_KERNEL_HZ, bitrate, prescaler, 16, 3)
}

/// From the 100 MHz of APB1: 100 MHz / 868 = 115207, / 200, / 100, / 67 = 1.493 M (−0.5 %), / 50.
const RS485_BITRATES: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];
/// The UARTs of the host links have the clock of APB1 and APB2, 100 MHz.
const _: () = assert!(serial::gives_host_bauds(100_000_000));

const CAN_BUS: BusPort =
    BusPort { kind: BusKind::Can, bitrates: &fdcan::bitrates(&CAN_TIMING_TABLE) };
/// A CAN bus that this chip cannot serve.
const OFF_CAN_BUS: BusPort = BusPort { kind: BusKind::Can, bitrates: &[] };
const RS485_BUS: BusPort = BusPort { kind: BusKind::Rs485, bitrates: &RS485_BITRATES };

bind_interrupts!(struct Irqs {
    FDCAN1_IT1 => fdcan::InterruptHandler<FDCAN1>, IT1InterruptHandler<FDCAN1>;
    FDCAN2_IT1 => fdcan::InterruptHandler<FDCAN2>, IT1InterruptHandler<FDCAN2>;
    USART2 => line::InterruptHandler<USART2>;
    USART3 => line::InterruptHandler<USART3>;
    USART6 => line::InterruptHandler<USART6>;
    DMA1_STREAM0 => line::RingInterruptHandler<USART3>, dma::InterruptHandler<DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_STREAM2 => line::RingInterruptHandler<USART6>, dma::InterruptHandler<DMA1_CH2>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
    DMA1_STREAM4 => line::RingInterruptHandler<USART2>, dma::InterruptHandler<DMA1_CH4>;
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
    OTG_FS => usb::InterruptHandler<USB_OTG_FS>;
    EXTI15_10 => exti::InterruptHandler<EXTI15_10>;
});

// Safety: nothing raises the first line of an FDCAN, as `fdcan` routes every source to the second
// before it starts the controller. So the driver's handler for it stays out of the image, 4 KiB;
// were it raised, the board would restart.
unsafe impl Binding<interrupt::typelevel::FDCAN1_IT0, IT0InterruptHandler<FDCAN1>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::FDCAN2_IT0, IT0InterruptHandler<FDCAN2>> for Irqs {}

// Safety: the driver's half of a UART that waits for this handler, its receiver, is never used.
unsafe impl Binding<interrupt::typelevel::USART2, usart::InterruptHandler<USART2>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::USART3, usart::InterruptHandler<USART3>> for Irqs {}
unsafe impl Binding<interrupt::typelevel::USART6, usart::InterruptHandler<USART6>> for Irqs {}

// Where the driver lays out the message RAM of each.
fdcan::instance!(FDCAN1, FDCANRAM + 0x000, all_to_second_line);
fdcan::instance!(FDCAN2, FDCANRAM + 0xC00, all_to_second_line);
line::instance!(USART2, DMA1_CH4, Irqs, pac::DMA1.st(4), pac::DMA1.isr(1), 0);
line::instance!(USART3, DMA1_CH0, Irqs, pac::DMA1.st(0), pac::DMA1.isr(0), 0);
line::instance!(USART6, DMA1_CH2, Irqs, pac::DMA1.st(2), pac::DMA1.isr(0), 2);

/// One bit for each source.
fn all_to_second_line(w: &mut pac::can::regs::Ils) {
    w.set_rfnl(fdcan::FIFO, true);
    w.set_rfnl(fdcan::OTHER_FIFO, true);
    w.set_rfll(fdcan::FIFO, true);
    w.set_tcl(true);
    w.set_tefnl(true);
    w.set_tcfl(true);
    w.set_ewl(true);
    w.set_epl(true);
    w.set_bol(true);
}

/// The USB controller.
pub type UsbDriver = usb::Driver<'static, USB_OTG_FS>;

/// USB, and its pins.
pub struct UsbPort {
    controller: Peri<'static, USB_OTG_FS>,
    d_plus: Peri<'static, PA12>,
    d_minus: Peri<'static, PA11>,
}

/// How long the USB controller may take to be ready: 25 ms to take the role of a device (RM0433,
/// OTG chapter, GUSBCFG.FDMOD).
const USB_DEADLINE: Duration = Duration::from_millis(40);
/// How often that is looked at.
const USB_POLL: Duration = Duration::from_millis(1);
/// Bytes of packets from the host that wait for the firmware: one of 64 for each of the two
/// endpoints.
const USB_RECEIVE_BUFFER: usize = 128;

impl UsbPort {
    /// The driver, and the serial number, the chip's unique id in hex; `None` if the controller is
    /// not ready in time. The driver itself would wait for ever, and no other task would run.
    pub async fn start(self) -> Option<(UsbDriver, &'static str)> {
        static BUFFER: ConstStaticCell<[u8; USB_RECEIVE_BUFFER]> =
            ConstStaticCell::new([0; USB_RECEIVE_BUFFER]);
        pac::PWR.cr3().modify(|w| w.set_usb33den(true));
        is_soon(|| pac::PWR.cr3().read().usb33rdy()).await?;
        // The clock of an external transceiver, which is not there, must not be waited for. It is
        // on in sleep after a reset.
        pac::RCC.ahb1enr().modify(|w| w.set_usb_otg_fs_ulpien(false));
        pac::RCC.ahb1lpenr().modify(|w| w.set_usb_otg_fs_ulpilpen(false));
        rcc::enable_and_reset::<USB_OTG_FS>();
        let registers = pac::USB_OTG_FS;
        // Without its transceiver the controller does not take the role of a device.
        registers.gusbcfg().modify(|w| {
            w.set_physel(true);
            w.set_fdmod(true);
        });
        registers.gintsts().write_value(pac::otg::regs::Gintsts(u32::MAX));
        is_soon(|| {
            let flags = registers.gintsts().read();
            // Its transceiver is still off: an event that does not go away would keep the driver
            // busy for ever.
            let events = flags.usbrst() || flags.enumdne() || flags.usbsusp() || flags.wkupint();
            registers.grstctl().read().ahbidl() && !flags.cmod() && !events
        })
        .await?;
        let mut config = usb::Config::default();
        // A solder bridge decides whether PA9 sees the voltage of the cable; without it an
        // unplugged cable is a suspended bus.
        config.vbus_detection = false;
        let driver = UsbDriver::new_fs(
            self.controller,
            Irqs,
            self.d_plus,
            self.d_minus,
            BUFFER.take(),
            config,
        );
        Some((driver, uid::uid_hex()))
    }
}

/// Has an endpoint begin with DATA0 (RM0433, OTG chapter, SD0PID).
pub fn begin_with_data0(_: &mut impl Bus, endpoint: EndpointAddress) {
    let (registers, number) = (pac::USB_OTG_FS, endpoint.index());
    match endpoint.direction() {
        Direction::Out => registers.doepctl(number).modify(|w| w.set_sd0pid_sevnfrm(true)),
        Direction::In => registers.diepctl(number).modify(|w| w.set_sd0pid_sevnfrm(true)),
    }
}

/// Ends the halt of an endpoint, which begins with DATA0. What it has under way goes on: so does
/// ST's HAL (`USB_EPClearStall`).
pub fn end_halt(bus: &mut impl Bus, endpoint: EndpointAddress) {
    bus.endpoint_set_stalled(endpoint, false);
    begin_with_data0(bus, endpoint);
}

/// Waits for what the USB controller should do soon.
async fn is_soon(ready: impl Fn() -> bool) -> Option<()> {
    let deadline = Instant::now() + USB_DEADLINE;
    while !ready() {
        if Instant::now() > deadline {
            return None;
        }
        Timer::after(USB_POLL).await;
    }
    Some(())
}

/// Where the ROM bootloader's vector table lies (AN2606).
const ROM_BOOTLOADER: usize = 0x1FF0_9800;

/// Leaves this firmware for good. To be called right after a reset.
pub fn start_rom_bootloader() -> ! {
    // Safety: a stack pointer and an entry point lie there, and nothing of this firmware is in use.
    unsafe { cortex_m::asm::bootload(ROM_BOOTLOADER as *const u32) }
}

/// The independent watchdog.
pub const WATCHDOG: pac::iwdg::Iwdg = pac::IWDG1;

/// The enable output: its port, and its number there.
pub const ENABLE_OUTPUT: (pac::gpio::Gpio, usize) = (pac::GPIOE, 9);

/// Instructions only: with a data cache every DMA buffer would have to be cleaned and invalidated.
pub fn cache_instructions() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SCB.enable_icache();
    }
}

/// Sets clocks, pins and UARTs up. `crash_report` is what the run before has left.
pub fn start(boot: BootReason, crash_report: &'static str) -> (Board, Ports) {
    let mut config = Config::default();
    let has_clock = st_link_clocks_us(boot);
    set_clocks(&mut config.rcc, has_clock);
    let p = clock::init(config);
    if has_clock {
        // Should it stop, the chip goes on with its oscillator and tells `has_lost_clock`.
        pac::RCC.cr().modify(|w| w.set_hsecsson(true));
    }
    trim_by_usb_2();
    // An output until the next reset: dropped, it would become an input.
    core::mem::forget(Output::new(p.PE9, Level::Low, Speed::Low));
    defmt::assert_eq!(frequency::<FDCAN1>(), Hertz(CAN_KERNEL_HZ));

    let uart = serial::config(DEFAULT_BAUD);
    let host_0 =
        defmt::unwrap!(Uart::new(p.USART3, p.PD9, p.PD8, p.DMA1_CH1, p.DMA1_CH0, Irqs, uart));
    let host_1 =
        defmt::unwrap!(Uart::new(p.USART6, p.PG9, p.PG14, p.DMA1_CH3, p.DMA1_CH2, Irqs, uart));
    let [first_bitrate, ..] = RS485_BITRATES;
    let uart = serial::config(first_bitrate);
    let rs485 = defmt::unwrap!(Uart::new_with_de(
        p.USART2, p.PD6, p.PD5, p.PD4, p.DMA1_CH5, p.DMA1_CH4, Irqs, uart
    ));
    let ports = Ports {
        can: [can_port!(p, FDCAN1, rx PD0, tx PD1), can_port!(p, FDCAN2, rx PB5, tx PB6)],
        rs485: serial::rs485_line::<USART2>(
            rs485,
            dma_memory::buffer!(RS485_RING),
            dma_memory::buffer!(RS485_MESSAGE),
            first_bitrate,
        ),
        hosts: HostLinks {
            uarts: [
                serial::host_line::<USART3>(
                    host_0,
                    dma_memory::buffer!(HOST_RING),
                    dma_memory::buffer!(HOST_MESSAGE),
                ),
                serial::host_line::<USART6>(
                    host_1,
                    dma_memory::buffer!(HOST_RING),
                    dma_memory::buffer!(HOST_MESSAGE),
                ),
            ],
            usb: UsbPort { controller: p.USB_OTG_FS, d_plus: p.PA12, d_minus: p.PA11 },
        },
        e_stop: ExtiInput::new(p.PE11, p.EXTI11, Pull::Up, Irqs),
        light: Output::new(p.PB0, Level::Low, Speed::Low),
    };
    (super::description(boot, crash_report, buses(has_clock)), ports)
}

/// Whether the ST-LINK gives its clock.
fn st_link_clocks_us(boot: BootReason) -> bool {
    pac::RCC.cr().modify(|w| w.set_hsebyp(true));
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    clock::starts(boot, HSI_HZ, || pac::RCC.cr().read().hserdy())
}

/// Whether the ST-LINK's clock has stopped since the start: the chip then raises its non-maskable
/// interrupt.
pub fn has_lost_clock() -> bool {
    pac::RCC.cifr().read().hsecssf()
}

/// The same frequencies from either clock: without the ST-LINK's PLL1 is fed by the chip's
/// oscillator, 64 MHz / 8.
fn set_clocks(rcc: &mut embassy_stm32::rcc::Config, has_clock: bool) {
    let (source, prediv) = if has_clock {
        rcc.hse = Some(Hse { freq: Hertz(HSE_HZ), mode: HseMode::Bypass });
        (PllSource::HSE, PllPreDiv::DIV1)
    } else {
        (PllSource::HSI, PllPreDiv::DIV8)
    };
    rcc.pll1 = Some(Pll {
        source,
        prediv,
        mul: PllMul::MUL100,
        fracn: None,
        divp: Some(PllDiv::DIV2),  // 800 MHz / 2 = 400 MHz: processor
        divq: Some(PllDiv::DIV10), // 800 MHz / 10 = 80 MHz: FDCAN kernel
        divr: None,
    });
    rcc.hsi48 = Some(Hsi48Config { sync_from_usb: true }); // 48 MHz, trimmed by the host's frames
    rcc.mux.usbsel = mux::Usbsel::HSI48;
    rcc.voltage_scale = VoltageScale::Scale1;
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2; // 200 MHz
    rcc.apb1_pre = APBPrescaler::DIV2; // 100 MHz: USART2, USART3, FDCAN registers
    rcc.apb2_pre = APBPrescaler::DIV2; // 100 MHz: USART6
    rcc.apb3_pre = APBPrescaler::DIV2; // 100 MHz
    rcc.apb4_pre = APBPrescaler::DIV2; // 100 MHz
    rcc.mux.fdcansel = mux::Fdcansel::PLL1_Q;
}

/// CRS_CFGR.SYNCSRC: the frames of the host on USB2, which has PA11 and PA12
/// (stm32h7xx_hal_rcc_ex.h). The driver chooses USB1.
const SYNC_BY_USB_2: u8 = 3;

/// Has the 48 MHz of USB trimmed by the frames of its host. The source can be changed only while
/// the trimming is off.
fn trim_by_usb_2() {
    pac::CRS.cr().modify(|w| w.set_cen(false));
    pac::CRS.cfgr().modify(|w| w.set_syncsrc(pac::crs::vals::Syncsrc::from_bits(SYNC_BY_USB_2)));
    pac::CRS.cr().modify(|w| w.set_cen(true));
}

/// The buses that this chip can run, and why others cannot.
fn buses(has_clock: bool) -> (&'static [BusPort], Option<BusLimit>) {
    if !has_clock {
        defmt::error!(
            "CAN is off: the ST-LINK gives no clock, and the chip's own is not exact enough"
        );
        (&[OFF_CAN_BUS, OFF_CAN_BUS, RS485_BUS], Some(BusLimit::NoClock))
    } else if reads_frames_right() {
        (&[CAN_BUS, CAN_BUS, RS485_BUS], None)
    } else {
        let revision = pac::DBGMCU.idc().read().rev_id();
        defmt::error!(
            "bus 1 is off: a chip of revision {=u16:#06x} can read wrong frames with two",
            revision
        );
        (&[CAN_BUS, OFF_CAN_BUS, RS485_BUS], Some(BusLimit::ChipRevision))
    }
}

/// Whether both CAN controllers may run. On revisions other than X and V the processor can read
/// wrong words from the message RAM while both do, and nothing shows it (ES0392, "Wrong data may be
/// read from Message RAM by the CPU when using two FDCANs"; no workaround).
fn reads_frames_right() -> bool {
    matches!(pac::DBGMCU.idc().read().rev_id(), REVISION_X | REVISION_V)
}

/// Why the chip was reset. Several flags may be set: the rarer cause counts.
pub fn boot_reason() -> BootReason {
    let flags = pac::RCC.rsr().read();
    if flags.porrstf() {
        BootReason::PowerOn
    } else if flags.borrstf() {
        BootReason::Brownout
    } else if flags.iwdg1rstf() || flags.wwdg1rstf() {
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
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
}
