//! `mgw doctor`

mod bus;
mod motors;

use std::time::Duration;

use host_protocol::replies::GatewayReport;
use host_protocol::{ImageState, StoredState};
use serde_json::json;

use crate::config;
use crate::explain::Page;
use crate::failure::Failure;
use crate::motor::{Unfinished, unfinished_text};
use crate::session::Session;
use crate::words;

/// Pings whose round trips are measured.
const PINGS: usize = 20;
/// A round trip that takes longer costs setpoints: they live 100 ms unless told otherwise.
const SLOW: Duration = Duration::from_millis(30);
/// By how much two clocks may drift apart, in millionths: as much as the client allows for.
const DRIFT_PPM: f64 = 1_000.0;

/// What something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Grade {
    Good,
    /// Worth knowing.
    Note,
    Wrong,
}

/// One line: what was looked at, how it is, what to do, and the page that says more.
struct Line {
    of: String,
    grade: Grade,
    text: String,
    page: Option<Page>,
}

/// What is wrong, and the page that says more.
type Wrong = (Page, String);

/// What has been found so far.
#[derive(Default)]
struct Findings(Vec<Line>);

impl Findings {
    fn add(&mut self, of: impl Into<String>, grade: Grade, text: impl Into<String>) {
        self.0.push(Line { of: of.into(), grade, text: text.into(), page: None });
    }

    fn wrong(&mut self, of: impl Into<String>, page: Page, text: impl Into<String>) {
        let (grade, page) = (Grade::Wrong, Some(page));
        self.0.push(Line { of: of.into(), grade, text: text.into(), page });
    }

    /// Adds what is wrong; what is well where there is nothing.
    fn judge(&mut self, of: &str, wrong: Vec<Wrong>, well: impl Into<String>) {
        if wrong.is_empty() {
            return self.add(of, Grade::Good, well);
        }
        wrong.into_iter().for_each(|(page, text)| self.wrong(of, page, text));
    }
}

/// Looks at everything, and says of what is wrong what to do.
pub fn run(session: &mut Session) -> Result<(), Failure> {
    let mut findings = Findings::default();
    let began = (session.client.now(), session.client.gateway_now_us());
    let on_trial = firmware(session, &mut findings)?;
    let status = session.client.gateway_status()?;
    gateway(&status, on_trial, &mut findings);
    configuration(session, &mut findings)?;
    link(session, &mut findings)?;
    let before = bus::reports(session)?;
    let looked_from = session.client.now();
    let axes = motors::axes(session, &mut findings)?;
    motors::scan(session, &axes, &mut findings)?;
    let span = session.client.now() - looked_from;
    bus::judge(&before, &bus::reports(session)?, span, &mut findings);
    clock(session, began, &mut findings)?;

    let wrong = findings.0.iter().filter(|line| line.grade == Grade::Wrong).count();
    let verdict = if wrong > 0 { Err(Failure::Unwell { wrong }) } else { Ok(()) };
    Failure::first([verdict, print(session, &findings, wrong)])
}

fn print(session: &Session, findings: &Findings, wrong: usize) -> Result<(), Failure> {
    let lines = findings.0.iter().map(|Line { of, grade, text, page }| {
        let page = page.map(Page::code);
        json!({ "of": of, "grade": name(*grade), "message": text, "explain": page })
    });
    session.out.object(&json!({ "doctor": lines.collect::<Vec<_>>(), "wrong": wrong }))?;
    for Line { of, grade, text, page } in &findings.0 {
        let page = page.map(|page| format!(" {page}")).unwrap_or_default();
        session.out.text(format!("{:<6}{of:<10}{text}{page}", name(*grade)))?;
    }
    Ok(())
}

fn name(grade: Grade) -> &'static str {
    match grade {
        Grade::Good => "good",
        Grade::Note => "note",
        Grade::Wrong => "wrong",
    }
}

/// Returns whether it runs on trial, where nothing arms.
fn firmware(session: &mut Session, findings: &mut Findings) -> Result<bool, Failure> {
    let image = session.client.image()?;
    let hello = session.client.hello();
    let ours = env!("CARGO_PKG_VERSION");
    let theirs = hello.firmware.as_str();
    let text = format!("{theirs} ({}) on {}", hello.build_id, hello.board);
    if theirs == ours {
        findings.add("firmware", Grade::Good, text);
    } else {
        let todo = "use the mgw and the firmware of one version";
        findings.add("firmware", Grade::Note, format!("{text}, mgw is {ours}: {todo}"));
    }
    if hello.has_crash_report {
        findings.add("firmware", Grade::Note, "the run before failed: `mgw trips` says why");
    }
    match image.state {
        ImageState::Kept => {}
        ImageState::OnTrial { .. } => {
            findings.wrong("firmware", Page::FirmwareUpdate, words::image(&image));
        }
        ImageState::RolledBack => findings.add("firmware", Grade::Note, words::image(&image)),
    }
    Ok(matches!(image.state, ImageState::OnTrial { .. }))
}

fn gateway(status: &GatewayReport, on_trial: bool, findings: &mut Findings) {
    let wrong = [
        (
            status.e_stop_input_open == Some(true),
            Page::EStop,
            "the e-stop input is open: release the button, look at its cable, then `mgw clear \
                gateway`",
        ),
        (
            status.e_stop_latched && status.e_stop_input_open != Some(true),
            Page::EStop,
            "the e-stop is latched, so nothing arms: `mgw clear gateway`",
        ),
        (
            !status.random_number,
            Page::DoesNotArm,
            "the random generator gave no number, so nothing arms: reset the board",
        ),
        (
            status.memory_damaged,
            Page::GatewayRestarted,
            "the memory that outlives a reset was damaged: apply the configuration again",
        ),
        (
            status.enable_output == Some(false),
            Page::StopNotConfirmed,
            "the enable output is inactive, as an axis is unreachable: see the axes",
        ),
        (
            status.bus_limit.is_some(),
            Page::NotSupported,
            "a bus cannot run on this board: `mgw info` says why",
        ),
    ];
    let wrong = wrong.into_iter().filter(|(is_so, ..)| *is_so);
    let wrong = wrong.map(|(_, page, text)| (page, text.to_owned())).collect();
    findings.judge(
        "gateway",
        wrong,
        if on_trial { "nothing else is wrong" } else { "ready to arm" },
    );
}

/// What is stored, and what a command that was ended halfway may have left.
fn configuration(session: &mut Session, findings: &mut Findings) -> Result<(), Failure> {
    let stored = session.client.read_stored()?;
    let text = format!("stored: {}", words::stored(&stored));
    match stored.state {
        StoredState::NoStorage
        | StoredState::SingleBank
        | StoredState::Nothing
        | StoredState::Kept { differs: false } => {}
        StoredState::Kept { differs: true } => findings.add("gateway", Grade::Note, text),
        StoredState::Damaged
        | StoredState::OtherLayout { .. }
        | StoredState::Refused { .. }
        | StoredState::NotRead => findings.wrong("gateway", Page::NotStored, text),
    }
    let running = config::read(&mut session.client)?;
    if let Some(file) = Unfinished::new().before(&running) {
        let text = unfinished_text(&file);
        findings.wrong("gateway", Page::MotorSetting, text);
    }
    Ok(())
}

/// How long a request takes, and what arrives damaged.
fn link(session: &mut Session, findings: &mut Findings) -> Result<(), Failure> {
    let mut worst = Duration::ZERO;
    for _ in 0..PINGS {
        let sent = session.client.now();
        session.client.ping()?;
        worst = worst.max(session.client.now() - sent);
    }
    let damaged = session.client.losses().damaged;
    let mut wrong = Vec::new();
    if damaged > 0 {
        let text = format!("{damaged} frames arrived damaged: look at the cable to the gateway");
        wrong.push((Page::ConnectionLost, text));
    }
    if worst > SLOW {
        let text = format!(
            "a round trip took {} ms: setpoints may expire on their way. Load, a hub, or a bad line",
            worst.as_millis()
        );
        wrong.push((Page::SetpointExpired, text));
    }
    #[allow(clippy::cast_precision_loss)]
    let shown = worst.as_micros() as f64 / 1_000.0;
    findings.judge("link", wrong, format!("{PINGS} round trips, none over {shown:.1} ms"));
    Ok(())
}

/// Whether the clocks of the gateway and of this computer run alike, as far as the time that all
/// this took tells.
fn clock(
    session: &mut Session,
    (began, gateway_began): (Duration, u64),
    findings: &mut Findings,
) -> Result<(), Failure> {
    session.client.ping()?;
    let here = (session.client.now() - began).as_micros();
    let there = session.client.gateway_now_us().saturating_sub(gateway_began);
    // The measure at the beginning was no better than that at the end.
    let unsure = 2 * session.client.clock_uncertainty().as_micros();
    #[allow(clippy::cast_precision_loss)]
    let (here, there, unsure) = (here as f64, there as f64, unsure as f64);
    let apart = ((there - here).abs() - unsure).max(0.0);
    let ppm = if here > 0.0 { apart / here * 1e6 } else { 0.0 };
    let mut wrong = Vec::new();
    if ppm > DRIFT_PPM {
        let text = format!(
            "the gateway's clock and this computer's drift apart by {ppm:.0} ppm: setpoints may \
                expire too early or late"
        );
        wrong.push((Page::SetpointExpired, text));
    }
    findings.judge("clock", wrong, "the gateway's runs as this computer's");
    Ok(())
}
