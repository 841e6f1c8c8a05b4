//! Bytes in both directions, in packets of every kind, as fast as the bus carries them.

use std::time::Duration;

use host_protocol::CanFrame;
use virtual_board::board::Board;
use virtual_stm32::usb::host::Errors;

use crate::rig::{BUS, Rig, ping, pings};

on_each_board!(
    the_information_is_the_same_over_usb,
    transfers_of_each_size_arrive_whole,
    an_empty_packet_is_nothing,
    replies_of_each_size_arrive_whole,
    both_directions_at_full_rate,
);

/// What `mgw info` asks for.
fn the_information_is_the_same_over_usb(board: Board) {
    let rig = Rig::connected(board);
    let over_usb = rig.client().info().expect("information");
    let over_uart = rig.uart().info().expect("information");
    assert_eq!(over_usb.board, board.name());
    assert_eq!(
        (&over_usb.firmware, &over_usb.build_id),
        (&over_uart.firmware, &over_uart.build_id)
    );
    assert_eq!(over_usb.buses, over_uart.buses);
}

/// A frame in packets of 1 byte, and at the end of transfers of 63, 64, 65 and 512 bytes.
fn transfers_of_each_size_arrive_whole(board: Board) {
    let rig = Rig::connected(board);
    let mut sequence = 0;
    for byte in ping(sequence) {
        rig.machine.borrow_mut().usb().send_packet(&[byte]);
    }
    rig.run_for(Duration::from_millis(10));
    assert_eq!(rig.answers(), [0], "in packets of a byte");
    for size in [63, 64, 65, 512] {
        // One request, as a reply waits for no other; in front of it frames that nobody
        // understands.
        sequence += 1;
        let request = ping(sequence);
        let mut transfer = vec![0xAA; size - request.len()];
        transfer.extend(request);
        rig.machine.borrow_mut().usb().send(&transfer);
        rig.run_for(Duration::from_millis(10));
        assert_eq!(rig.answers(), [sequence], "{size} bytes");
    }
    assert_eq!(rig.machine.borrow_mut().usb().errors(), Errors::default());
}

fn an_empty_packet_is_nothing(board: Board) {
    let rig = Rig::connected(board);
    {
        let mut machine = rig.machine.borrow_mut();
        let frame = ping(1);
        let (head, tail) = frame.split_at(5);
        for packet in [&[], head, &[], &[], tail, &[]] {
            machine.usb().send_packet(packet);
        }
        machine.run_for(Duration::from_millis(10));
        assert_eq!(machine.usb().unsent(), 0);
    }
    assert_eq!(rig.answers(), [1]);
}

/// A reply grows byte by byte with the raw frames that it carries. One that fills its last packet
/// is followed by an empty one, and no other is.
fn replies_of_each_size_arrive_whole(board: Board) {
    let rig = Rig::connected(board);
    let mut client = rig.client();
    client.raw_open(BUS).expect("open");
    let mut sizes = Vec::new();
    for (sequence, bytes) in (0x4000..).zip(0..=48) {
        {
            let mut machine = rig.machine.borrow_mut();
            let at = machine.now();
            for frame in 0..6 {
                let length = usize::min(8, usize::saturating_sub(bytes, 8 * frame));
                let frame = CanFrame::standard(0x7F0, &[0xAB; 8][..length]).expect("a frame");
                machine.node(rig.probe).send(at, &frame);
            }
            machine.run_for(Duration::from_millis(2));
            machine.usb().take();
        }
        let mut machine = rig.machine.borrow_mut();
        let request =
            host_protocol::Request::RawReceive(host_protocol::requests::RawReceive { bus: BUS });
        machine.usb().send(&crate::rig::frame(&request, sequence));
        machine.run_for(Duration::from_millis(2));
        let packets = machine.usb().take_packets();
        let lengths: Vec<usize> = packets.iter().map(|packet| packet.data.len()).collect();
        let size: usize = lengths.iter().sum();
        let mut expected = vec![64; size / 64];
        expected.push(size % 64);
        assert_eq!(lengths, expected);
        let reply: Vec<u8> = packets.into_iter().flat_map(|packet| packet.data).collect();
        assert_eq!(reply.iter().filter(|byte| **byte == 0).count(), 2, "a whole frame");
        assert_eq!((reply.first(), reply.last()), (Some(&0), Some(&0)), "a whole frame");
        sizes.push(size);
    }
    for size in [63, 64, 65] {
        assert!(sizes.contains(&size), "{sizes:?}");
    }
}

/// Two hundred packets of pings; then a request for each reply. Replies that nobody waits for may
/// be replaced by later ones.
fn both_directions_at_full_rate(board: Board) {
    let rig = Rig::connected(board);
    let (transfer, _) = pings(64 * 200, 0);
    rig.machine.borrow_mut().usb().send(&transfer);
    let limit = Duration::from_millis(300);
    let sent = rig.machine.borrow_mut().run_until(limit, |machine| machine.usb().unsent() == 0);
    rig.run_for(Duration::from_millis(5));
    let answered = rig.answers();
    assert!(sent, "the board takes what comes");
    assert!(answered.is_sorted() && answered.len() > 200, "{answered:?}");
    let mut client = rig.client();
    let begin = rig.now();
    for _ in 0..100 {
        client.info().expect("information");
    }
    assert!(rig.now() - begin < Duration::from_millis(200), "a round trip takes less than 2 ms");
    assert_eq!(client.losses(), mgw_client::Losses::default());
    assert_eq!(rig.machine.borrow_mut().usb().errors(), Errors::default());
    let log = rig.log();
    assert!(log.iter().all(|line| line == "INFO host link 2: hello"), "{log:?}");
}
