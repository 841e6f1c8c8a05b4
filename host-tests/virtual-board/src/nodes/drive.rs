//! Changing a peer between two runs where it has to know the time: what it does next may come
//! earlier by that.

use rigless::chip::{Timeline, can};

use super::instant;
use crate::machine::{CanNode, Line, Machine};
use virtual_stm32::serial_port::FarEnd;

impl Machine {
    /// Changes a node of a CAN bus now.
    pub fn drive_node<P: can::Peer, T>(
        &mut self,
        node: CanNode<P>,
        change: impl FnOnce(&mut P, &mut Timeline<'_, '_>) -> T,
    ) -> T {
        let (at, port) = (instant(self.now()), node.port().index());
        self.part_mut().drive_fdcan(port, at, |fdcan, _, context| {
            change(fdcan.nodes_mut()[node.index()].peer_mut(), &mut Timeline::new(context))
        })
    }

    /// Changes the far end of a serial line now.
    pub fn drive_line<P: FarEnd, T>(
        &mut self,
        line: Line<P>,
        change: impl FnOnce(&mut P, &mut Timeline<'_, '_>) -> T,
    ) -> T {
        let (at, name) = (instant(self.now()), self.board().serial_name(line.port()));
        let answer = self.part_mut().drive_serial(name, at, |port, registers, context| {
            port.drive(registers, context, change)
        });
        answer.expect("the far end that was hung here")
    }
}
