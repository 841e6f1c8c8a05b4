//! At which rates buses and motors run, and who shares a bus.

use crate::bench::{self, answered, hello, native};
use crate::rig::Rig;
use host_protocol::{Error, Protocol, ProtocolSet, Reply, Request, requests};

fn configure(rig: &mut Rig, bitrate: u32, protocols: &[Protocol]) -> Result<Reply, Error> {
    rig.ask(Request::ConfigureBus(requests::ConfigureBus {
        bus: 1,
        bitrate,
        protocols: ProtocolSet::of(protocols),
        exclusive: false,
        reply_window_us: 5_000,
    }))
}

#[test]
fn a_rate_that_the_board_has_not_is_refused_with_those_it_has() {
    let mut rig = Rig::new();
    hello(&mut rig);
    let offered = [1_000_000, 500_000, 210_526, 0, 0, 0, 0, 0];
    let expected = Error::BitrateNotOffered { bus: 1, bitrate: 333_000, offered };
    assert_eq!(configure(&mut rig, 333_000, &[Protocol::Thruster]), Err(expected));
    assert_eq!(
        expected.to_string(),
        "bus 1 cannot run at 333000 bit/s; it offers 1000000, 500000, 210526"
    );
}

/// Thruster manual §2.2: CB carries kbit/s; 83 stands for 83.33.
#[test]
fn cb_to_a_rate_that_no_bus_here_has_is_refused_before_it_is_sent() {
    let (mut rig, _) = bench::thruster();
    // Of the board's rates 210526 is none of CB's.
    let offered = [1_000_000, 500_000, 0, 0, 0, 0, 0, 0];
    for (kilobits, bitrate) in [
        ("0320", 800_000),
        ("029A", 666_000),
        ("0190", 400_000),
        ("014D", 333_000),
        ("00FA", 250_000),
        ("00C8", 200_000),
        ("0096", 150_000),
        ("007D", 125_000),
        ("0064", 100_000),
        ("0053", 83_333),
        ("0050", 80_000),
        ("0042", 66_666),
        ("0032", 50_000),
        ("0028", 40_000),
        ("0021", 33_333),
        ("0014", 20_000),
        ("000A", 10_000),
    ] {
        let request = native(&rig, 0, &format!("434200000000{kilobits}"));
        assert_eq!(
            rig.ask(request),
            Err(Error::BitrateNotOffered { bus: 0, bitrate, offered }),
            "{kilobits}"
        );
    }
    assert!(!rig.wire.iter().any(|(_, _, text)| text.starts_with("30B#4342")));
    for data in ["43420000000003E8", "43420000000001F4"] {
        let request = native(&rig, 0, data);
        assert_eq!(answered(rig.ask(request)), data);
    }
}
