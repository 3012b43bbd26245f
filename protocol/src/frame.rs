//! The frame on the wire: a plain struct, never an enum read straight from memory that another process wrote.

use crate::Vec2;
use crate::ids::DroneId;
use crate::link_faults::LinkFaults;
use crate::time::Tick;
use bytemuck::{Pod, Zeroable};

/// Bytes of payload in a frame; the largest is an obstacle of 16 vertices.
pub const FRAME_PAYLOAD: usize = 304;

/// What a drone hands to its radio. Decode with [`crate::Message::decode`].
#[repr(C, align(8))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Frame {
    /// A [`crate::message::Topic`], if it is one.
    pub kind: u16,
    /// [`crate::payload::VERSION`].
    pub version: u16,
    /// Bytes of payload in use.
    pub len: u32,
    /// The payload; zero past `len`.
    pub payload: [u8; FRAME_PAYLOAD],
}

/// A frame on the air, as the world stamps it. The stamp is for the receivers' radios alone: no pilot sees it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AirFrame {
    /// Tick in which it was sent.
    pub tick: Tick,
    /// Who sent it.
    pub source: DroneId,
    /// Running number of the source's frames in this mission, from 0.
    pub sequence: u32,
    /// True position of the sender when it sent, m.
    pub position_m: [f64; 2],
    /// How long it waited for the channel and took it, ns; [`crate::radio::NEVER_TRANSMITTED`] if it was not sent at all.
    pub queue_ns: u64,
    /// The sender's radio when it sent.
    pub link_faults: LinkFaults,
    /// What was sent.
    pub frame: Frame,
}

impl AirFrame {
    /// True position of the sender, m.
    #[must_use]
    pub fn position(&self) -> Vec2 {
        Vec2::new(self.position_m[0], self.position_m[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Message;
    use crate::ids::ObstacleId;
    use crate::message::DecodeError;
    use crate::payload::{self, Obstacle};
    use crate::shape::ConvexShape;
    use proptest::prelude::*;

    fn obstacle() -> Message {
        let shape = ConvexShape::rectangle(Vec2::new(1.0, 2.0), Vec2::new(3.0, 4.0), 0.1).unwrap();
        Message::Obstacle(Obstacle { shape, id: ObstacleId(7), witness: DroneId(2) })
    }

    #[test]
    fn a_message_survives_the_wire() {
        assert_eq!(Message::decode(&obstacle().encode()), Ok(obstacle()));
    }

    #[test]
    fn what_is_wrong_with_a_frame_is_named() {
        let good = obstacle().encode();
        assert_eq!(Message::decode(&Frame { kind: 99, ..good }), Err(DecodeError::Kind(99)));
        assert_eq!(Message::decode(&Frame { version: 9, ..good }), Err(DecodeError::Version(9)));
        assert_eq!(Message::decode(&Frame { len: 8, ..good }), Err(DecodeError::Length(8, size_of::<Obstacle>())));
        let mut nan = good;
        nan.payload[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(Message::decode(&nan), Err(DecodeError::Field("shape")));
        let mut far = good;
        far.payload[..8].copy_from_slice(&1e10f64.to_le_bytes());
        assert_eq!(Message::decode(&far), Err(DecodeError::Field("shape")));
        let group = crate::GroupId([0, 0, 3, 0, 0, 0, 0, 0]);
        let lost = Message::Assignment(payload::Assignment { group, ..bytemuck::Zeroable::zeroed() });
        assert_eq!(Message::decode(&lost.encode()), Err(DecodeError::Field("group")));
    }

    proptest! {
        #[test]
        fn rubbish_never_panics(kind in 0u16..9, len in 0u32..400, bytes in prop::collection::vec(any::<u8>(), FRAME_PAYLOAD)) {
            let mut frame = Frame { kind, version: payload::VERSION, len, payload: [0; FRAME_PAYLOAD] };
            frame.payload.copy_from_slice(&bytes);
            if let Ok(message) = Message::decode(&frame) {
                let again = message.encode();
                prop_assert_eq!(&again.payload[..len as usize], &frame.payload[..len as usize]);
            }
        }
    }
}
