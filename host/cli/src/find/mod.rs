//! Finds the gateway when nobody names its port, and says why a port cannot be used.

mod refused;

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use host_protocol::{Subject, is_name};
use mgw_client::{ClientError, ConnectError, Transport, names_before_hello, open, server_port};
use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

use crate::failure::Failure;
use crate::names::Names;
use crate::output::Output;
use crate::terminal;

/// The board's own USB port, as `src/usb/description.rs` of the firmware has it.
const GATEWAY: (u16, u16) = (0x1209, 0x0001);
/// ST's probes that have a virtual COM port: ST-LINK/V2-1 and V3 (ST's own udev rules).
const ST_VENDOR: u16 = 0x0483;
const ST_LINKS: [u16; 7] = [0x374B, 0x3752, 0x374E, 0x374F, 0x3753, 0x3754, 0x3757];

/// Where Linux lists its terminals. Without it the list is not to be had.
#[cfg(target_os = "linux")]
const TERMINALS: &str = "/sys/class/tty";

/// What may be a gateway has so long to tell its name.
const NAME_PATIENCE: Duration = Duration::from_millis(200);

/// A port behind which a gateway may be.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Candidate {
    port: String,
    what: String,
}

/// The port that was named, a running server, or the only one that may lead to a gateway, open.
pub fn open_port(
    named: Option<&str>,
    out: Output,
) -> Result<(String, Box<dyn Transport>), Failure> {
    if named.is_none()
        && let Some(port) = server_port()
    {
        match open(&port) {
            Ok(transport) => {
                out.aside(format!("through the server at {port}"));
                return Ok((port, transport));
            }
            // It has the cable.
            Err(error) if hangs(&error) => return Err(refused::explain(error)),
            // One that has ended leaves its socket behind.
            Err(_) => {}
        }
    }
    let port = match named {
        Some(name) => called(name, system_ports(), name_of).unwrap_or_else(|| name.to_owned()),
        None => {
            let may_ask = !out.is_json() && io::stdin().is_terminal() && io::stderr().is_terminal();
            let answer = may_ask.then_some(terminal::answer);
            let Candidate { port, what } =
                choose(system_ports(), answer, &mut io::stderr(), name_of)?;
            out.aside(format!("the gateway is taken to be at {port}, {what}"));
            port
        }
    };
    match open(&port) {
        Ok(transport) => Ok((port, transport)),
        Err(ConnectError::Serial { source, .. })
            if is_name(&port) && source.kind() == io::ErrorKind::NotFound =>
        {
            let (candidates, others) = candidates(system_ports());
            let there: Vec<String> =
                candidates.into_iter().map(|one| one.port).chain(others).collect();
            let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
            Err(Failure::Port {
                name: "NoPort",
                text: format!(
                    "no gateway on USB or an ST-LINK is called {port}, and no serial port is. Serial \
                        ports: {there}"
                ),
            })
        }
        Err(error) => Err(refused::explain(error)),
    }
}

/// Whether it is a server that runs and takes no connection.
pub fn hangs(error: &ConnectError) -> bool {
    matches!(error, ConnectError::Server { source, .. } if source.kind() == io::ErrorKind::TimedOut)
}

/// The port that was named, or the only one that may lead to a gateway; nobody is asked.
pub fn cable_port(named: Option<&str>) -> Result<String, Failure> {
    match named {
        Some(name) => Ok(called(name, system_ports(), name_of).unwrap_or_else(|| name.to_owned())),
        None => choose(system_ports(), None::<fn() -> Option<String>>, &mut io::sink(), name_of)
            .map(|one| one.port),
    }
}

/// Says which port leads to no gateway, where nothing answered at all; and why one did not open.
pub use refused::{explain, not_a_gateway};

fn system_ports() -> Vec<SerialPortInfo> {
    #[cfg(target_os = "linux")]
    if !std::path::Path::new(TERMINALS).is_dir() {
        return Vec::new();
    }
    // A system that cannot list its ports has none to offer.
    serialport::available_ports().unwrap_or_default()
}

/// The name of the gateway behind a port, if there is one that has a name.
fn name_of(port: &str) -> Option<String> {
    let names = names_before_hello(&mut open(port).ok()?, NAME_PATIENCE).ok()?;
    Names::from(names).of(Subject::Gateway).map(str::to_owned)
}

/// The port of the gateway that has this name, where it is that of no port.
fn called(
    name: &str,
    ports: Vec<SerialPortInfo>,
    name_of: impl Fn(&str) -> Option<String>,
) -> Option<String> {
    let is_port = ports.iter().any(|port| port.port_name == name);
    if !is_name(name) || is_port || std::path::Path::new(name).exists() {
        return None;
    }
    let (candidates, _) = candidates(ports);
    candidates.into_iter().map(|one| one.port).find(|port| name_of(port).as_deref() == Some(name))
}

/// Those behind which a gateway may be, and the others.
fn candidates(ports: Vec<SerialPortInfo>) -> (Vec<Candidate>, Vec<String>) {
    let (mut candidates, mut others) = (Vec::new(), Vec::new());
    for port in ports {
        // macOS has two names for each port; this one waits for a modem.
        if port.port_name.starts_with("/dev/tty.") {
            continue;
        }
        match &port.port_type {
            SerialPortType::UsbPort(usb) => match kind(usb) {
                Some(what) => candidates.push(Candidate { port: port.port_name, what }),
                None => others.push(port.port_name),
            },
            _ => others.push(port.port_name),
        }
    }
    candidates.sort_by(|one, other| one.port.cmp(&other.port));
    (candidates, others)
}

/// The only candidate, or the one that `answer` chooses among several, which are asked for their
/// names.
fn choose(
    ports: Vec<SerialPortInfo>,
    answer: Option<impl FnOnce() -> Option<String>>,
    asked: &mut impl Write,
    name_of: impl Fn(&str) -> Option<String>,
) -> Result<Candidate, Failure> {
    let (mut candidates, others) = candidates(ports);
    if candidates.len() < 2 {
        return candidates.pop().ok_or_else(|| Failure::NoGateway { text: nothing_found(&others) });
    }
    for one in &mut candidates {
        if let Some(name) = name_of(&one.port) {
            one.what = format!("{name}, {}", one.what);
        }
    }
    let list = |line: fn(usize, &Candidate) -> String| {
        candidates.iter().enumerate().map(|(place, one)| line(place + 1, one)).collect::<Vec<_>>()
    };
    let Some(answer) = answer else {
        let list = list(|_, Candidate { port, what }| format!("{port} ({what})"));
        return Err(Failure::Usage(format!(
            "several ports may lead to a gateway: {}. Name one with --port",
            list.join(", ")
        )));
    };
    let list = list(|place, Candidate { port, what }| format!("  {place}  {port}  {what}\n"));
    let _ = write!(asked, "Several ports may lead to a gateway:\n{}Which one? ", list.concat());
    let _ = asked.flush();
    let line = answer().ok_or(ClientError::Interrupted { armed: false })?;
    let place = line.trim().parse::<usize>().ok().and_then(|place| place.checked_sub(1));
    let chosen = place.and_then(|place| candidates.get(place)).cloned();
    chosen.ok_or_else(|| {
        Failure::Usage(format!("`{}` is none of them. Name one with --port", line.trim()))
    })
}

/// What the port of a USB device is, if a gateway may be behind it.
fn kind(usb: &UsbPortInfo) -> Option<String> {
    let name = if (usb.vid, usb.pid) == GATEWAY {
        "a gateway's own USB"
    } else if usb.vid == ST_VENDOR && ST_LINKS.contains(&usb.pid) {
        "an ST-LINK"
    } else {
        return None;
    };
    let serial = usb.serial_number.as_deref().map(|serial| format!(", serial number {serial}"));
    Some(name.to_owned() + &serial.unwrap_or_default())
}

fn nothing_found(others: &[String]) -> String {
    let others = match others {
        [] => String::new(),
        others => format!(" (there are other serial ports: {})", others.join(", ")),
    };
    format!(
        "which gateway? None is plugged in by USB or ST-LINK{others}. Add --port DEVICE or --port \
            tcp:HOST:PORT, or set MGW_PORT. `mgw sim` starts a simulated one"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usb(name: &str, vid: u16, pid: u16, serial: Option<&str>) -> SerialPortInfo {
        let serial_number = serial.map(str::to_owned);
        let usb = UsbPortInfo { vid, pid, serial_number, manufacturer: None, product: None };
        SerialPortInfo { port_name: name.to_owned(), port_type: SerialPortType::UsbPort(usb) }
    }

    fn chosen(ports: &[SerialPortInfo], answer: Option<&str>) -> (Result<String, String>, String) {
        let mut asked = Vec::new();
        let name_of = |port: &str| (port == "/dev/ttyACM5").then(|| "arm".to_owned());
        let answer = answer.map(|typed| || Some(typed.to_owned()));
        let chosen = choose(ports.to_vec(), answer, &mut asked, name_of);
        let told = chosen.map(|one| one.port).map_err(|failure| failure.to_string());
        (told, String::from_utf8(asked).unwrap())
    }

    #[test]
    fn the_only_gateway_is_taken_whatever_else_is_plugged_in() {
        let adapter = usb("/dev/ttyUSB0", 0x0403, 0x6001, None);
        let loader = usb("/dev/ttyACM9", ST_VENDOR, 0x374D, None);
        let built_in = SerialPortInfo {
            port_name: "/dev/ttyS0".to_owned(),
            port_type: SerialPortType::Unknown,
        };
        let others = [adapter, loader, built_in];
        for (vid, pid) in [GATEWAY, (ST_VENDOR, 0x374B), (ST_VENDOR, 0x374E)] {
            let mut ports = others.to_vec();
            ports.insert(1, usb("/dev/ttyACM0", vid, pid, None));
            let (told, asked) = chosen(&ports, Some("9\n"));
            assert_eq!((told.as_deref(), asked.as_str()), (Ok("/dev/ttyACM0"), ""));
        }
        let text = chosen(&others, None).0.unwrap_err();
        assert!(text.contains("other serial ports: /dev/ttyUSB0, /dev/ttyACM9, /dev/ttyS0"));
        // macOS names each port twice.
        let twice =
            ["/dev/tty.usbmodem1", "/dev/cu.usbmodem1"].map(|name| usb(name, 0x1209, 1, None));
        assert_eq!(chosen(&twice, None).0.as_deref(), Ok("/dev/cu.usbmodem1"));
    }

    #[test]
    fn a_gateway_is_shown_and_found_by_its_name() {
        let ports =
            [5, 6].map(|number| usb(&format!("/dev/ttyACM{number}"), 0x1209, 1, None)).to_vec();
        let (_, asked) = chosen(&ports, Some("1\n"));
        assert!(asked.contains("  1  /dev/ttyACM5  arm, a gateway's own USB\n"), "{asked}");
        let name_of = |port: &str| Some(if port.ends_with('5') { "arm" } else { "leg" }.to_owned());
        let of = |name| called(name, ports.clone(), name_of);
        assert_eq!(of("leg").as_deref(), Some("/dev/ttyACM6"));
        assert_eq!(of("head"), None);
        assert_eq!(of("/dev/ttyACM5"), None);
        let mut with_com = ports.clone();
        with_com.push(usb("COM3", 0x1209, 1, None));
        assert_eq!(called("COM3", with_com, |_| Some("COM3".to_owned())), None);
    }

    #[test]
    fn of_several_one_is_chosen_or_all_are_named() {
        let ports = [
            usb("/dev/ttyACM1", ST_VENDOR, 0x374B, Some("0669")),
            usb("/dev/ttyACM0", 0x1209, 1, None),
        ];
        let (told, asked) = chosen(&ports, Some("2\n"));
        assert_eq!(told.as_deref(), Ok("/dev/ttyACM1"));
        assert_eq!(
            asked,
            "Several ports may lead to a gateway:\n  1  /dev/ttyACM0  a gateway's own USB\n  2  \
             /dev/ttyACM1  an ST-LINK, serial number 0669\nWhich one? "
        );
        for wrong in ["0\n", "3\n", "\n", "", "one\n"] {
            assert!(chosen(&ports, Some(wrong)).0.unwrap_err().contains("none of them"), "{wrong}");
        }
        let (told, asked) = chosen(&ports, None);
        assert_eq!(asked, "", "nobody is asked who is not there");
        assert!(told.unwrap_err().contains(
            "/dev/ttyACM0 (a gateway's own USB), /dev/ttyACM1 (an ST-LINK, serial number 0669). \
             Name one with --port"
        ));
    }
}
