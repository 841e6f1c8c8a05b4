//! `mgw update`

use std::path::Path;
use std::time::Duration;

use firmware_image::{CHECKSUM, Check, FirmwareVersion, NO_KEY};
use host_protocol::replies::ImageReport;
use host_protocol::{AxisState, Error, ImageState, MAX_IMAGE_BYTES, Protocol, SIGNATURE_SIZE};
use mgw_client::{Client, ClientError, Transport};
use serde_json::json;

use crate::args::UpdateArgs;
use crate::explain::Page;
use crate::failure::Failure;
use crate::image_file::{ImageFile, read_file};
use crate::session::Session;
use crate::words;

/// From the start on, for the loader to copy both images and for the gateway to be there again.
const AWAY: Duration = Duration::from_secs(60);
/// For as long what stands in the way of a confirmation may go away: the trial is over then.
const TRIAL: Duration = Duration::from_secs(60);
/// A clock that is behind by more has begun anew: it stands still for 100 ms at least.
const CLOCK_ERROR: Duration = Duration::from_millis(50);
/// Between two looks whether it is there again.
const LOOK_AGAIN: Duration = Duration::from_millis(500);
/// For as long an axis may be busy for another program, which only reads.
const BUSY: Duration = Duration::from_secs(5);
/// Parts of which each is told when it is written.
const PARTS: usize = 10;
/// What remains to be done where an update ends before its confirmation.
const TO_KEEP: &str = "if the new firmware runs on trial, `mgw update --confirm` within 60 s of its \
    start keeps it; else the one before runs";

/// Sends another firmware, has the gateway run it, and keeps it if it is well.
pub fn run(session: &mut Session, arguments: &UpdateArgs) -> Result<(), Failure> {
    let Some(path) = &arguments.file else { return confirm(session) };
    let image = ImageFile::read(path)?;
    let signature = arguments.signature.as_deref().map(read_signature).transpose()?;
    let before = session.client.image()?;
    let board = session.client.hello().board.to_string();
    check(&image, &before, &board, arguments.allow_older)?;
    check_signature(session, &image, &before, signature.as_deref())?;
    check_at_rest(session)?;
    let version = image.header.version;
    if arguments.check {
        return session.out.event(
            "would_be_taken",
            format!("the gateway would take it: {} instead of {}", version, before.version),
            json!({ "version": version.to_string(), "runs": before.version.to_string() }),
        );
    }
    send(session, &image, arguments.allow_older)?;
    let is_taken = start_anew(session, &signature.unwrap_or_default())?;
    keep(session, &Update { before, version, is_taken })
}

/// An update whose image is to run.
struct Update {
    /// What ran before.
    before: ImageReport,
    /// Of the image that was sent.
    version: FirmwareVersion,
    /// The gateway said that it would start with it.
    is_taken: bool,
}

/// Another firmware does not run, by a name for programs.
fn failed(name: &'static str, text: impl Into<String>) -> Failure {
    Failure::named(name, Page::FirmwareUpdate, text)
}

fn rolled_back(runs: &ImageReport) -> Failure {
    failed(
        "RolledBack",
        format!(
            "the new firmware was not confirmed in its time, or did not come up: version {} runs again",
            runs.version
        ),
    )
}

/// What the gateway would refuse, before anything is sent.
fn check(
    image: &ImageFile,
    runs: &ImageReport,
    board: &str,
    allow_older: bool,
) -> Result<(), Failure> {
    let header = &image.header;
    let refused = |error: Error, text: String| Err(Failure::Explained { error, text });
    if header.board() != board {
        return refused(
            Error::ImageForAnotherBoard {},
            format!("the image is for a {}, and the gateway is a {board}", header.board()),
        );
    }
    if runs.room == 0 {
        return Err(ClientError::Gateway(Error::NoImageRoom {}).into());
    }
    if header.version < runs.version && !allow_older {
        return refused(
            Error::OlderImage { running: runs.version },
            format!(
                "the image is version {}, older than {}, which runs; --allow-older takes it",
                header.version, runs.version
            ),
        );
    }
    if image.bytes.len() > runs.room as usize {
        return refused(
            Error::ImageLength { room: runs.room },
            format!(
                "the image has {} bytes, and there is room for {}",
                image.bytes.len(),
                runs.room
            ),
        );
    }
    if matches!(runs.state, ImageState::OnTrial { .. }) {
        return Err(ClientError::Gateway(Error::ImageOnTrial {}).into());
    }
    Ok(())
}

/// What carries a key, or is for a gateway that does, must be signed.
fn check_signature(
    session: &Session,
    image: &ImageFile,
    runs: &ImageReport,
    signature: Option<&[u8]>,
) -> Result<(), Failure> {
    let refused = |text: &str| {
        let text = format!("{text} (docs/update.md)");
        Err(Failure::Explained { error: Error::ImageNotSigned {}, text })
    };
    let tell = |name, text| session.out.progress(name, text, json!({}));
    let header = &image.header;
    match signature {
        None if runs.needs_signature => {
            refused("the gateway carries a key and takes only signed images: --signature FILE")
        }
        None if header.has_key() => refused(
            "the image carries a key, and must be signed with its other half: --signature FILE",
        ),
        None => Ok(()),
        Some(_) if runs.needs_signature => {
            tell(
                "signature_unknown",
                "the gateway alone knows its key: it looks at the signature when all is written",
            );
            Ok(())
        }
        Some(_) if !header.has_key() => {
            tell(
                "signature_unused",
                "nobody looks at the signature: neither the gateway nor the image carries a key",
            );
            Ok(())
        }
        Some(signature) => {
            let mut check = Check::new(NO_KEY);
            check.update(&image.bytes);
            let checksum = CHECKSUM.checksum(&image.bytes);
            match check.finish(header.board(), header.version, checksum, signature) {
                Ok(()) => Ok(()),
                Err(_) => refused(
                    "the signature is none of this image by the other half of the key that it carries",
                ),
            }
        }
    }
}

/// The gateway says so of one axis; this names all.
fn check_at_rest(session: &mut Session) -> Result<(), Failure> {
    // An RMD holds by what the gateway sends.
    let rests = |state, protocol| {
        matches!(state, AxisState::Unconfigured | AxisState::Idle)
            || state == AxisState::Holding && protocol != Some(Protocol::Rmd)
    };
    let axes = session.client.list_axes()?;
    let mut moving = axes.iter().filter(|axis| !rests(axis.state, axis.protocol));
    let Some(first) = moving.next() else { return Ok(()) };
    let error = Error::NotIdle { axis: first.axis, state: first.state };
    let named: Vec<String> = [first]
        .into_iter()
        .chain(moving)
        .map(|axis| format!("axis {} ({})", axis.axis, words::axis_state(axis.state)))
        .collect();
    let text = format!(
        "every axis must be at rest, and {} {} not: `mgw stop` stops, `mgw clear` ends a trip or an \
            e-stop, and then `mgw output-off AXIS` lets an RMD go that holds",
        named.join(", "),
        if named.len() == 1 { "is" } else { "are" },
    );
    Err(Failure::Explained { error, text })
}

fn read_signature(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = read_file(path)?;
    if bytes.len() == SIGNATURE_SIZE {
        return Ok(bytes);
    }
    Err(Failure::Usage(format!(
        "{} is no Ed25519 signature: it has {} bytes, and a signature has {SIGNATURE_SIZE}",
        path.display(),
        bytes.len()
    )))
}

fn send(session: &mut Session, image: &ImageFile, allow_older: bool) -> Result<(), Failure> {
    let ImageFile { header, bytes } = image;
    let length = bytes.len();
    let announced = u32::try_from(length).unwrap_or(u32::MAX);
    let checksum = CHECKSUM.checksum(bytes);
    let (client, out) = (&mut session.client, session.out);
    while_busy(client, |client| {
        client.begin_image(header.board(), header.version, announced, checksum, allow_older)
    })?;
    let mut told = 0;
    for (offset, part) in (0u32..).step_by(MAX_IMAGE_BYTES).zip(bytes.chunks(MAX_IMAGE_BYTES)) {
        while_busy(client, |client| client.write_image(offset, part)).map_err(ended)?;
        let written = offset as usize + part.len();
        if written * PARTS / length > told {
            told = written * PARTS / length;
            out.progress(
                "written",
                format!("written   {written} of {length} bytes"),
                json!({ "bytes": written, "of_bytes": length }),
            );
        }
    }
    Ok(())
}

/// Why the image could not be written to its end.
fn ended(error: ClientError) -> Failure {
    let ClientError::Gateway(error) = error else { return error.into() };
    let text = match error {
        Error::ImageGap { .. } | Error::ImageIncomplete { .. } => {
            "the gateway has started anew, or another program has begun an update".to_owned()
        }
        Error::NotIdle { axis, state } => {
            format!("axis {axis} is {} now, and was at rest", words::axis_state(state))
        }
        error => error.to_string(),
    };
    let text =
        format!("{text}. The update has ended, and the firmware is as before: send it again");
    Failure::Explained { error, text }
}

/// Whether what went wrong may be over in a moment.
fn may_pass(error: &ClientError) -> bool {
    matches!(
        error,
        ClientError::NoAnswer { .. }
            | ClientError::Transport(_)
            | ClientError::Connect(_)
            | ClientError::LinksTaken
            | ClientError::Gateway(
                Error::NotInCommand { .. }
                    | Error::NobodyInCommand {}
                    | Error::Saving {}
                    | Error::GatewayAway {}
                    | Error::NoSession {}
            )
    )
}

/// Asks again while an axis carries something out for another program.
fn while_busy<T: Transport>(
    client: &mut Client<T>,
    mut ask: impl FnMut(&mut Client<T>) -> Result<(), ClientError>,
) -> Result<(), ClientError> {
    let end = client.now() + BUSY;
    loop {
        match ask(client) {
            Err(ClientError::Gateway(Error::Busy { .. })) if client.now() < end => {
                client.pause(BUSY / 100)?;
            }
            result => return result,
        }
    }
}

/// Has the image checked and run, and waits for the gateway after its start, which its clock tells.
/// Where request or answer are lost, and it has not started, it is asked again. Returns whether it
/// said that it would.
fn start_anew(session: &mut Session, signature: &[u8]) -> Result<bool, Failure> {
    let (client, out) = (&mut session.client, session.out);
    let asked = client.now();
    let before = Duration::from_micros(client.gateway_now_us());
    let mut end = asked + AWAY;
    let (mut asks, mut is_taken, mut refused) = (true, false, None);
    loop {
        if std::mem::take(&mut asks) {
            match while_busy(client, |client| client.finish_image(signature)) {
                Ok(()) | Err(ClientError::Gateway(Error::Restarting {})) => {
                    (is_taken, end) = (true, client.now() + AWAY);
                    let text = "checked   it starts anew, which takes about 15 s";
                    out.progress("restarting", text, json!({}));
                }
                // A repeated request may come after the start, which is told below.
                Err(ClientError::Gateway(Error::ImageOnTrial {})) => {}
                Err(error) if may_pass(&error) => refused = Some(error),
                Err(error @ ClientError::Interrupted { .. }) => return Err(unconfirmed(&error)),
                Err(ClientError::Gateway(error @ Error::ImageIncomplete { .. }))
                    if refused.is_some() =>
                {
                    let text = "the gateway has not taken the image, and its reason was lost with the \
                        connection. The firmware is as before: send it again";
                    return Err(Failure::Explained { error, text: text.to_owned() });
                }
                Err(error) => return Err(ended(error)),
            }
        }
        wait(client)?;
        let cause = match client.reconnect() {
            Ok(()) => {
                let goes_on = before + (client.now() - asked);
                let shows = Duration::from_micros(client.gateway_now_us());
                if shows + client.clock_uncertainty() + CLOCK_ERROR < goes_on {
                    return Ok(is_taken);
                }
                asks = !is_taken;
                None
            }
            Err(error @ ClientError::Interrupted { .. }) => return Err(unconfirmed(&error)),
            Err(error @ ClientError::Incompatible { .. }) => {
                return Err(failed(
                    "Incompatible",
                    format!(
                        "{error}. So the new firmware is not kept, and the one before runs again \
                            within 60 s"
                    ),
                ));
            }
            Err(error) => Some(error),
        };
        if client.now() >= end {
            return Err(match cause.or(refused) {
                Some(error) if is_taken => unconfirmed(&error),
                Some(error) => failed(
                    "NotUpdated",
                    format!("{error}. Whether the gateway took the image is not known: {TO_KEEP}"),
                ),
                None => failed(
                    "NotRestarted",
                    "the gateway was told to start anew and has not; switch it off and on",
                ),
            });
        }
    }
}

/// Lets time pass before the next try, with a connection or without.
fn wait<T: Transport>(client: &mut Client<T>) -> Result<(), Failure> {
    match client.pause(LOOK_AGAIN) {
        Ok(()) => {}
        Err(error @ ClientError::Interrupted { .. }) => return Err(unconfirmed(&error)),
        Err(_) => client.pause_unconnected(LOOK_AGAIN),
    }
    Ok(())
}

fn unconfirmed(error: &ClientError) -> Failure {
    failed("NotConfirmed", format!("{error}. As for the update: {TO_KEEP}"))
}

/// Keeps the firmware of an update. What stands in the way is tried again as long as the trial
/// lasts.
fn keep(session: &mut Session, update: &Update) -> Result<(), Failure> {
    let end = session.client.now() + TRIAL;
    let mut asked = false;
    loop {
        let error = match confirm_update(session, update, &mut asked) {
            Err(Failure::Client(error)) => error,
            result => return result,
        };
        let may_pass =
            may_pass(&error) || matches!(error, ClientError::Gateway(Error::NoImageOnTrial {}));
        let client = &mut session.client;
        if !may_pass || client.now() >= end {
            return Err(unconfirmed(&error));
        }
        wait(client)?;
        if !matches!(error, ClientError::Gateway(_)) {
            // Where that fails the next confirmation does as well, and says why.
            let _ = client.reconnect();
        }
    }
}

/// Keeps the firmware of an update if it runs on trial and is well. `asked`: it was asked for
/// before, and the answer may have been lost.
fn confirm_update(session: &mut Session, update: &Update, asked: &mut bool) -> Result<(), Failure> {
    let Update { before, version, is_taken } = update;
    let runs = session.client.image()?;
    let is_new = runs.version == *version;
    match runs.state {
        ImageState::OnTrial { .. } if is_new => {
            check_self_test(session)?;
            *asked = true;
            session.client.confirm_image()?;
        }
        ImageState::RolledBack if *is_taken || before.state != runs.state => {
            return Err(rolled_back(&runs));
        }
        // Somebody else may have confirmed it.
        ImageState::Kept if is_new && (*asked || before.version != *version) => {}
        _ => {
            return Err(failed(
                "NotUpdated",
                format!("version {} runs after the start, and not the new one", runs.version),
            ));
        }
    }
    tell_confirmed(session, &runs)
}

/// `mgw update --confirm`
fn confirm(session: &mut Session) -> Result<(), Failure> {
    let runs = session.client.image()?;
    match runs.state {
        ImageState::RolledBack => Err(rolled_back(&runs)),
        ImageState::Kept => session.out.event(
            "nothing_on_trial",
            format!("version {} runs and is kept: nothing is on trial", runs.version),
            json!({ "version": runs.version.to_string() }),
        ),
        ImageState::OnTrial { .. } => {
            check_self_test(session)?;
            session.client.confirm_image()?;
            tell_confirmed(session, &runs)
        }
    }
}

fn check_self_test(session: &mut Session) -> Result<(), Failure> {
    let status = session.client.gateway_status()?;
    if !status.memory_damaged && status.random_number {
        return Ok(());
    }
    Err(failed(
        "SelfTest",
        "the new firmware does not pass its self-test (mgw info), so it is not kept: the one \
            before runs again within 60 s",
    ))
}

fn tell_confirmed(session: &Session, runs: &ImageReport) -> Result<(), Failure> {
    session.out.event(
        "confirmed",
        format!("confirmed version {} runs, and is kept", runs.version),
        json!({ "version": runs.version.to_string() }),
    )
}
