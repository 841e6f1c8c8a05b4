//! One host link on a UART: bytes in, frames out.

use gateway::Event;
use host_protocol::{DEFAULT_BAUD, MAX_FRAME};

use crate::board;
use crate::line::{LineErrors, Overflow, Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// Bytes given to the core at once: the requests of a control loop come in one piece.
const CHUNK: usize = 64;

/// Line errors without a byte after which a ring counts as stuck.
const SILENT_ERRORS: u32 = 16;
/// What frames of the host protocol end with.
const DELIMITER: u8 = 0;

/// For ever: bytes from the host to the core.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn receive(gateway: &'static SharedGateway, link: u8, mut line: Receiver) -> ! {
    let watch = Watch::new(TaskId::link_receiver(link));
    let budget = TaskBudget::new(Urgency::Demand).await;
    let mut pieces = Pieces::new();
    let (mut errors, mut overflows) = (LineErrors::default(), LineErrors::default());
    let (mut heard, mut silent_errors) = (0, 0);
    loop {
        let new_errors = line.events.take_errors();
        if let Some(so_far) = errors.add(new_errors) {
            defmt::warn!("host link {=u8}: {=u32} line errors so far", link, so_far);
        }
        // Perhaps the host has lost the rate: the core judges that.
        if new_errors > 0 && gateway.baud(link) != DEFAULT_BAUD {
            gateway.handle(Event::HostLineError { link });
        }
        let before = core::mem::replace(&mut heard, line.events.heard());
        silent_errors = if heard == before { silent_errors + new_errors } else { 0 };
        // Nothing but errors, not even wrong bytes: the ring no longer takes what comes.
        if silent_errors >= SILENT_ERRORS {
            silent_errors = 0;
            line.events.ask_for_restart();
        }
        match budget.wait(watch.wait(line.read(pieces.room()))).await {
            None => {}
            Some(Ok(length)) => {
                if let Some(bytes) = pieces.add(length) {
                    gateway.handle(Event::HostBytes { link, bytes });
                }
            }
            Some(Err(Overflow)) => {
                if let Some(so_far) = overflows.add(1) {
                    defmt::warn!("host link {=u8}: {=u32} overflows so far", link, so_far);
                }
                // What follows is the rest of some frame: this ends what had come of one.
                if let Some(bytes) = pieces.end() {
                    gateway.handle(Event::HostBytes { link, bytes });
                }
            }
        }
    }
}

/// Bytes of a line until they end something: to give the core what it can only keep costs it as
/// much as a frame.
struct Pieces {
    chunk: [u8; CHUNK],
    /// How many have come.
    held: usize,
    /// What was given last has ended a frame: a delimiter behind it begins one, and says nothing.
    is_between_frames: bool,
}

impl Pieces {
    /// Of a line on which no frame has begun.
    fn new() -> Self {
        Self { chunk: [0; CHUNK], held: 0, is_between_frames: true }
    }

    /// Where the next bytes go; never empty.
    fn room(&mut self) -> &mut [u8] {
        self.chunk.get_mut(self.held..).unwrap_or_default()
    }

    /// What has come of a frame is all of it.
    fn end(&mut self) -> Option<&[u8]> {
        *self.room().first_mut()? = DELIMITER;
        self.add(1)
    }

    /// So many have come. Gives all that have, where they end something or fill the room.
    fn add(&mut self, length: usize) -> Option<&[u8]> {
        self.held += length;
        let bytes = self.chunk.get(..self.held)?;
        let is_opening = |byte: &&u8| self.is_between_frames && **byte == DELIMITER;
        let opening = bytes.iter().take_while(is_opening).count();
        let said = bytes.get(opening..)?;
        let is_whole = said.last() == Some(&DELIMITER);
        if !is_whole && !said.contains(&DELIMITER) && self.held < CHUNK {
            return None;
        }
        self.is_between_frames = bytes.last() == Some(&DELIMITER);
        self.held = 0;
        Some(bytes)
    }
}

/// For ever: frames from the core to the host, at the rate that the core wants when the last has
/// left.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn send(gateway: &'static SharedGateway, link: u8, mut line: Sender) -> ! {
    let watch = Watch::new(TaskId::link_sender(link));
    let mut baud = DEFAULT_BAUD;
    loop {
        watch.check_in();
        let before = core::mem::replace(&mut baud, gateway.baud(link));
        if baud != before {
            match line.set_bits_per_second(baud) {
                Ok(()) => defmt::info!("host link {=u8}: {=u32} baud", link, baud),
                Err(error) => {
                    defmt::warn!("host link {=u8}: {=u32} baud: {}", link, baud, error);
                }
            }
        }
        gateway.save(|| watch.check_in()).await;
        let room = line.message().first_chunk_mut::<MAX_FRAME>();
        let Some(length) = room.and_then(|frame| gateway.poll_host(link, frame)) else {
            while watch.wait(gateway.link_changed(link)).await.is_none() {}
            continue;
        };
        if line.send_held(length).await.is_err() {
            defmt::warn!(
                "host link {=u8}: a frame of {=usize} bytes did not leave in time",
                link,
                length
            );
        }
    }
}
