//! Reset values, and what INIT and CCE protect.

use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{Bench, MBIT, QUEUE_OF_3, short_frame};

#[test]
fn every_register_resets_to_its_value() {
    let mut bench = Bench::new();
    let not_zero = [
        (Register::FdcanCrel, 0x3214_1218),
        (Register::FdcanEndn, 0x8765_4321),
        (Register::FdcanDbtp, 0x0000_0A33),
        (Register::FdcanCccr, 0x0000_0001),
        (Register::FdcanNbtp, 0x0600_0A03),
        (Register::FdcanTocc, 0xFFFF_0000),
        (Register::FdcanTocv, 0x0000_FFFF),
        (Register::FdcanPsr, 0x0000_0707),
        (Register::FdcanXidam, 0x1FFF_FFFF),
    ];
    for register in Register::ALL {
        let expected =
            not_zero.iter().find(|(name, _)| *name == register).map_or(0, |(_, value)| *value);
        assert_eq!(bench.read(register), expected, "{register:?}");
    }
    assert_eq!(bench.told(), []);
}

#[test]
fn a_reset_of_the_controller_brings_them_back() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.send(0, &short_frame());
    bench.reset_line();
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanNbtp), 0x0600_0A03);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanIr), 0);
}

#[test]
fn configuration_needs_init_and_cce() {
    let mut bench = Bench::new();
    bench.write(Register::FdcanNbtp, MBIT);
    assert_eq!(bench.read(Register::FdcanNbtp), 0x0600_0A03, "CCE is clear");
    let refused = ("FDCAN_NBTP", "written without INIT and CCE, so it keeps what it holds");
    assert_eq!(bench.told(), [refused]);

    bench.write(Register::FdcanCccr, 0x0000_0003);
    bench.write(Register::FdcanNbtp, MBIT);
    assert_eq!(bench.read(Register::FdcanNbtp), MBIT);

    bench.write(Register::FdcanCccr, 0x0000_0000);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0000, "CCE goes with INIT");
    bench.write(Register::FdcanNbtp, 0x0600_0A03);
    assert_eq!(bench.read(Register::FdcanNbtp), MBIT);
    bench.write(Register::FdcanCccr, 0x0000_0003);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001, "CCE only after INIT");
}

#[test]
fn protected_bits_of_cccr_need_both_too() {
    let mut bench = Bench::new();
    bench.write(Register::FdcanCccr, 0x0000_4061); // TXP, DAR, MON
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001);
    bench.write(Register::FdcanCccr, 0x0000_0003);
    bench.write(Register::FdcanCccr, 0x0000_4063);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_4063);
    bench.write(Register::FdcanCccr, 0x0000_4061);
    bench.write(Register::FdcanCccr, 0x0000_0000);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_4040, "MON may be cleared at any time");
    assert_eq!(bench.told(), []);
}

#[test]
fn cce_clears_requests_and_states_and_keeps_the_configuration() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    let node = bench.attach(&[short_frame()]);
    bench.run_for(100_000);
    bench.silence(node, true);
    bench.send(0, &short_frame());
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0001_0001, "one frame, put index 1");
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001);
    bench.write(Register::FdcanCccr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0x0000_0001, "INIT alone keeps the request");
    bench.write(Register::FdcanCccr, 0x0000_0003);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0);
    assert_eq!(bench.read(Register::FdcanTxefs), 0);
    assert_eq!(bench.read(Register::FdcanRxf0c), 0x0203_0400);
    bench.write(Register::FdcanTxbar, 1);
    assert_eq!(bench.read(Register::FdcanTxbrp), 0, "no request while CCE is set");
    assert_eq!(bench.told(), [("FDCAN_TXBAR", "written while CCE is set")]);
}

#[test]
fn what_is_not_modelled_is_told() {
    let mut bench = Bench::new();
    bench.write(Register::FdcanCccr, 0x0000_0003);
    bench.write(Register::FdcanCccr, 0x0000_0183); // FDOE, TEST
    bench.write(Register::FdcanTest, 0x0000_0010); // LBCK
    bench.write(Register::FdcanTscc, 0x0000_0002);
    bench.write(Register::FdcanTocc, 0x0000_0001);
    bench.write(Register::FdcanRwd, 0x0000_0001);
    bench.write(Register::FdcanTtocf, 0x0000_0001);
    let expected = [
        ("CCCR", "CAN FD is not modelled"),
        ("CCCR", "test modes are not modelled"),
        ("TEST", "test modes are not modelled"),
        ("TSCC", "the external timestamp counter is not modelled"),
        ("TOCC", "the timeout counter is not modelled"),
        ("RWD", "the watchdog of the message RAM is not modelled"),
        ("FDCAN_TTOCF", "TTCAN is not modelled"),
    ];
    assert_eq!(bench.told(), expected);
}

#[test]
fn the_clock_can_be_asked_to_stop() {
    let mut bench = Bench::on_bus(MBIT, QUEUE_OF_3);
    bench.attach(&[]);
    bench.send(0, &short_frame());
    bench.write(Register::FdcanCccr, 0x0000_0010);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0010, "not while it has something to send");
    bench.run_for(100_000);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0019, "CSA and INIT");
    bench.write(Register::FdcanCccr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanCccr), 0x0000_0001);
}
