//! The states of drones that a drone passes on, several in a frame. See [`crate::relays`].

use crate::knowledge::Knowledge;
use crate::params::LeadingParams;
use crate::tuning::{NEWS_TIMES, PRESENCE_REPEATS};
use skein_protocol::digest::Digest;
use skein_protocol::payload::{MAX_PRESENT, Pose, Presence, Present};
use skein_protocol::{Ballot, DroneId, GroupId, Message, PlanStamp, SimTime};
use std::collections::BTreeMap;

/// What the drones of one frame have in common.
type Kind = (PlanStamp, GroupId, Ballot);

/// What was said of one drone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Told {
    /// What the drone obeys, and its flags.
    news: Option<(Kind, u32, u32)>,
    /// How often the news is said at once.
    left: u32,
    /// When the neighbourhood last heard of it, as far as this drone knows.
    covered: SimTime,
}

/// The states that one drone passes on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Presences {
    me: DroneId,
    repeat_s: f64,
    told: BTreeMap<DroneId, Told>,
    /// When a drone was last heard of for the first time.
    last_new: SimTime,
    /// When this drone speaks next.
    turn: SimTime,
}

impl Presences {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let (me, start) = (params.me, params.start);
        Self { me, repeat_s: params.repeat_period_s, told: BTreeMap::new(), last_new: start, turn: start }
    }

    /// When a drone was last heard of for the first time.
    pub(crate) fn last_new(&self) -> SimTime {
        self.last_new
    }

    /// Notes that a drone's state was heard. `near`: the state in a message of a drone close to this one.
    pub(crate) fn hear(&mut self, k: &Knowledge, now: SimTime, drone: DroneId, near: Option<&Pose>) {
        let Some(newest) = k.peers().last(drone) else { return };
        let period_s = self.repeat_s * PRESENCE_REPEATS;
        let told = self.told.entry(drone).or_insert_with(|| {
            self.last_new = now;
            Told::default()
        });
        if told.news != Some(news(newest)) {
            *told = Told { news: Some(news(newest)), left: NEWS_TIMES, covered: SimTime::ZERO };
        }
        if let Some(pose) = near
            && told.news == Some(news(pose))
            && newest.stamp.since(pose.stamp) < period_s
        {
            told.covered = now;
            told.left = told.left.saturating_sub(1);
        }
    }

    /// Says the states that are due, if it is this drone's turn, in at most `frames`.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, frames: usize, say: &mut Vec<Message>) {
        if now < self.turn || frames == 0 {
            return;
        }
        let draw = Digest::chain(u64::from(self.me.0), now.0 as u64) >> 11;
        self.turn = now.after(self.repeat_s * (0.5 + draw as f64 / (1_u64 << 53) as f64));
        let period_s = self.repeat_s * PRESENCE_REPEATS;
        let mut due: BTreeMap<Kind, Vec<(u32, SimTime, DroneId)>> = BTreeMap::new();
        for (&id, told) in &self.told {
            let stale = now.since(told.covered) >= period_s;
            let pose = k.peers().last_of_living(id, now).filter(|_| told.left > 0 || stale);
            if let Some(pose) = pose {
                due.entry(news(pose).0).or_default().push((NEWS_TIMES - told.left.min(NEWS_TIMES), told.covered, id));
            }
        }
        let mut left = frames;
        for ((obeyed, group, term), mut drones) in due {
            drones.sort_unstable();
            for chunk in drones.chunks(MAX_PRESENT).take(left) {
                let mut presence = Presence { obeyed, group, term, ..Presence::default() };
                for (entry, &(_, _, id)) in presence.drones.iter_mut().zip(chunk) {
                    let (Some(pose), Some(told)) = (k.peers().last(id), self.told.get_mut(&id)) else { continue };
                    *entry = present(id, pose);
                    presence.count += 1;
                    told.covered = now;
                    told.left = told.left.saturating_sub(1);
                }
                say.push(Message::Presence(presence));
                left -= 1;
            }
        }
    }
}

/// What must be passed on at once if it changes.
fn news(pose: &Pose) -> (Kind, u32, u32) {
    ((pose.obeyed, pose.group, pose.term), pose.flags, pose.incarnation)
}

/// A beacon as it is passed on.
fn present(drone: DroneId, pose: &Pose) -> Present {
    let velocity = pose.velocity();
    Present {
        stamp: pose.stamp,
        drone,
        incarnation: pose.incarnation,
        flags: pose.flags,
        position_m: pose.position_m.map(|value| value as f32),
        velocity_mps: [velocity.x as f32, velocity.y as f32],
    }
}
