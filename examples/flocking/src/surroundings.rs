//! What a flocking law knows of a drone's surroundings, as vectors.

use nalgebra::Vector3;
use skein::{Inbox, Out, Senses};
use std::collections::BTreeMap;

/// A position, velocity or acceleration: world frame, x east, y north, z up.
pub(crate) type Vec3 = Vector3<f64>;

/// Another drone, relative to this one.
pub(crate) struct Neighbour {
    /// The direction to it; a unit vector.
    pub(crate) direction: Vec3,
    /// The distance to it, m.
    pub(crate) distance_m: f64,
    /// Its velocity relative to this drone, m/s.
    pub(crate) velocity: Vec3,
}

/// How long a drone that is not heard any more counts as a neighbour, s.
const FORGET_S: f64 = 1.0;
/// The topic under which drones say where they are.
const TOPIC: &str = "state";

/// The drones around a drone, as it ranges them, or as they say by radio.
#[derive(Default)]
pub(crate) struct Company {
    by_radio: bool,
    /// What each drone said last: when, where it was, and its velocity.
    heard: BTreeMap<u32, State>,
}

struct State {
    at_s: f64,
    position_m: Vec3,
    velocity_mps: Vec3,
}

impl State {
    fn bytes(&self) -> Vec<u8> {
        let vectors = self.position_m.iter().chain(self.velocity_mps.iter());
        std::iter::once(&self.at_s).chain(vectors).flat_map(|number| number.to_le_bytes()).collect()
    }

    /// `None` if these are not the bytes of a state.
    fn parse(bytes: &[u8]) -> Option<Self> {
        let (chunks, rest) = bytes.as_chunks::<8>();
        let numbers: Vec<f64> =
            chunks.iter().map(|chunk| f64::from_le_bytes(*chunk)).filter(|n| n.is_finite()).collect();
        match numbers[..] {
            [at_s, x, y, z, vx, vy, vz] if rest.is_empty() => {
                Some(Self { at_s, position_m: Vec3::new(x, y, z), velocity_mps: Vec3::new(vx, vy, vz) })
            }
            _ => None,
        }
    }
}

impl Company {
    /// A drone that ranges the others, or, `by_radio`, says where it is and hears where they are.
    pub(crate) fn new(by_radio: bool) -> Self {
        Self { by_radio, heard: BTreeMap::new() }
    }

    /// The nearest `most` neighbours within `range_m`, nearest first.
    pub(crate) fn neighbours(
        &mut self,
        (senses, inbox, out): (&Senses<'_>, &Inbox<'_>, &mut Out),
        range_m: f64,
        most: usize,
    ) -> Vec<Neighbour> {
        let relative: Vec<(Vec3, Vec3)> = if self.by_radio {
            self.hear(senses, inbox, out)
        } else {
            senses.neighbours.iter().map(|n| (n.position_m.into(), n.velocity_mps.into())).collect()
        };
        let near = relative.into_iter().filter_map(|(position, velocity)| {
            let (distance_m, direction) = (position.norm(), position.try_normalize(1e-9)?);
            (distance_m < range_m).then_some(Neighbour { direction, distance_m, velocity })
        });
        let mut all: Vec<Neighbour> = near.collect();
        all.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        all.truncate(most);
        all
    }

    /// Positions and velocities of the others relative to this drone. A drone is taken to have flown on as it last said.
    fn hear(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Vec<(Vec3, Vec3)> {
        let own = State {
            at_s: senses.now_s,
            position_m: senses.position_m.into(),
            velocity_mps: senses.velocity_mps.into(),
        };
        out.say(TOPIC, own.bytes());
        for note in inbox.of(TOPIC) {
            let newer = |state: &State| self.heard.get(&note.from).is_none_or(|known| known.at_s < state.at_s);
            if let Some(state) = State::parse(note.bytes).filter(newer) {
                self.heard.insert(note.from, state);
            }
        }
        self.heard.retain(|_, state| own.at_s - state.at_s < FORGET_S);
        let relative = |state: &State| {
            let now_m = state.position_m + state.velocity_mps * (own.at_s - state.at_s);
            (now_m - own.position_m, state.velocity_mps - own.velocity_mps)
        };
        self.heard.values().map(relative).collect()
    }
}

/// The vector, shortened to this length if it is longer.
pub(crate) fn limited(vector: Vec3, length: f64) -> Vec3 {
    let norm = vector.norm();
    if norm > length { vector * (length / norm) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_read_as_it_was_said_and_nothing_else_is() {
        let state = State { at_s: 1.5, position_m: Vec3::new(1.0, 2.0, 3.0), velocity_mps: Vec3::new(-4.0, 0.5, 0.0) };
        let read = State::parse(&state.bytes()).unwrap();
        assert_eq!((read.at_s, read.position_m, read.velocity_mps), (1.5, state.position_m, state.velocity_mps));
        assert!(State::parse(&state.bytes()[..55]).is_none() && State::parse(&[0xff; 56]).is_none());
    }
}
