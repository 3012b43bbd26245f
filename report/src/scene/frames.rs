//! Describes frames: their delivery to each receiver, by the receivers' own rule, and their content.

use crate::scene_facts::SceneFacts;
use serde::Serialize;
use skein_protocol::LeadershipKind;
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::radio::{Delivery, DropReason};
use skein_protocol::record::DroneRow;
use skein_protocol::{DroneId, Message, UserMessage, Vec3};
use std::borrow::Cow;
use std::sync::LazyLock;

/// The letter of a receiver that a frame does not concern: its sender, a dead drone or a frozen one.
const ABSENT: char = '-';

/// The delivery of a frame to one receiver, as a letter of [`SentFrame::deliveries`](super::SentFrame::deliveries).
pub(super) fn delivery(scene: &SceneFacts, frame: &AirFrame, receiver: DroneId, rows: &[DroneRow], dt_ns: i64) -> char {
    let receives = |row: &&DroneRow| row.alive() && !row.is_frozen() && receiver != frame.source;
    let Some(row) = rows.get(receiver.index()).filter(receives) else { return ABSENT };
    if Message::decode(&frame.frame).is_err() {
        return letter(DropReason::Malformed);
    }
    if let Some(reason) = row.link_faults.drop_reason(frame.link_faults) {
        return letter(reason);
    }
    match scene.radio.delivery(frame, receiver, Vec3::from(row.position_m), dt_ns) {
        Delivery::Deliver { .. } => 'h',
        Delivery::Drop(reason) => letter(reason),
    }
}

/// Name of a drop reason.
pub(crate) fn reason(reason: DropReason) -> &'static str {
    static NAMES: LazyLock<Vec<String>> = LazyLock::new(|| DropReason::ALL.iter().map(name).collect());
    &NAMES[reason as usize]
}

fn letter(why: DropReason) -> char {
    reason(why).chars().next().unwrap_or('?')
}

/// Name of a frame's topic: a built-in one, or one that pilots define; `unknown` for a frame that names none.
#[must_use]
pub fn topic(frame: &AirFrame) -> Cow<'static, str> {
    match Topic::from_wire(frame.frame.kind) {
        Some(topic) => topic.name().into(),
        None => match UserMessage::read(&frame.frame) {
            Ok(message) => message.topic().as_str().to_owned().into(),
            Err(_) => "unknown".into(),
        },
    }
}

/// The name of a value in JSON.
fn name(value: &impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Describes the content of a frame in a few words.
pub(super) fn content(frame: &AirFrame) -> String {
    match Message::decode(&frame.frame) {
        Ok(Message::Pose(_)) => String::new(),
        Ok(Message::Obstacle(obstacle)) => format!("obstacle {}, sensed by drone {}", obstacle.id.0, obstacle.witness),
        Ok(Message::Leadership(message)) => {
            let what = match message.kind() {
                LeadershipKind::Claim => "claims",
                LeadershipKind::Heartbeat => "leads",
                LeadershipKind::PreVote => "requests a pre-vote for",
                LeadershipKind::PreVoteRejection => "rejects the pre-vote for",
                LeadershipKind::LeadershipTransfer => "transfers the leadership of",
            };
            format!("{what} {}, round {}", message.group, message.ballot.round)
        }
        Ok(Message::Plan(plan)) => {
            let phase = plan.phase();
            let set: Vec<String> = plan.set.iter().take(plan.set_count as usize).map(|id| id.0.to_string()).collect();
            let past = if set.is_empty() { String::new() } else { format!(", obstacles {}", set.join(", ")) };
            format!("{phase} {}, round {} epoch {}{past}", plan.group, plan.id.ballot.round, plan.id.epoch)
        }
        Ok(Message::Assignment(part)) => format!("drone {}: {}, place {}", part.drone, part.group, part.rank),
        Ok(Message::Arrivals(row)) => format!("drone {}: arrival times by {} routes", row.drone, row.routes),
        Ok(Message::Passed(passed)) => match passed.of.checked_sub(1) {
            Some(drone) => format!("drone {drone} passed {} obstacles", passed.set_count),
            None => format!("passed {} obstacles", passed.set_count),
        },
        Ok(Message::AssignmentList(list)) => format!("passes on the assignments of {} drones", list.count),
        Ok(Message::Presence(presence)) => format!("passes on the states of {} drones", presence.count),
        Ok(Message::Separation(separation)) => format!("bound to {} separators", separation.separators().len()),
        Ok(Message::User(message)) => format!("{} bytes", message.bytes().len()),
        Err(error) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::row;
    use skein_protocol::SimTime;
    use skein_protocol::payload::Passed;
    use skein_protocol::radio::{ChannelModel, Radio, Range};
    use skein_protocol::record::ROW_FROZEN;

    fn frame(sequence: u32) -> AirFrame {
        let passed = Passed { stamp: SimTime::ZERO, set_count: 2, set: Default::default(), of: 0 };
        AirFrame {
            tick: 3,
            source: DroneId(0),
            sequence,
            position_m: [0.0, 0.0, 50.0],
            queue_ns: 0,
            link_faults: Default::default(),
            frame: Message::Passed(passed).encode(),
        }
    }

    fn scene(radio: Radio) -> SceneFacts {
        SceneFacts { radio, ..SceneFacts::default() }
    }

    #[test]
    fn a_frame_has_a_delivery_at_each_receiver() {
        let rows = [row(0.0, 0.0), row(10.0, 0.0), row(50.0, 0.0), DroneRow::default()];
        let near = scene(Radio {
            channel: ChannelModel {
                range: Some(Range { half_m: 20.0, shadowing_db: 0.0, exponent: 2.0 }),
                ..ChannelModel::default()
            },
            ..Radio::default()
        });
        let deliveries = |scene: &SceneFacts, frame: &AirFrame| -> String {
            (0..4).map(|drone| delivery(scene, frame, DroneId(drone), &rows, 20_000_000)).collect()
        };
        assert_eq!(deliveries(&near, &frame(0)), "-hr-");
        let frozen = [rows[0], DroneRow { flags: rows[1].flags | ROW_FROZEN, ..rows[1] }];
        assert_eq!(delivery(&near, &frame(0), DroneId(1), &frozen, 20_000_000), '-');
        let lossy = scene(Radio { channel: ChannelModel { loss: 1.0, ..ChannelModel::default() }, ..Radio::default() });
        assert_eq!(deliveries(&lossy, &frame(0)), "-ll-");
        let mut broken = frame(0);
        broken.frame.len = 1;
        assert_eq!(deliveries(&near, &broken), "-mm-");
    }

    #[test]
    fn frames_have_a_topic_and_a_content() {
        assert_eq!((&*topic(&frame(0)), content(&frame(0)).as_str()), ("passed", "passed 2 obstacles"));
        let mut strange = frame(0);
        strange.frame.kind = 99;
        assert_eq!(topic(&strange), "unknown");
        assert!(content(&strange).contains("99"));
    }
}
