//! Motors that answer well, so that the gateway's axes get to move.

use gateway::Outgoing;
use host_protocol::CanFrame;

use crate::d5::set_right;
use crate::rmd::serial_frame;

/// What a motor answers.
pub enum Reply {
    Can(CanFrame),
    Serial(Vec<u8>),
}

/// What the addressed motor answers to a frame, if it is one of ours: RMD nodes on 0x141..,
/// thrusters on 0x301.., D5 motors below.
pub fn reply_to(frame: &Outgoing) -> Option<Reply> {
    let frame = match frame {
        Outgoing::Serial(bytes) => {
            let [_, id, _, data @ .., _, _] = <[u8; 13]>::try_from(bytes.as_slice()).ok()?;
            return Some(Reply::Serial(serial_frame(id, rmd(data)).to_vec()));
        }
        Outgoing::Can(frame) => frame,
    };
    let embedded_can::Id::Standard(id) = frame.id() else { return None };
    let data = frame.data();
    let reply = match id.as_raw() {
        id @ 0x141..=0x160 => CanFrame::standard(id + 0x100, &rmd(data.try_into().ok()?)),
        id @ 0x301..=0x37F => {
            let mut padded = [0; 8];
            padded.get_mut(..data.len())?.copy_from_slice(data);
            CanFrame::standard(id - 0x80, &padded)
        }
        id @ 0x001..=0x0FD => {
            let mut data: [u8; 8] = data.try_into().ok()?;
            // Acknowledgement level and timeout switch as from the factory, all else 0.
            if let [_, _, _, 2, register, low, high, _] = &mut data {
                *high = 0;
                *low = match *register {
                    0x10 => 2,
                    0x11 => 1,
                    _ => 0,
                };
            }
            CanFrame::standard(id, &set_right(0x5D, data))
        }
        _ => None,
    };
    reply.map(Reply::Can)
}

fn rmd(data: [u8; 8]) -> [u8; 8] {
    match data[0] {
        // 50 °C, brake released, 48.5 V, no fault.
        0x9A => [0x9A, 0x32, 0, 1, 0xE5, 0x01, 0, 0],
        command @ (0x9C | 0xA1..=0xA8) => [command, 0x32, 0x64, 0, 0, 0, 0x2D, 0],
        _ => data,
    }
}
