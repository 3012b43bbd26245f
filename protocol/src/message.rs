//! The messages that drones exchange, and how they are encoded in frames.
//!
//! Messages carry soft state: a drone repeats a message until a newer one supersedes it. Messages are idempotent, so they may be
//! lost, duplicated and reordered.

use crate::frame::{FRAME_PAYLOAD, Frame};
use crate::ids::GroupId;
use crate::payload::MAX_LISTED;
use crate::payload::{
    self, Arrivals, Assignment, AssignmentList, Leadership, Obstacle, Passed, Plan, Pose, Presence, Separation,
};
use crate::topic_name::OWN_TOPIC;
use crate::user_message::UserMessage;
use crate::wire::{ArrivalsKind, LeadershipKind, Phase, UnknownCode};
use bytemuck::Pod;
use std::mem::offset_of;

pub use crate::decode_error::{DecodeError, MAX_ABS};
pub use crate::topic::Topic;

/// A message, decoded and checked or about to be encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// A drone's state and the plan it obeys.
    Pose(Pose),
    /// An obstacle that a drone has sensed.
    Obstacle(Obstacle),
    /// A message of the leader election, such as a claim or a heartbeat.
    Leadership(Leadership),
    /// A leader's plan for its group.
    Plan(Plan),
    /// One drone's part in a plan.
    Assignment(Assignment),
    /// Parts of several drones in a plan, passed on.
    AssignmentList(AssignmentList),
    /// The times at which one member of a group can reach the gate of an obstacle set.
    Arrivals(Arrivals),
    /// A drone's notice that it has passed an obstacle set.
    Passed(Passed),
    /// The lines that separate a drone from others, and that it is bound to.
    Separation(Separation),
    /// The states of drones that the source has heard of.
    Presence(Presence),
    /// A message of a pilot's own.
    User(UserMessage),
}

impl Message {
    /// Number of the message's topic on the wire: that of a [`Topic`] or of a [`crate::TopicName`].
    #[must_use]
    pub fn kind(&self) -> u16 {
        let topic = match self {
            Self::Pose(_) => Topic::Pose,
            Self::Obstacle(_) => Topic::Obstacle,
            Self::Leadership(_) => Topic::Leadership,
            Self::Plan(_) => Topic::Plan,
            Self::Assignment(_) | Self::AssignmentList(_) => Topic::Assignment,
            Self::Arrivals(_) => Topic::Arrivals,
            Self::Passed(_) => Topic::Passed,
            Self::Separation(_) => Topic::Separation,
            Self::Presence(_) => Topic::Presence,
            Self::User(message) => return message.topic().kind(),
        };
        topic as u16
    }

    /// Encodes the message as a frame.
    #[must_use]
    #[inline]
    pub fn encode(&self) -> Frame {
        let bytes: &[u8] = match self {
            Self::Pose(payload) => bytemuck::bytes_of(payload),
            Self::Obstacle(payload) => bytemuck::bytes_of(payload),
            Self::Leadership(payload) => bytemuck::bytes_of(payload),
            Self::Plan(payload) => bytemuck::bytes_of(payload),
            Self::Assignment(payload) => bytemuck::bytes_of(payload),
            Self::AssignmentList(list) => {
                &bytemuck::bytes_of(list)[..AssignmentList::len_of(MAX_LISTED.min(list.count as usize))]
            }
            Self::Arrivals(payload) => bytemuck::bytes_of(payload),
            Self::Passed(payload) => bytemuck::bytes_of(payload),
            Self::Separation(payload) => bytemuck::bytes_of(payload),
            Self::Presence(payload) => bytemuck::bytes_of(payload),
            Self::User(message) => message.payload(),
        };
        let mut frame = Frame {
            kind: self.kind(),
            version: payload::VERSION,
            len: bytes.len() as u32,
            payload: [0; FRAME_PAYLOAD],
        };
        frame.payload[..bytes.len()].copy_from_slice(bytes);
        frame
    }

    /// Checks and copies the message in a frame that another process wrote.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame does not contain a valid message. No content of a frame causes a panic.
    pub fn decode(frame: &Frame) -> Result<Self, DecodeError> {
        MessageRef::read(frame).map(MessageRef::to_message)
    }
}

/// A message that is borrowed from a frame or from a [`Message`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MessageRef<'a> {
    /// See [`Message::Pose`].
    Pose(&'a Pose),
    /// See [`Message::Obstacle`].
    Obstacle(&'a Obstacle),
    /// See [`Message::Leadership`].
    Leadership(&'a Leadership),
    /// See [`Message::Plan`].
    Plan(&'a Plan),
    /// See [`Message::Assignment`].
    Assignment(&'a Assignment),
    /// See [`Message::AssignmentList`].
    AssignmentList(&'a AssignmentList),
    /// See [`Message::Arrivals`].
    Arrivals(&'a Arrivals),
    /// See [`Message::Passed`].
    Passed(&'a Passed),
    /// See [`Message::Separation`].
    Separation(&'a Separation),
    /// See [`Message::Presence`].
    Presence(&'a Presence),
    /// See [`Message::User`].
    User(&'a UserMessage),
}

impl<'a> From<&'a Message> for MessageRef<'a> {
    fn from(message: &'a Message) -> Self {
        match message {
            Message::Pose(payload) => Self::Pose(payload),
            Message::Obstacle(payload) => Self::Obstacle(payload),
            Message::Leadership(payload) => Self::Leadership(payload),
            Message::Plan(payload) => Self::Plan(payload),
            Message::Assignment(payload) => Self::Assignment(payload),
            Message::AssignmentList(payload) => Self::AssignmentList(payload),
            Message::Arrivals(payload) => Self::Arrivals(payload),
            Message::Passed(payload) => Self::Passed(payload),
            Message::Separation(payload) => Self::Separation(payload),
            Message::Presence(payload) => Self::Presence(payload),
            Message::User(message) => Self::User(message),
        }
    }
}

impl<'a> MessageRef<'a> {
    /// Checks and borrows the message in a frame that another process wrote.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame does not contain a valid message. No content of a frame causes a panic.
    #[inline]
    pub fn read(frame: &'a Frame) -> Result<Self, DecodeError> {
        let message = Self::borrow(frame)?;
        message.check()?;
        Ok(message)
    }

    /// Borrows the message in a frame whose values [`MessageRef::read`] has checked before.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame does not contain a message. The values in the message can be any: no content of a frame causes
    /// undefined behaviour.
    #[inline]
    pub fn borrow(frame: &'a Frame) -> Result<Self, DecodeError> {
        if frame.version != payload::VERSION {
            return Err(DecodeError::Version(frame.version));
        }
        if frame.kind & OWN_TOPIC != 0 {
            return UserMessage::read(frame).map(Self::User);
        }
        Ok(match Topic::from_wire(frame.kind).ok_or(DecodeError::Kind(frame.kind))? {
            Topic::Pose => Self::Pose(read(frame)?),
            Topic::Obstacle => Self::Obstacle(read(frame)?),
            Topic::Leadership => Self::Leadership(read(frame)?),
            Topic::Plan => Self::Plan(read(frame)?),
            // A list is longer than a single assignment, even if it has one entry.
            Topic::Assignment if frame.len as usize > size_of::<Assignment>() => {
                Self::AssignmentList(read_list(frame)?)
            }
            Topic::Assignment => Self::Assignment(read(frame)?),
            Topic::Arrivals => Self::Arrivals(read(frame)?),
            Topic::Passed => Self::Passed(read(frame)?),
            Topic::Separation => Self::Separation(read(frame)?),
            Topic::Presence => Self::Presence(read(frame)?),
        })
    }

    /// Copies the message.
    #[must_use]
    pub fn to_message(self) -> Message {
        match self {
            Self::Pose(payload) => Message::Pose(*payload),
            Self::Obstacle(payload) => Message::Obstacle(*payload),
            Self::Leadership(payload) => Message::Leadership(*payload),
            Self::Plan(payload) => Message::Plan(*payload),
            Self::Assignment(payload) => Message::Assignment(*payload),
            Self::AssignmentList(payload) => Message::AssignmentList(*payload),
            Self::Arrivals(payload) => Message::Arrivals(*payload),
            Self::Passed(payload) => Message::Passed(*payload),
            Self::Separation(payload) => Message::Separation(*payload),
            Self::Presence(payload) => Message::Presence(*payload),
            Self::User(message) => Message::User(*message),
        }
    }

    fn check(&self) -> Result<(), DecodeError> {
        let finite = |values: &[f64], name| {
            if values.iter().all(|v| v.abs() <= MAX_ABS) { Ok(()) } else { Err(DecodeError::Field(name)) }
        };
        let bounded_or_never = |value: f64, name| if value == f64::INFINITY { Ok(()) } else { finite(&[value], name) };
        let below = |value: u32, limit: u32, name| if value < limit { Ok(()) } else { Err(DecodeError::Field(name)) };
        let lineage = |group: GroupId| if group.is_lineage() { Ok(()) } else { Err(DecodeError::Field("group")) };
        let set_limit = payload::MAX_SET as u32 + 1;
        match self {
            Self::Pose(p) => {
                lineage(p.group)?;
                finite(&p.position_m, "position")?;
                finite(&p.velocity_mps, "velocity")?;
                p.queue.iter().try_for_each(|place| finite(&[place.remaining_m], "remaining path"))
            }
            Self::Obstacle(o) => {
                o.shape.check().map_err(|_| DecodeError::Field("shape"))?;
                let (low, high) = o.shape.bounds();
                finite(&[low.x, low.y, high.x, high.y], "shape")
            }
            Self::Leadership(l) => {
                lineage(l.group)?;
                known(LeadershipKind::from_wire(l.kind.into()))
            }
            Self::Plan(p) => {
                lineage(p.group)?;
                finite(&p.anchor_m, "anchor")?;
                finite(&p.anchor_mps, "anchor velocity")?;
                bounded_or_never(p.anchor_stop_x_m, "anchor stop")?;
                // A plan that predicts nothing has no number there.
                if !p.predicted_s.is_nan() {
                    finite(&[p.predicted_s], "prediction")?;
                }
                known(Phase::from_wire(p.phase))?;
                below(p.course, 4, "course")?;
                below(p.set_count, set_limit, "obstacle count")
            }
            Self::Assignment(a) => {
                lineage(a.scope)?;
                lineage(a.group)?;
                finite(&a.slot_m, "slot")?;
                finite(&[a.arrival_s], "arrival")
            }
            Self::AssignmentList(a) => {
                lineage(a.scope)?;
                lineage(a.group)?;
                a.assignments().try_for_each(|part| {
                    finite(&part.slot_m, "slot")?;
                    finite(&[part.arrival_s], "arrival")
                })
            }
            Self::Arrivals(a) => {
                lineage(a.group)?;
                known(ArrivalsKind::from_wire(a.kind))?;
                below(a.routes, payload::MAX_ROUTES as u32 + 1, "route count")?;
                a.gate_s.iter().try_for_each(|&gate_s| bounded_or_never(gate_s.into(), "arrival"))
            }
            Self::Passed(p) => below(p.set_count, set_limit, "obstacle count"),
            Self::Presence(p) => {
                lineage(p.group)?;
                below(p.count, payload::MAX_PRESENT as u32 + 1, "drone count")?;
                p.poses().try_for_each(|(_, pose)| {
                    finite(&pose.position_m, "position")?;
                    finite(&pose.velocity_mps, "velocity")
                })
            }
            Self::Separation(s) => {
                below(s.count, payload::MAX_SEPARATORS as u32 + 1, "separator count")?;
                s.separators().iter().try_for_each(|separator| {
                    let motion = [separator.angle_rad, separator.speed_mps, separator.deceleration_mps2].map(f64::from);
                    finite(&[separator.stop_m], "separator")?;
                    finite(&motion, "separator")
                })
            }
            // Checked when it is read: only the name has rules.
            Self::User(_) => Ok(()),
        }
    }
}

fn known<T>(code: Result<T, UnknownCode>) -> Result<(), DecodeError> {
    code.map(|_| ()).map_err(|unknown| DecodeError::Field(unknown.what))
}

#[inline]
fn read<T: Pod>(frame: &Frame) -> Result<&T, DecodeError> {
    const {
        assert!(size_of::<T>() <= FRAME_PAYLOAD, "a payload must fit a frame");
        assert!(align_of::<T>() <= align_of::<Frame>() && offset_of!(Frame, payload) % align_of::<T>() == 0);
    };
    if frame.len as usize != size_of::<T>() {
        return Err(DecodeError::Length(frame.len, size_of::<T>()));
    }
    Ok(bytemuck::from_bytes(&frame.payload[..size_of::<T>()]))
}

/// A list is as long as its entries in use. The other entries are 0.
fn read_list(frame: &Frame) -> Result<&AssignmentList, DecodeError> {
    const { assert!(size_of::<AssignmentList>() == FRAME_PAYLOAD, "a list fills a frame") };
    let list: &AssignmentList = bytemuck::from_bytes(&frame.payload);
    if !(1..=MAX_LISTED as u32).contains(&list.count) {
        return Err(DecodeError::Field("assignment count"));
    }
    let len = AssignmentList::len_of(list.count as usize);
    if frame.len as usize != len {
        return Err(DecodeError::Length(frame.len, len));
    }
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec2;
    use crate::ids::{DroneId, ObstacleId};
    use crate::shape::ConvexShape;
    use proptest::prelude::*;

    fn obstacle() -> Message {
        let shape = ConvexShape::rectangle(Vec2::new(1.0, 2.0), Vec2::new(3.0, 4.0), 0.1).unwrap();
        Message::Obstacle(Obstacle { shape, id: ObstacleId(7), witness: DroneId(2) })
    }

    #[test]
    fn a_decoded_message_equals_the_encoded_one() {
        assert_eq!(Message::decode(&obstacle().encode()), Ok(obstacle()));
    }

    #[test]
    fn a_frame_is_borrowed_without_a_look_at_its_values() {
        let mut frame = Message::Pose(bytemuck::Zeroable::zeroed()).encode();
        assert_eq!(MessageRef::borrow(&frame), MessageRef::read(&frame));
        frame.payload[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(MessageRef::read(&frame), Err(DecodeError::Field("position")));
        assert!(matches!(MessageRef::borrow(&frame), Ok(MessageRef::Pose(pose)) if pose.position_m[0].is_nan()));
        frame.len += 1;
        assert!(MessageRef::borrow(&frame).is_err());
    }

    #[test]
    fn a_list_of_assignments_is_as_long_as_its_entries() {
        let part = |drone: u32| payload::Assignment {
            drone: DroneId(drone),
            slot_m: [f64::from(drone), 0.5],
            leader: DroneId(3),
            ..bytemuck::Zeroable::zeroed()
        };
        let mut list = AssignmentList::of(&part(0));
        assert_eq!(Message::AssignmentList(list).encode().len as usize, size_of::<Assignment>() + 8);
        let other_leader = payload::Assignment { leader: DroneId(4), ..part(1) };
        assert!(!list.push(&other_leader) && (1..8).all(|drone| list.push(&part(drone))) && !list.push(&part(8)));
        let frame = Message::AssignmentList(list).encode();
        assert_eq!((frame.kind, frame.len as usize), (Topic::Assignment as u16, FRAME_PAYLOAD));
        let Ok(Message::AssignmentList(heard)) = Message::decode(&frame) else { panic!("expected a list") };
        assert!(heard.assignments().eq((0..8).map(part)));
        let shorter = Frame { len: frame.len - 8, ..frame };
        assert_eq!(Message::decode(&shorter), Err(DecodeError::Length(296, 304)));
        let mut crowded = frame;
        crowded.payload[std::mem::offset_of!(AssignmentList, count)] = 9;
        assert_eq!(Message::decode(&crowded), Err(DecodeError::Field("assignment count")));
    }

    #[test]
    fn a_decode_error_names_the_invalid_part_of_the_frame() {
        let good = obstacle().encode();
        assert_eq!(Message::decode(&Frame { kind: 99, ..good }), Err(DecodeError::Kind(99)));
        assert_eq!(Message::decode(&Frame { version: 9, ..good }), Err(DecodeError::Version(9)));
        assert_eq!(Message::decode(&Frame { len: 8, ..good }), Err(DecodeError::Length(8, size_of::<Obstacle>())));
        let mut nan = good;
        nan.payload[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(Message::decode(&nan), Err(DecodeError::Field("shape")));
        let mut too_large = good;
        too_large.payload[..8].copy_from_slice(&1e10f64.to_le_bytes());
        assert_eq!(Message::decode(&too_large), Err(DecodeError::Field("shape")));
        let group = crate::GroupId([0, 0, 3, 0, 0, 0, 0, 0]);
        let invalid = Message::Assignment(payload::Assignment { group, ..bytemuck::Zeroable::zeroed() });
        assert_eq!(Message::decode(&invalid.encode()), Err(DecodeError::Field("group")));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(kind in 0u16..11, len in 0u32..400, bytes in prop::collection::vec(any::<u8>(), FRAME_PAYLOAD)) {
            let mut frame = Frame { kind, version: payload::VERSION, len, payload: [0; FRAME_PAYLOAD] };
            frame.payload.copy_from_slice(&bytes);
            if let Ok(message) = Message::decode(&frame) {
                let again = message.encode();
                prop_assert_eq!(&again.payload[..len as usize], &frame.payload[..len as usize]);
            }
        }
    }
}
