//! Why a port that is there cannot be used.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use mgw_client::{ClientError, ConnectError};

use crate::failure::Failure;

/// The rule that gives the ports to who sits at the computer.
const RULE: &str = include_str!("../../../udev/60-motor-gateway.rules");
const RULE_FILE: &str = "/etc/udev/rules.d/60-motor-gateway.rules";

/// The failure to open a port, with its reason where the system tells it.
pub fn explain(error: ConnectError) -> Failure {
    let port = |name, text| Failure::Port { name, text };
    if let ConnectError::Server { path, source } = &error
        && source.kind() == ErrorKind::PermissionDenied
    {
        let text = format!(
            "you may not open {path}. The socket is its user's own: run as the user who started \
                `mgw serve`, or use its TCP port"
        );
        return port("NoPermission", text);
    }
    let ConnectError::Serial { device, source, .. } = &error else { return error.into() };
    if source.kind() == ErrorKind::PermissionDenied {
        return port("NoPermission", no_permission(device));
    }
    match users(Path::new(device)).as_slice() {
        [] => error.into(),
        users => port(
            "PortInUse",
            format!("{device} is in use by {}. End that, then try again", users.join(" and ")),
        ),
    }
}

/// Of a port that opens, and behind which nothing answers.
pub fn not_a_gateway(port: &str, failure: Failure) -> Failure {
    match failure {
        Failure::Client(ClientError::NoAnswer { request: "Hello", after }) => Failure::Port {
            name: "NoAnswer",
            text: format!(
                "no gateway answered at {port} within {} ms. Check that this is its port, that it \
                    has power and the firmware of a gateway, and the bit rate",
                after.as_millis()
            ),
        },
        other => other,
    }
}

fn no_permission(device: &str) -> String {
    let rules = RULE.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    format!(
        "you may not open {device}. On Linux write these lines into {RULE_FILE}, then run `sudo \
            udevadm control --reload && sudo udevadm trigger`:\n{}\nA port that is no gateway's \
            and no ST-LINK's needs your user in the group that owns it, often dialout",
        rules.collect::<Vec<_>>().join("\n")
    )
}

/// The programs that have a device open, as far as Linux tells this user: `minicom (process 123)`.
fn users(device: &Path) -> Vec<String> {
    let Ok(device) = device.canonicalize() else { return Vec::new() };
    let own = std::process::id().to_string();
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter_map(|process| {
            let number = process.file_name().into_string().ok()?;
            let is_other = number != own && number.bytes().all(|byte| byte.is_ascii_digit());
            let mut files = fs::read_dir(process.path().join("fd")).ok().filter(|_| is_other)?;
            let is_user = files.any(|file| {
                file.and_then(|file| fs::read_link(file.path())).is_ok_and(|path| path == device)
            });
            let name = fs::read_to_string(process.path().join("comm")).ok().filter(|_| is_user)?;
            Some(format!("{} (process {number})", name.trim()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_may_not_open_a_socket_is_told_whose_it_is() {
        let path = "/run/user/1000/mgw.sock".to_owned();
        let source = ErrorKind::PermissionDenied.into();
        let failure = explain(ConnectError::Server { path, source });
        let text = failure.to_string();
        assert_eq!(failure.name(), "NoPermission");
        assert!(text.starts_with("you may not open /run/user/1000/mgw.sock."), "{text}");
        assert!(text.contains("the user who started `mgw serve`"), "{text}");
    }

    #[test]
    fn who_may_not_open_a_port_gets_the_rule_that_lets_them() {
        let error = ConnectError::Serial {
            device: "/dev/ttyACM0".to_owned(),
            baud: 921_600,
            source: ErrorKind::PermissionDenied.into(),
        };
        let failure = explain(error);
        let text = failure.to_string();
        assert_eq!(failure.name(), "NoPermission");
        assert!(text.starts_with("you may not open /dev/ttyACM0."), "{text}");
        for said in [RULE_FILE, r#"ATTRS{idVendor}=="1209""#, r#"=="0483""#, "udevadm trigger"] {
            assert!(text.contains(said), "{text}");
        }
        assert!(!text.contains("\n#"), "{text}");
    }
}
