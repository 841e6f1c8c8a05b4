//! The receive FIFOs, dedicated buffers, priority, remote frames.

use rigless::chip::can::{Frame, Id};
use rigless::soc::stm32h743::generated::fdcan1::Register;

use super::bench::{
    Bench, ELEMENT, MBIT, MICROSECOND, QUEUE_OF_3, RX_BUFFERS, RX_FIFO_0, RX_FIFO_1,
    STANDARD_FILTERS, short_frame, standard,
};

/// A controller on the bus with these standard filters, and a node.
fn with_filters(filters: &[u32], gfc: u32) -> (Bench, usize) {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    let count = u32::try_from(filters.len()).unwrap();
    bench.write(Register::FdcanSidfc, count << 16);
    bench.write(Register::FdcanGfc, gfc);
    for (index, word) in filters.iter().enumerate() {
        assert!(bench.ram.set_word(STANDARD_FILTERS + index, *word));
    }
    bench.join();
    let node = bench.attach(&[]);
    (bench, node)
}

fn receive(bench: &mut Bench, node: usize, frame: Frame) {
    bench.offer(node, frame);
    bench.run_for(140 * MICROSECOND);
}

#[test]
fn a_frame_lies_in_fifo_0_until_it_is_acknowledged() {
    let (mut bench, node) = with_filters(&[], 0);
    bench.write(Register::FdcanTscv, 0);
    receive(&mut bench, node, short_frame());
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0001, "RF0N");
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0001_0001);
    assert_eq!(bench.words(RX_FIFO_0, 3), [0x048C_0000, 0x8002_0000, 0x0000_CDAB]);
    assert_eq!(bench.node(node).outcomes(), [true]);
    bench.write(Register::FdcanRxf0a, 0x0000_0000);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0001_0100, "empty, get and put index 1");
    bench.write(Register::FdcanIr, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanIr), 0);
}

#[test]
fn it_is_valid_one_bit_before_its_end() {
    let (mut bench, node) = with_filters(&[], 0);
    bench.offer(node, short_frame());
    bench.run_for(61 * MICROSECOND - 1);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0);
    bench.run_for(1);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0001_0001);
    assert_eq!(bench.node(node).outcomes(), []);
    bench.run_for(MICROSECOND);
    assert_eq!(bench.node(node).outcomes(), [true]);
}

#[test]
fn a_full_fifo_keeps_the_old_and_says_what_it_lost() {
    let (mut bench, node) = with_filters(&[], 0);
    let mut flags = Vec::new();
    for byte in 0..4 {
        receive(&mut bench, node, standard(0x100, &[byte]));
        flags.push(bench.read(Register::FdcanIr));
        bench.write(Register::FdcanIr, 0x0000_0007);
    }
    // RF0N; with RF0W at the watermark of two; with RF0F; RF0L.
    assert_eq!(flags, [0x0000_0001, 0x0000_0003, 0x0000_0005, 0x0000_0008]);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0300_0003, "RF0L, full, three frames");
    let data: Vec<u32> =
        (0..3).map(|place| bench.words(RX_FIFO_0 + place * ELEMENT, 3)[2]).collect();
    assert_eq!(data, [0, 1, 2]);
    bench.write(Register::FdcanIr, 0x0000_0008);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0100_0003);
    bench.write(Register::FdcanRxf0a, 0x0000_0001);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0000_0201, "two read at once");
    receive(&mut bench, node, standard(0x100, &[9]));
    assert_eq!(bench.words(RX_FIFO_0, 3)[2], 9, "it goes round");
    assert_eq!(bench.node(node).outcomes(), [true; 5], "a lost frame is acknowledged all the same");
}

#[test]
fn an_overwriting_fifo_loses_the_oldest_and_says_nothing() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanRxf0c, 0x8002_0400); // two elements
    bench.join();
    let node = bench.attach(&[]);
    for byte in 0..3 {
        receive(&mut bench, node, standard(0x100, &[byte]));
    }
    assert_eq!(bench.read(Register::FdcanIr) & 0x0000_0008, 0);
    assert_eq!(bench.read(Register::FdcanRxf0s), 0x0101_0102, "full, get and put index 1");
    let data: Vec<u32> =
        (0..2).map(|place| bench.words(RX_FIFO_0 + place * ELEMENT, 3)[2]).collect();
    assert_eq!(data, [2, 1]);
}

#[test]
fn a_fifo_without_elements_loses_everything() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanRxf0c, 0x0000_0400);
    bench.join();
    let node = bench.attach(&[]);
    receive(&mut bench, node, short_frame());
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0008);
}

#[test]
fn a_filter_sends_frames_to_fifo_1_and_is_named_there() {
    // 0x200 → rejected; 0x100 to 0x1FF → FIFO 1; the rest is rejected.
    let (mut bench, node) = with_filters(&[0x5A00_0200, 0x1100_01FF], 0x0000_0028);
    for id in [0x200, 0x150, 0x300] {
        receive(&mut bench, node, standard(id, &[1, 2, 3, 4, 5]));
    }
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0010, "RF1N");
    assert_eq!(bench.read(Register::FdcanRxf0s), 0);
    assert_eq!(bench.read(Register::FdcanRxf1s), 0x0001_0001);
    let words = bench.words(RX_FIFO_1, 4);
    assert_eq!(
        [words[0], words[1] & 0xFFFF_0000],
        [0x0540_0000, 0x0105_0000],
        "filter 1, five bytes"
    );
    assert_eq!([words[2], words[3]], [0x0403_0201, 0x0000_0005]);
    bench.write(Register::FdcanRxf1a, 0);
    assert_eq!(bench.read(Register::FdcanRxf1s), 0x0001_0100);
}

#[test]
fn dedicated_buffers_say_which_of_them_have_new_data() {
    // 0x123 → buffer 3, 0x124 → buffer 33.
    let (mut bench, node) = with_filters(&[0x3923_0003, 0x3924_0021], 0x0000_0028);
    receive(&mut bench, node, short_frame());
    receive(&mut bench, node, standard(0x124, &[7]));
    assert_eq!(bench.read(Register::FdcanIr), 0x0008_0000, "DRX");
    assert_eq!(bench.read(Register::FdcanNdat1), 0x0000_0008);
    assert_eq!(bench.read(Register::FdcanNdat2), 0x0000_0002);
    assert_eq!(bench.words(RX_BUFFERS + 3 * ELEMENT, 3)[2], 0x0000_CDAB);
    assert_eq!(bench.words(RX_BUFFERS + 33 * ELEMENT, 3)[2], 0x0000_0007);
    receive(&mut bench, node, standard(0x123, &[0xEE]));
    assert_eq!(bench.words(RX_BUFFERS + 3 * ELEMENT, 3)[2], 0x0000_CDAB, "locked until it is read");
    bench.write(Register::FdcanNdat1, 0x0000_0008);
    assert_eq!(bench.read(Register::FdcanNdat1), 0);
    receive(&mut bench, node, standard(0x123, &[0xEE]));
    assert_eq!(bench.words(RX_BUFFERS + 3 * ELEMENT, 3)[2], 0x0000_00EE);
}

#[test]
fn a_frame_of_priority_is_reported_where_it_went() {
    // 0x040: priority into FIFO 1; 0x041: priority alone.
    let (mut bench, node) = with_filters(&[0x7040_0040, 0x6041_0041], 0x0000_0000);
    receive(&mut bench, node, standard(0x040, &[]));
    assert_eq!(bench.read(Register::FdcanIr), 0x0000_0110, "HPM and RF1N");
    assert_eq!(bench.read(Register::FdcanHpms), 0x0000_00C0, "FIFO 1, element 0, filter 0");
    receive(&mut bench, node, standard(0x041, &[]));
    assert_eq!(bench.read(Register::FdcanHpms), 0x0000_0100, "nowhere, filter 1");
}

#[test]
fn extended_and_remote_frames_keep_their_format() {
    let (mut bench, node) = with_filters(&[], 0);
    receive(&mut bench, node, Frame::remote_frame(Id::Extended(0x1234_5678), 4));
    let words = bench.words(RX_FIFO_0, 2);
    assert_eq!([words[0], words[1] & 0xFFFF_0000], [0x7234_5678, 0x8004_0000]);
}

#[test]
fn an_element_beyond_the_ram_is_told() {
    let mut bench = Bench::configured(MBIT, QUEUE_OF_3);
    bench.write(Register::FdcanRxf0c, 0x0001_27FC); // word 2559
    bench.join();
    let node = bench.attach(&[]);
    receive(&mut bench, node, short_frame());
    assert_eq!(bench.told(), [("RXESC", "a frame beyond the end of the message RAM")]);
    assert_eq!(bench.read(Register::FdcanIr) & 0x0002_0000, 0x0002_0000, "MRAF");
}
