//! A controller with its pins, ready to be started at any bitrate, again and again.

use embassy_stm32::Peri;
use embassy_stm32::can::config::{GlobalFilter, NonMatchingFilter, TxBufferMode};
use embassy_stm32::can::{
    self, CanConfigurator, IT0InterruptHandler, IT1InterruptHandler, OperatingMode, RxPin, TxPin,
};
use embassy_stm32::interrupt::typelevel::Binding;
use host_protocol::BusMode;

use super::can_events::{self, Instance};
use super::{Controller, InterruptHandler, Timing};

/// Every frame goes into the first FIFO, remote frames too.
const ACCEPT_ALL: GlobalFilter = GlobalFilter {
    handle_standard_frames: NonMatchingFilter::IntoRxFifo0,
    handle_extended_frames: NonMatchingFilter::IntoRxFifo0,
    reject_remote_standard_frames: false,
    reject_remote_extended_frames: false,
};

/// One CAN bus of a board, whichever controller and pins it has.
pub trait CanPort {
    /// Sets the controller up from nothing and starts it.
    ///
    /// # Safety
    ///
    /// What the start before has returned is dropped.
    unsafe fn start(&mut self, timing: &Timing, mode: BusMode) -> Controller;
}

/// A controller of the chip and its pins.
pub struct FdcanPort<T: Instance, Rx: RxPin<T>, Tx: TxPin<T>, Irqs> {
    /// The controller.
    pub controller: Peri<'static, T>,
    /// Pin to the transceiver's RXD.
    pub rx: Peri<'static, Rx>,
    /// Pin to the transceiver's TXD.
    pub tx: Peri<'static, Tx>,
    /// Proof that its interrupts are served.
    pub irqs: Irqs,
}

impl<T, Rx, Tx, Irqs> CanPort for FdcanPort<T, Rx, Tx, Irqs>
where
    T: Instance,
    Rx: RxPin<T>,
    Tx: TxPin<T>,
    Irqs: Copy
        + 'static
        + Binding<<T as can::Instance>::IT0Interrupt, IT0InterruptHandler<T>>
        + Binding<<T as can::Instance>::IT1Interrupt, IT1InterruptHandler<T>>
        + Binding<<T as can::Instance>::IT1Interrupt, InterruptHandler<T>>,
{
    unsafe fn start(&mut self, timing: &Timing, mode: BusMode) -> Controller {
        // Safety: nobody else uses them, the caller says.
        let (controller, rx, tx) = unsafe {
            (
                self.controller.clone_unchecked(),
                self.rx.clone_unchecked(),
                self.tx.clone_unchecked(),
            )
        };
        let mut setup = CanConfigurator::new(controller, rx, tx, self.irqs);
        setup.set_config(
            setup
                .config()
                .set_nominal_bit_timing(timing.nominal())
                .set_tx_buffer_mode(TxBufferMode::Priority)
                .set_global_filter(ACCEPT_ALL)
                .set_automatic_bus_off_recovery(false)
                // DAR
                .set_automatic_retransmit(mode != BusMode::OneShot),
        );
        T::events().clear();
        can_events::route_interrupts::<T>();
        let driver = setup.start(match mode {
            // MON: no acknowledgement, no error flag
            BusMode::ListenOnly => OperatingMode::BusMonitoringMode,
            BusMode::Normal | BusMode::OneShot => OperatingMode::NormalOperationMode,
        });
        can_events::drop_needless_interrupts(T::registers());
        Controller::new::<T>(driver, mode == BusMode::OneShot)
    }
}
