//! The core itself: its registers as the processor sees them.

use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::endpoint::Endpoint;
use super::fifo::{Receive, Transmit, endpoint_and_status};
use super::registers::{
    DAD, DAD_SHIFT, ENDPOINTS, FDMOD, FIFO, FIFO_BYTES, GINT, PCGCCTL, PHYSEL, PWRDWN, VBDEN, dctl,
    dsts, gint,
};
use super::registers::{device, epctl, epint, global, gotgctl, grstctl, pktsts};

/// How long the core takes to take the role of a device (RM0433, GUSBCFG.FDMOD).
pub const ROLE_NANOS: u64 = 25_000_000;
/// What CID reads.
const CORE: u32 = 0x2300;
/// GUSBCFG, GRXFSIZ and DIEPTXF0 out of reset.
const GUSBCFG_RESET: u32 = 0x0000_0A00;
const FIFO_RESET: u32 = 0x0000_0200;
const DCFG_RESET: u32 = 0x0220_0000;

/// The core.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Core {
    gotgctl: u32,
    gahbcfg: u32,
    gusbcfg: u32,
    gccfg: u32,
    grstctl: u32,
    /// What GINTSTS latches.
    pub(super) latched: u32,
    gintmsk: u32,
    rx_words: u32,
    tx_words: [u32; ENDPOINTS],
    dcfg: u32,
    dctl: u32,
    diepmsk: u32,
    doepmsk: u32,
    daintmsk: u32,
    diepempmsk: u32,
    pcgcctl: u32,
    /// Since when it has been told to be a device, by its own transceiver.
    device_since: Option<VirtualNanos>,
    pub(super) receive: Receive,
    pub(super) transmit: [Transmit; ENDPOINTS],
    pub(super) inputs: [Endpoint; ENDPOINTS],
    pub(super) outputs: [Endpoint; ENDPOINTS],
    /// The address in force: a new one is, when the status stage of the request that gave it is
    /// over.
    pub(super) address: u8,
    pub(super) frame: u16,
    pub(super) suspended: bool,
    /// A SETUP was taken, and no token has followed.
    pub(super) in_setup: bool,
    /// What was asked for and is not done.
    #[serde(skip)]
    complaints: Vec<(&'static str, &'static str)>,
}

impl Default for Core {
    fn default() -> Self {
        Self {
            gotgctl: 0,
            gahbcfg: 0,
            gusbcfg: GUSBCFG_RESET,
            gccfg: 0,
            grstctl: 0,
            latched: 0,
            gintmsk: 0,
            rx_words: FIFO_RESET,
            tx_words: [FIFO_RESET; ENDPOINTS],
            dcfg: DCFG_RESET,
            dctl: 0,
            diepmsk: 0,
            doepmsk: 0,
            daintmsk: 0,
            diepempmsk: 0,
            pcgcctl: 0,
            device_since: None,
            receive: Receive::default(),
            transmit: std::array::from_fn(|_| Transmit::default()),
            inputs: std::array::from_fn(Endpoint::new),
            outputs: std::array::from_fn(Endpoint::new),
            address: 0,
            frame: 0,
            suspended: false,
            in_setup: false,
            complaints: Vec::new(),
        }
    }
}

impl Core {
    /// What was asked for and is not done, since the last time.
    pub fn take_complaints(&mut self) -> Vec<(&'static str, &'static str)> {
        std::mem::take(&mut self.complaints)
    }

    pub(super) fn complain(&mut self, register: &'static str, reason: &'static str) {
        self.complaints.push((register, reason));
    }

    /// Whether the interrupt line is high.
    pub fn interrupts(&self, now: VirtualNanos) -> bool {
        self.gahbcfg & GINT != 0 && self.gintsts(now) & self.gintmsk != 0
    }

    /// Whether the pull-up on D+ is on. The voltage of the cable counts only where it is looked at.
    pub(super) fn shows_itself(&self) -> bool {
        let session = self.gotgctl & (gotgctl::BVALOEN | gotgctl::BVALOVAL);
        let valid = session == gotgctl::BVALOEN | gotgctl::BVALOVAL;
        self.device_since.is_some()
            && self.gccfg & PWRDWN != 0
            && self.dctl & dctl::SDIS == 0
            && valid
    }

    pub(super) fn rx_depth(&self) -> usize {
        (self.rx_words & 0xFFFF) as usize
    }

    fn tx_depth(&self, fifo: usize) -> usize {
        (self.tx_words.get(fifo).copied().unwrap_or_default() >> 16) as usize
    }

    fn is_device(&self, now: VirtualNanos) -> bool {
        self.device_since.is_some_and(|since| now.0 >= since.0 + ROLE_NANOS)
    }

    fn gintsts(&self, now: VirtualNanos) -> u32 {
        let daint = self.daint() & self.daintmsk;
        let when = |condition, bit| if condition { bit } else { 0 };
        self.latched
            | gint::NPTXFE
            | gint::PTXFE
            | when(!self.is_device(now), gint::CMOD)
            | when(self.receive.is_filled(), gint::RXFLVL)
            | when(daint & 0xFFFF != 0, gint::IEPINT)
            | when(daint >> 16 != 0, gint::OEPINT)
    }

    /// DIEPINT of an endpoint, with the state of its FIFO: half empty counts as empty
    /// (GAHBCFG.TXFELVL is 0).
    fn diepint(&self, number: usize) -> u32 {
        let fifo = self.inputs[number].fifo();
        let used = self.transmit.get(fifo).map_or(0, Transmit::used);
        self.inputs[number].flags | if 2 * used <= self.tx_depth(fifo) { epint::TXFE } else { 0 }
    }

    fn daint(&self) -> u32 {
        (0..ENDPOINTS).fold(0, |daint, number| {
            let mask =
                self.diepmsk | if self.diepempmsk >> number & 1 == 1 { epint::TXFE } else { 0 };
            let input = u32::from(self.diepint(number) & mask != 0);
            let output = u32::from(self.outputs[number].flags & self.doepmsk != 0);
            daint | input << number | output << (16 + number)
        })
    }

    fn dsts(&self) -> u32 {
        let suspended = if self.suspended { dsts::SUSPSTS } else { 0 };
        suspended | dsts::FULL_SPEED | u32::from(self.frame) << dsts::FNSOF_SHIFT
    }

    /// A read that changes nothing; `None` for a register that is not modelled.
    pub fn peek(&self, offset: u64, now: VirtualNanos) -> Option<u32> {
        if let Some((endpoint, register)) = within(offset, device::IN) {
            let fifo = self.inputs[endpoint].fifo();
            let free = self
                .tx_depth(fifo)
                .saturating_sub(self.transmit.get(fifo).map_or(0, Transmit::used));
            return match register {
                device::CTL => Some(self.inputs[endpoint].ctl()),
                device::INT => Some(self.diepint(endpoint)),
                device::SIZ => Some(self.inputs[endpoint].size),
                device::TXFSTS => u32::try_from(free).ok(),
                _ => None,
            };
        }
        if let Some((endpoint, register)) = within(offset, device::OUT) {
            return match register {
                device::CTL => Some(self.outputs[endpoint].ctl()),
                device::INT => Some(self.outputs[endpoint].flags),
                device::SIZ => Some(self.outputs[endpoint].size),
                _ => None,
            };
        }
        Some(match offset {
            global::GOTGCTL => self.gotgctl | gotgctl::CIDSTS | gotgctl::BSVLD,
            global::GOTGINT | global::HWCFG4 => 0,
            global::GAHBCFG => self.gahbcfg,
            global::GUSBCFG => self.gusbcfg,
            global::GRSTCTL => self.grstctl | grstctl::AHBIDL,
            global::GINTSTS => self.gintsts(now),
            global::GINTMSK => self.gintmsk,
            global::GRXSTSR | global::GRXSTSP => self.receive.status(),
            global::GRXFSIZ => self.rx_words,
            global::DIEPTXF0 => self.tx_words[0],
            global::GCCFG => self.gccfg,
            global::CID => CORE,
            device::DCFG => self.dcfg,
            device::DCTL => self.dctl,
            device::DSTS => self.dsts(),
            device::DIEPMSK => self.diepmsk,
            device::DOEPMSK => self.doepmsk,
            device::DAINT => self.daint(),
            device::DAINTMSK => self.daintmsk,
            device::DIEPEMPMSK => self.diepempmsk,
            PCGCCTL => self.pcgcctl,
            _ => self.tx_words.get(tx_register(offset)?).copied()?,
        })
    }

    /// A read by the processor.
    pub fn read(&mut self, offset: u64, now: VirtualNanos) -> u32 {
        if fifo_of(offset).is_some() {
            // Whichever window is read, it is the one receive FIFO.
            return self.receive.word().unwrap_or_else(|| {
                self.complain("DFIFO", "read while no packet is there");
                0
            });
        }
        if offset == global::GRXSTSP {
            let (status, clean) = self.receive.pop();
            if !clean {
                self.complain("GRXSTSP", "read before the packet was");
            }
            self.popped(status);
            return status;
        }
        self.peek(offset, now).unwrap_or_else(|| {
            self.complain("OTG", "a register that is not modelled was read");
            0
        })
    }

    /// A status word that acts when it is taken (RM0433, GRXSTSP: 0011 and 0100 raise an
    /// interrupt).
    fn popped(&mut self, status: u32) {
        let (endpoint, what) = endpoint_and_status(status);
        let Some(output) = self.outputs.get_mut(endpoint) else { return };
        match what {
            pktsts::OUT_DONE => {
                output.clear(epctl::EPENA);
                output.flags |= epint::XFRC;
            }
            pktsts::SETUP_DONE => {
                output.clear(epctl::EPENA);
                output.flags |= epint::STUP;
            }
            _ => {}
        }
    }

    /// A write by the processor.
    pub fn write(&mut self, offset: u64, value: u32, now: VirtualNanos) {
        if let Some(fifo) = fifo_of(offset) {
            let depth = self.tx_depth(fifo);
            if !self.transmit.get_mut(fifo).is_some_and(|transmit| transmit.push(value, depth)) {
                self.complain("DFIFO", "written beyond its end");
            }
        } else if let Some((endpoint, register)) = within(offset, device::IN) {
            let told = write_endpoint(&mut self.inputs[endpoint], register, value);
            told.into_iter().for_each(|reason| self.complain("DIEP", reason));
        } else if let Some((endpoint, register)) = within(offset, device::OUT) {
            let told = write_endpoint(&mut self.outputs[endpoint], register, value);
            told.into_iter().for_each(|reason| self.complain("DOEP", reason));
        } else {
            self.write_register(offset, value, now);
        }
    }

    fn write_register(&mut self, offset: u64, value: u32, now: VirtualNanos) {
        match offset {
            global::GOTGCTL => self.gotgctl = value & (gotgctl::BVALOEN | gotgctl::BVALOVAL),
            global::GAHBCFG => self.gahbcfg = value,
            global::GUSBCFG => {
                self.gusbcfg = value;
                let told = value & (PHYSEL | FDMOD) == PHYSEL | FDMOD;
                self.device_since = if told { self.device_since.or(Some(now)) } else { None };
            }
            global::GRSTCTL => self.write_reset(value),
            global::GINTSTS => self.latched &= !(value & gint::LATCHED),
            global::GINTMSK => self.gintmsk = value,
            global::GRXFSIZ => self.rx_words = value & 0xFFFF,
            global::DIEPTXF0 => self.tx_words[0] = value,
            global::GCCFG => {
                self.gccfg = value;
                if value & VBDEN != 0 {
                    self.complain("GCCFG", "the voltage of the cable is not modelled (VBDEN)");
                }
            }
            device::DCFG => {
                self.dcfg = value;
                if value & DAD == 0 {
                    self.address = 0;
                }
            }
            device::DCTL => {
                self.dctl = value & dctl::SDIS;
                if value & (dctl::RWUSIG | dctl::SGINAK | dctl::SGONAK) != 0 {
                    self.complain("DCTL", "remote wake-up and global NAK are not modelled");
                }
            }
            device::DIEPMSK => self.diepmsk = value,
            device::DOEPMSK => self.doepmsk = value,
            device::DAINTMSK => self.daintmsk = value,
            device::DIEPEMPMSK => self.diepempmsk = value,
            PCGCCTL => self.pcgcctl = value,
            global::GOTGINT | global::CID | device::DSTS | device::DAINT => {}
            _ => match tx_register(offset).and_then(|fifo| self.tx_words.get_mut(fifo)) {
                Some(words) => *words = value,
                None => self.complain("OTG", "a register that is not modelled was written"),
            },
        }
    }

    /// GRSTCTL: resets and flushes are over at once.
    fn write_reset(&mut self, value: u32) {
        self.grstctl = value & grstctl::TXFNUM;
        if value & grstctl::CSRST != 0 {
            *self =
                Self { gusbcfg: self.gusbcfg, device_since: self.device_since, ..Self::default() };
            return;
        }
        if value & grstctl::RXFFLSH != 0 {
            self.receive.flush();
        }
        if value & grstctl::TXFFLSH != 0 {
            let number = (value & grstctl::TXFNUM) >> 6;
            for (fifo, transmit) in self.transmit.iter_mut().enumerate() {
                if number == grstctl::ALL_FIFOS || number as usize == fifo {
                    transmit.flush();
                }
            }
        }
    }

    /// The address that the driver has set.
    pub(super) fn new_address(&self) -> u8 {
        u8::try_from((self.dcfg & DAD) >> DAD_SHIFT).expect("seven bits")
    }
}

fn write_endpoint(endpoint: &mut Endpoint, register: u64, value: u32) -> Option<&'static str> {
    match register {
        device::CTL => return endpoint.write_ctl(value),
        device::INT => endpoint.flags &= !value,
        device::SIZ => endpoint.size = value,
        _ => return Some("a register that is not modelled was written"),
    }
    None
}

/// The endpoint and its register at an offset, of the endpoints that begin at `first`.
fn within(offset: u64, first: u64) -> Option<(usize, u64)> {
    let number = usize::try_from(offset.checked_sub(first)? / device::ENDPOINT).ok()?;
    (number < ENDPOINTS).then_some((number, (offset - first) % device::ENDPOINT))
}

/// The FIFO of DIEPTXF1 and the following at an offset.
fn tx_register(offset: u64) -> Option<usize> {
    let number = usize::try_from(offset.checked_sub(global::DIEPTXF1)? / 4).ok()? + 1;
    (number < ENDPOINTS).then_some(number)
}

fn fifo_of(offset: u64) -> Option<usize> {
    usize::try_from(offset.checked_sub(FIFO)? / FIFO_BYTES).ok()
}
