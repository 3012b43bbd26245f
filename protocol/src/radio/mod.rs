//! The radio model: whether a receiver hears a frame, when, and how often. It is a pure function of a key, without a shared
//! random generator and without memory. The order in which processes call it therefore has no effect, and any outcome can be
//! recomputed later. `docs/radio.md` describes the models and their formulas.

mod burst;
mod channel_model;
mod delivery;
mod key;
mod link;
mod rule;
mod shared_channel;
mod topic_set;

pub use crate::drop_reason::{DROP_REASONS, DropReason};
pub use crate::frame::NEVER_TRANSMITTED;
pub use burst::{BLOCK_BURSTS, Burst, BurstScope};
pub use channel_model::{ChannelModel, Delay, DelayModel, Range};
pub use delivery::Delivery;
pub use link::Link;
pub use rule::Rule;
pub use shared_channel::{ChannelQueue, HEAD_BYTES, SharedChannel};
pub use topic_set::TopicSet;

use crate::Vec3;
use crate::frame::AirFrame;
use crate::ids::DroneId;
use crate::message::Topic;
use crate::nearby::Locality;
use crate::record::RecordView;
use crate::time::SimTime;
use crate::topic_name::OWN_TOPIC;
use key::KeyedRng;
use serde::{Deserialize, Serialize};

/// The radio between any two drones. The default is ideal: no frame is lost, and each frame is heard after one tick.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Radio {
    /// Key of all random numbers.
    pub seed: u64,
    /// The channel model for frames that no rule covers.
    #[serde(rename = "air")]
    pub channel: ChannelModel,
    /// Difference between the two directions of a link, ≥ 0, dimensionless. A factor is drawn for each pair of drones,
    /// log-uniformly from 1 to 1 + `asymmetry`. Delay and loss are multiplied by it in one direction and divided by it in
    /// the other.
    pub asymmetry: f64,
    /// Whether random numbers are keyed by the time of transmission instead of the frame's sequence number. Flights that send
    /// different frames then meet the same air: a link loses or delays at the same moments. Frames of one topic that a drone
    /// sends in one tick share their fate at a receiver.
    #[serde(default)]
    pub keyed_by_time: bool,
    /// Rules that replace the channel model for some frames. If several rules cover a frame, the last one applies.
    pub rules: Vec<Rule>,
}

/// In [`ReceiverChannels::places`]: no rule covers the topic, and the general channel model applies.
const GENERAL: u16 = u16::MAX;

/// The channel model of each topic at one receiver. It saves looking up the rules for every frame.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverChannels {
    receiver: DroneId,
    /// For each number of a topic from 1, the index of the rule that applies. `None`: the rule depends on the sender.
    places: [Option<u16>; Topic::LAST as usize],
    /// The same for all topics that pilots define. `None`: it depends on the sender or on the topic.
    own: Option<u16>,
}

impl Radio {
    /// The outcome of a frame that was transmitted at `aired`. `path` is the vector from the sender to the receiver, world
    /// frame, m.
    #[must_use]
    pub fn outcome(&self, link: Link, path: Vec3, aired: SimTime) -> Delivery {
        self.outcome_in(self.channel_of(link), link, path, aired)
    }

    fn outcome_in(&self, channel: &ChannelModel, link: Link, path: Vec3, aired: SimTime) -> Delivery {
        let keyed = |purpose| match self.keyed_by_time {
            true => KeyedRng::of_moment(self.seed, link, aired, purpose),
            false => KeyedRng::of_frame(self.seed, link, purpose),
        };
        let draw = |purpose| keyed(purpose).unit();
        if let Some(range) = channel.range
            && !range.hears(path.norm_squared(), || draw(b"rnge"))
        {
            return Delivery::Drop(DropReason::Range);
        }
        if let Some(burst) = channel.burst
            && burst.is_active(self.seed, link, aired)
            && draw(b"lstb") < burst.loss
        {
            return Delivery::Drop(DropReason::Burst);
        }
        let factor = self.factor(link);
        if channel.loss > 0.0 && draw(b"loss") < channel.loss * factor {
            return Delivery::Drop(DropReason::Loss);
        }
        let arrival = |purpose| aired.after(factor * channel.delay.draw(|| keyed(purpose)));
        let due = arrival(b"dely");
        if channel.duplicate > 0.0 && draw(b"dupl") < channel.duplicate {
            let copy = arrival(b"copy");
            return Delivery::Deliver { due: due.min(copy), again: Some(due.max(copy)) };
        }
        Delivery::Deliver { due, again: None }
    }

    /// The outcome of a frame, with the stamp of the world, at one receiver. `here` is the receiver's position one tick
    /// after the frame was sent, world frame, m. `dt_ns` is the length of a tick, ns.
    #[must_use]
    pub fn delivery(&self, frame: &AirFrame, receiver: DroneId, here: Vec3, dt_ns: i64) -> Delivery {
        let link = Link::of(frame, receiver);
        self.delivery_in(self.channel_of(link), frame, (link, here), dt_ns)
    }

    /// The same as [`Radio::delivery`], for a receiver whose channel models were looked up with [`Radio::channels_at`].
    #[must_use]
    pub fn delivery_at(&self, channels: &ReceiverChannels, frame: &AirFrame, here: Vec3, dt_ns: i64) -> Delivery {
        let link = Link::of(frame, channels.receiver);
        let place = match channels.places.get(usize::from(link.topic).wrapping_sub(1)) {
            Some(place) => *place,
            None => channels.own.filter(|_| link.topic & OWN_TOPIC != 0),
        };
        let known = place.and_then(|place| match place {
            GENERAL => Some(&self.channel),
            rule => self.rules.get(usize::from(rule)).map(|rule| &rule.channel),
        });
        self.delivery_in(known.unwrap_or_else(|| self.channel_of(link)), frame, (link, here), dt_ns)
    }

    fn delivery_in(
        &self,
        channel: &ChannelModel,
        frame: &AirFrame,
        (link, here): (Link, Vec3),
        dt_ns: i64,
    ) -> Delivery {
        if frame.queue_ns == NEVER_TRANSMITTED {
            return Delivery::Drop(DropReason::Queue);
        }
        let sent = SimTime((frame.tick as i64).saturating_mul(dt_ns));
        let aired = sent + i64::try_from(frame.queue_ns).unwrap_or(i64::MAX);
        self.outcome_in(channel, link, here - frame.position(), aired)
    }

    /// Looks up the channel model of each topic at a receiver, if it is the same for all senders.
    #[must_use]
    pub fn channels_at(&self, receiver: DroneId) -> ReceiverChannels {
        let applies =
            |rule: &Rule, kind| rule.is_about(kind) && rule.to.as_ref().is_none_or(|to| to.contains(&receiver));
        let place = |kind| {
            let Some(last) = self.rules.iter().rposition(|rule| applies(rule, kind)) else { return Some(GENERAL) };
            u16::try_from(last).ok().filter(|&place| place != GENERAL && self.rules[last].from.is_none())
        };
        let (named, other) = self.own_kinds();
        let own = if named.is_empty() { place(other) } else { None };
        ReceiverChannels { receiver, places: std::array::from_fn(|index| place(index as u16 + 1)), own }
    }

    /// Recomputes the outcome of every frame in a tick's record at every other drone that was alive at the end of the tick.
    /// `dt_ns` is the length of a tick, ns. Drops that other causes produce (a partition, a deaf receiver) are not included.
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

    /// The topics that are heard no farther than beacons, if beacons have a hard range. Beacons set the limit because most
    /// frames are beacons. Only rules for all senders and all receivers are considered, so a drone that a rule names must
    /// compare its own [`Radio::reach_m`].
    #[must_use]
    pub fn locality(&self) -> Locality {
        let reach_m = |kind| self.general_channel(kind).reach_m();
        let cell_m = reach_m(Topic::Pose as u16);
        let local = |kind: u16| cell_m.is_finite() && reach_m(kind) <= cell_m;
        let built_in = Topic::ALL.into_iter().filter(|topic| local(*topic as u16));
        let locality = built_in.fold(Locality::default(), |locality, topic| locality.with(topic, cell_m));
        let (mut named, other) = self.own_kinds();
        named.push(other);
        if named.into_iter().all(local) { locality.with_own(cell_m) } else { locality }
    }

    /// The channel model of a topic, by the rules for all senders and all receivers.
    fn general_channel(&self, kind: u16) -> &ChannelModel {
        let general = |rule: &&Rule| rule.from.is_none() && rule.to.is_none() && rule.is_about(kind);
        self.rules.iter().rev().find(general).map_or(&self.channel, |rule| &rule.channel)
    }

    /// Distance at which half of all beacons are heard, m; infinite if the range is not limited. Only rules for all senders and all
    /// receivers count.
    #[must_use]
    pub fn beacon_range_m(&self) -> f64 {
        self.general_channel(Topic::Pose as u16).range.map_or(f64::INFINITY, |range| range.half_m)
    }

    /// Greatest distance at which `receiver` can hear any topic that pilots define, m; infinite without a hard range.
    #[must_use]
    pub fn own_reach_m(&self, receiver: DroneId) -> f64 {
        let (named, other) = self.own_kinds();
        named.into_iter().map(|kind| self.reach_m(kind, receiver)).fold(self.reach_m(other, receiver), f64::max)
    }

    /// The numbers of the topics of pilots that rules name, and one that no rule names. It stands for all others.
    fn own_kinds(&self) -> (Vec<u16>, u16) {
        let named = self.rules.iter().filter_map(|rule| rule.topics.as_ref()).flat_map(TopicSet::own_kinds);
        let named: Vec<u16> = named.collect();
        let other = (OWN_TOPIC..=u16::MAX).find(|kind| !named.contains(kind)).unwrap_or(OWN_TOPIC);
        (named, other)
    }

    /// Greatest distance at which `receiver` can hear the topic of this number on the wire from any sender, m; infinite
    /// without a hard range.
    #[must_use]
    pub fn reach_m(&self, kind: u16, receiver: DroneId) -> f64 {
        let mut reach_m = 0f64;
        let applies = |rule: &&Rule| rule.is_about(kind) && rule.to.as_ref().is_none_or(|to| to.contains(&receiver));
        for rule in self.rules.iter().rev().filter(applies) {
            reach_m = reach_m.max(rule.channel.reach_m());
            if rule.from.is_none() {
                return reach_m;
            }
        }
        reach_m.max(self.channel.reach_m())
    }

    fn channel_of(&self, link: Link) -> &ChannelModel {
        self.rules.iter().rev().find(|rule| rule.covers(link)).map_or(&self.channel, |rule| &rule.channel)
    }

    /// The factor by which delay and loss are multiplied in this direction of a link, dimensionless. The factor of the other
    /// direction is its inverse.
    #[must_use]
    pub fn factor(&self, link: Link) -> f64 {
        if self.asymmetry <= 0.0 {
            return 1.0;
        }
        let (low, high) = (link.source.min(link.destination), link.source.max(link.destination));
        let exponent = 2.0 * KeyedRng::of_pair(self.seed, [low, high], 0, b"asym").unit() - 1.0;
        let exponent = if link.source == low { exponent } else { -exponent };
        libm::pow(1.0 + self.asymmetry, exponent)
    }
}
