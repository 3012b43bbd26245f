//! From how far away drones hear which frames.

use skein_protocol::DroneId;
use skein_protocol::message::Topic;
use skein_protocol::radio::Radio;

/// Number of topics, those that pilots define counted as one.
const TOPICS: usize = Topic::ALL.len() + 1;

/// Greatest distance from which drones hear each topic, m. Most drones hear equally far; those that do not are listed.
#[derive(Clone, Debug)]
pub struct Reaches {
    most_m: [f64; TOPICS],
    others: Vec<(DroneId, [f64; TOPICS])>,
}

impl Reaches {
    /// The reaches of so many drones with this radio.
    #[must_use]
    pub fn new(radio: &Radio, drones: u32) -> Self {
        let of = |id: u32| {
            let mut reach_m = [radio.own_reach_m(DroneId(id)); TOPICS];
            for (reach_m, topic) in reach_m.iter_mut().zip(Topic::ALL) {
                *reach_m = radio.reach_m(topic as u16, DroneId(id));
            }
            reach_m
        };
        let all: Vec<_> = (0..drones).map(of).collect();
        // With rules about single receivers, the first or the last drone may be one of them; the one in the middle rarely is.
        let most_m = all.get(all.len() / 2).copied().unwrap_or([f64::INFINITY; TOPICS]);
        let others = (0..drones).map(DroneId).zip(all).filter(|(_, reach_m)| *reach_m != most_m).collect();
        Self { most_m, others }
    }

    /// From how far most drones hear frames of this kind, m.
    pub(super) fn most_m(&self, kind: u16) -> f64 {
        self.most_m[place(kind)]
    }

    /// The drones that hear differently far.
    pub(super) fn others(&self) -> impl Iterator<Item = DroneId> + '_ {
        self.others.iter().map(|(id, _)| *id)
    }

    /// From how far one of those hears frames of this kind, m.
    pub(super) fn other_m(&self, id: DroneId, kind: u16) -> f64 {
        let found = self.others.iter().find(|(other, _)| *other == id);
        found.map_or_else(|| self.most_m(kind), |(_, reach_m)| reach_m[place(kind)])
    }
}

fn place(kind: u16) -> usize {
    Topic::ALL.iter().position(|topic| *topic as u16 == kind).unwrap_or(TOPICS - 1)
}
