//! `mgw update`

use std::path::Path;
use std::thread;
use std::time::Duration;

use firmware_image::CHECKSUM;
use host_protocol::replies::ImageReport;
use host_protocol::{Error, ImageState, MAX_IMAGE_BYTES, SIGNATURE_SIZE};
use mgw_client::ClientError;
use serde_json::json;

use crate::args::UpdateArgs;
use crate::failure::Failure;
use crate::image_file::{ImageFile, read_file};
use crate::session::Session;

/// From the start on, for the loader to copy both images and for the gateway to be there again.
const AWAY: Duration = Duration::from_secs(60);
/// A clock that is behind by more has begun anew: it stands still for 100 ms at least.
const CLOCK_ERROR: Duration = Duration::from_millis(50);
/// Between two looks whether it is there again.
const LOOK_AGAIN: Duration = Duration::from_millis(500);
/// Parts of which each is told when it is written.
const PARTS: usize = 10;

/// Sends another firmware, has the gateway run it, and keeps it if it is well.
pub fn run(session: &mut Session, arguments: &UpdateArgs) -> Result<(), Failure> {
    let Some(path) = &arguments.file else { return confirm(session) };
    let image = ImageFile::read(path)?;
    let signature = arguments.signature.as_deref().map(read_signature).transpose()?;
    let runs = session.client.image()?;
    let board = session.client.hello().board.to_string();
    check(&image, &runs, &board, signature.is_some(), arguments.allow_older)?;
    let version = image.header.version;
    if arguments.check {
        return session.out.event(
            "would_be_taken",
            format!("the gateway would take it: {} instead of {}", version, runs.version),
            json!({ "version": version.to_string(), "runs": runs.version.to_string() }),
        );
    }
    send(session, &image, &signature.unwrap_or_default(), arguments.allow_older)?;
    come_back(session)?;
    let runs = session.client.image()?;
    match runs.state {
        ImageState::OnTrial { .. } if runs.version == version => confirm(session),
        ImageState::RolledBack => Err(rolled_back(&runs)),
        _ => Err(Failure::Update {
            name: "NotUpdated",
            text: format!("version {} runs after the start, and not the new one", runs.version),
        }),
    }
}

fn rolled_back(runs: &ImageReport) -> Failure {
    Failure::Update {
        name: "RolledBack",
        text: format!(
            "the new firmware was not confirmed in its time, or did not come up: version {} runs \
                again; see mgw trips",
            runs.version
        ),
    }
}

/// What the gateway would refuse, before anything is sent.
fn check(
    image: &ImageFile,
    runs: &ImageReport,
    board: &str,
    is_signed: bool,
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
    if runs.needs_signature && !is_signed {
        return refused(
            Error::ImageNotSigned {},
            "the gateway carries a key and takes only signed images: --signature FILE \
                (docs/update.md)"
                .to_owned(),
        );
    }
    Ok(())
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

fn send(
    session: &mut Session,
    image: &ImageFile,
    signature: &[u8],
    allow_older: bool,
) -> Result<(), Failure> {
    let ImageFile { header, bytes } = image;
    let length = bytes.len();
    let announced = u32::try_from(length).unwrap_or(u32::MAX);
    let checksum = CHECKSUM.checksum(bytes);
    let (client, out) = (&mut session.client, session.out);
    client.begin_image(header.board(), header.version, announced, checksum, allow_older)?;
    let mut told = 0;
    for (offset, part) in (0u32..).step_by(MAX_IMAGE_BYTES).zip(bytes.chunks(MAX_IMAGE_BYTES)) {
        client.write_image(offset, part)?;
        let written = offset as usize + part.len();
        if written * PARTS / length > told {
            told = written * PARTS / length;
            out.event(
                "written",
                format!("written   {written} of {length} bytes"),
                json!({ "bytes": written, "of_bytes": length }),
            )?;
        }
    }
    match client.finish_image(signature) {
        Ok(()) => {}
        // Its answer may be lost, as it starts anew soon after.
        Err(ClientError::NoAnswer { .. } | ClientError::Transport(_)) => {}
        Err(error) => return Err(error.into()),
    }
    out.event("restarting", "checked   it starts anew, which takes about 15 s", json!({}))
}

/// Waits for the gateway after its start, which its clock tells.
fn come_back(session: &mut Session) -> Result<(), Failure> {
    let client = &mut session.client;
    let (asked, end) = (client.now(), client.now() + AWAY);
    let before = Duration::from_micros(client.gateway_now_us());
    loop {
        if client.pause(LOOK_AGAIN).is_err() {
            // Its port is gone, so its transport waits for nothing.
            thread::sleep(LOOK_AGAIN);
        }
        let cause = match client.reconnect() {
            Ok(()) => {
                let goes_on = before + (client.now() - asked);
                let shows = Duration::from_micros(client.hello().time_us);
                if shows + CLOCK_ERROR < goes_on {
                    return Ok(());
                }
                None
            }
            Err(
                error @ (ClientError::Interrupted { .. }
                | ClientError::Gateway(Error::UnsupportedVersion { .. })),
            ) => return Err(error.into()),
            Err(error) => Some(error),
        };
        if client.now() >= end {
            return Err(match cause {
                Some(error) => error.into(),
                None => Failure::Update {
                    name: "NotRestarted",
                    text: "the gateway was told to start anew and has not; switch it off and on"
                        .to_owned(),
                },
            });
        }
    }
}

/// Keeps the firmware that runs on trial, unless it is not well.
fn confirm(session: &mut Session) -> Result<(), Failure> {
    let runs = session.client.image()?;
    let status = session.client.gateway_status()?;
    match runs.state {
        ImageState::RolledBack => return Err(rolled_back(&runs)),
        // An answer may have been lost.
        ImageState::Kept => {}
        ImageState::OnTrial { .. } if status.memory_damaged || !status.random_number => {
            return Err(Failure::Update {
                name: "SelfTest",
                text:
                    "the new firmware does not pass its self-test (mgw info), so it is not kept: \
                    the one before runs again within 60 s"
                        .to_owned(),
            });
        }
        ImageState::OnTrial { .. } => session.client.confirm_image()?,
    }
    session.out.event(
        "confirmed",
        format!("confirmed version {} runs, and is kept", runs.version),
        json!({ "version": runs.version.to_string() }),
    )
}
