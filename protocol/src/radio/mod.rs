//! The radio between sending and hearing: whether a frame is heard, when, and how often. A pure, keyed function without
//! shared generator or memory, so that it does not matter which process asks first, and that any verdict can be looked up
//! afterwards. `docs/radio.md` has the models with their formulas.

mod burst;
mod channel_model;
mod delivery;
mod key;
mod link;
mod rule;
mod shared_channel;

pub use crate::drop_reason::{DROP_REASONS, DropReason};
pub use crate::frame::NEVER_TRANSMITTED;
pub use burst::{BLOCK_BURSTS, Burst, BurstScope};
pub use channel_model::{ChannelModel, Delay, DelayModel, Range};
pub use delivery::Delivery;
pub use link::Link;
pub use rule::Rule;
pub use shared_channel::{ChannelQueue, SharedChannel};

use crate::Vec2;
use crate::frame::AirFrame;
use crate::ids::DroneId;
use crate::message::Topic;
use crate::nearby::Locality;
use crate::record::RecordView;
use crate::time::SimTime;
use key::KeyedRng;
use serde::{Deserialize, Serialize};

/// What the air does to frames between any two drones. The default is ideal: nothing is lost, a frame takes one tick.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Radio {
    /// Key of all verdicts.
    pub seed: u64,
    /// What the air does where no rule says otherwise.
    #[serde(rename = "air")]
    pub channel: ChannelModel,
    /// How different the directions of a link are, from 0: one has its delay and its loss multiplied, the other
    /// divided, by a factor drawn for each pair of drones, log-uniformly from 1 to 1 + this.
    pub asymmetry: f64,
    /// Where the air is another. Of several rules about one frame the last counts.
    pub rules: Vec<Rule>,
}

/// In [`ReceiverChannels::places`]: the air where no rule says otherwise.
const GENERAL: u16 = u16::MAX;

/// What air each topic goes through to one receiver: rules are looked up once, not for every frame.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverChannels {
    receiver: DroneId,
    /// A rule's place; `None`: it depends on who sends.
    places: [Option<u16>; Topic::ALL.len()],
}

impl Radio {
    /// What becomes of a frame that went on the air at `aired` and flew over `path` (from sender to receiver, m).
    #[must_use]
    pub fn outcome(&self, link: Link, path: Vec2, aired: SimTime) -> Delivery {
        self.outcome_in(self.air_of(link), link, path, aired)
    }

    fn outcome_in(&self, air: &ChannelModel, link: Link, path: Vec2, aired: SimTime) -> Delivery {
        let chance = |purpose| KeyedRng::of_frame(self.seed, link, purpose).unit();
        if let Some(range) = air.range {
            let heard = range.heard(path.norm_squared());
            if heard < 1.0 && chance(b"rnge") >= heard {
                return Delivery::Drop(DropReason::Range);
            }
        }
        if let Some(burst) = air.burst
            && burst.is_active(self.seed, link, aired)
            && chance(b"lstb") < burst.loss
        {
            return Delivery::Drop(DropReason::Burst);
        }
        let factor = self.factor(link);
        if air.loss > 0.0 && chance(b"loss") < air.loss * factor {
            return Delivery::Drop(DropReason::Loss);
        }
        let arrival = |purpose| aired.after(factor * air.delay.draw(|| KeyedRng::of_frame(self.seed, link, purpose)));
        let due = arrival(b"dely");
        if air.duplicate > 0.0 && chance(b"dupl") < air.duplicate {
            let copy = arrival(b"copy");
            return Delivery::Deliver { due: due.min(copy), again: Some(due.max(copy)) };
        }
        Delivery::Deliver { due, again: None }
    }

    /// What becomes of a frame, as the world stamped it, at a receiver that is `here` (m) one tick after it was sent.
    #[must_use]
    pub fn delivery(&self, frame: &AirFrame, receiver: DroneId, here: Vec2, dt_ns: i64) -> Delivery {
        let link = Link::of(frame, receiver);
        self.delivery_in(self.air_of(link), frame, (link, here), dt_ns)
    }

    /// The same for a receiver whose airs were looked up beforehand.
    #[must_use]
    pub fn delivery_at(&self, airs: &ReceiverChannels, frame: &AirFrame, here: Vec2, dt_ns: i64) -> Delivery {
        let link = Link::of(frame, airs.receiver);
        let place = airs.places.get(usize::from(link.topic).wrapping_sub(1)).copied().flatten();
        let known = place.and_then(|place| match place {
            GENERAL => Some(&self.channel),
            rule => self.rules.get(usize::from(rule)).map(|rule| &rule.channel),
        });
        self.delivery_in(known.unwrap_or_else(|| self.air_of(link)), frame, (link, here), dt_ns)
    }

    fn delivery_in(&self, air: &ChannelModel, frame: &AirFrame, (link, here): (Link, Vec2), dt_ns: i64) -> Delivery {
        if frame.queue_ns == NEVER_TRANSMITTED {
            return Delivery::Drop(DropReason::Queue);
        }
        let sent = SimTime((frame.tick as i64).saturating_mul(dt_ns));
        let aired = sent + i64::try_from(frame.queue_ns).unwrap_or(i64::MAX);
        self.outcome_in(air, link, here - frame.position(), aired)
    }

    /// What air each topic goes through to a receiver, where that is the same for all senders.
    #[must_use]
    pub fn channels_at(&self, receiver: DroneId) -> ReceiverChannels {
        let at = |rule: &Rule, topic| rule.is_about(topic) && rule.to.as_ref().is_none_or(|to| to.contains(&receiver));
        let place = |topic| {
            let Some(last) = self.rules.iter().rposition(|rule| at(rule, topic)) else { return Some(GENERAL) };
            u16::try_from(last).ok().filter(|&place| place != GENERAL && self.rules[last].from.is_none())
        };
        ReceiverChannels { receiver, places: Topic::ALL.map(place) }
    }

    /// Looks up what became of every frame in a tick's record, at every other drone that was alive at the tick's end.
    /// What is dropped for other reasons than the radio's (a partition, a deaf receiver) is not known here.
    pub fn deliveries<'a>(
        &'a self,
        record: RecordView<'a>,
        dt_ns: i64,
    ) -> impl Iterator<Item = (&'a AirFrame, DroneId, Delivery)> + 'a {
        let receivers = (0u32..).map(DroneId).zip(record.rows).filter(|(_, row)| row.alive());
        receivers.flat_map(move |(receiver, row)| {
            let others = record.frames.iter().filter(move |frame| frame.source != receiver);
            others.map(move |frame| (frame, receiver, self.delivery(frame, receiver, row.position_m.into(), dt_ns)))
        })
    }

    /// Which topics are heard no farther than beacons, which are most of what is said, if those have a hard range: by
    /// everybody whom no rule names.
    #[must_use]
    pub fn locality(&self) -> Locality {
        let reach_m = |topic| {
            let general = |rule: &&Rule| rule.from.is_none() && rule.to.is_none() && rule.is_about(topic);
            self.rules.iter().rev().find(general).map_or(&self.channel, |rule| &rule.channel).reach_m()
        };
        let cell_m = reach_m(Topic::Pose);
        let local = |topic: &Topic| cell_m.is_finite() && reach_m(*topic) <= cell_m;
        Topic::ALL.into_iter().filter(local).fold(Locality::default(), |locality, topic| locality.with(topic, cell_m))
    }

    /// From how far away a drone hears a topic at most, whoever sends, m; infinite without a hard range.
    #[must_use]
    pub fn reach_m(&self, topic: Topic, receiver: DroneId) -> f64 {
        let mut reach_m = 0f64;
        let at = |rule: &&Rule| rule.is_about(topic) && rule.to.as_ref().is_none_or(|to| to.contains(&receiver));
        for rule in self.rules.iter().rev().filter(at) {
            reach_m = reach_m.max(rule.channel.reach_m());
            if rule.from.is_none() {
                return reach_m;
            }
        }
        reach_m.max(self.channel.reach_m())
    }

    fn air_of(&self, link: Link) -> &ChannelModel {
        self.rules.iter().rev().find(|rule| rule.covers(link)).map_or(&self.channel, |rule| &rule.channel)
    }

    /// By what delay and loss of this direction are multiplied; the other direction's factor is its inverse.
    #[must_use]
    pub fn factor(&self, link: Link) -> f64 {
        if self.asymmetry <= 0.0 {
            return 1.0;
        }
        let (low, high) = (link.source.min(link.destination), link.source.max(link.destination));
        let part = 2.0 * KeyedRng::of_pair(self.seed, [low, high], 0, b"asym").unit() - 1.0;
        let part = if link.source == low { part } else { -part };
        libm::pow(1.0 + self.asymmetry, part)
    }
}
