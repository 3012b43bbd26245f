//! What the model says about swarms that are too large to be measured.

use super::cost_model::{CostModel, PartMeans};
use super::loopback::Wire;
use serde::Serialize;

/// How a swarm talks and looks, as measured: it is the same at every size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Habits {
    /// Frames per drone and tick.
    pub frames_per_drone: f64,
    /// Bytes of a frame on a network.
    pub frame_bytes: f64,
    /// Bytes of a body on a network.
    pub body_bytes: f64,
    /// Bytes of a drone's share of the digest.
    pub digest_bytes: f64,
    /// Spacing of the grid, m.
    pub spacing_m: f64,
    /// How far drones sense each other, m.
    pub ranging_m: f64,
    /// How far drones hear each other, m.
    pub radio_m: f64,
}

/// The forecast for one swarm and one number of parts, each part with a core of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Size of the swarm.
    pub drones: f64,
    /// Parts.
    pub parts: f64,
    /// What the parts compute, the slowest of those that have no leader, ms.
    pub part_ms: f64,
    /// What the part of the leader computes, which hears all drones, ms.
    pub leader_ms: f64,
    /// Two barriers and the halos on the network, ms.
    pub network_ms: f64,
    /// The digest's shares on the network, all to one place, ms.
    pub digest_ms: f64,
    /// Bytes that a part without the leader sends per tick.
    pub halo_bytes: f64,
    /// Ticks per second with one leader and one digest.
    pub ticks_per_s: f64,
    /// The same without the leader that hears all, and without the digest.
    pub ticks_per_s_without: f64,
}

impl Forecast {
    /// The forecast for so many drones in so many parts.
    pub(super) fn new((drones, parts): (f64, f64), habits: &Habits, model: &CostModel, wire: &Wire) -> Self {
        let part = part_of(drones, parts, habits);
        // The leader's part goes through the frames of all drones, and all other parts send them to it.
        let all_frames = habits.frames_per_drone * drones;
        let leader = PartMeans { frames: all_frames, ..part };
        let (part_ms, leader_ms) = (model.part_us(&part) / 1e3, model.part_us(&leader) / 1e3);
        let barrier_ms = if parts > 1.0 { 2.0 * (wire.round_trip_us + parts * PER_MESSAGE_US) / 1e3 } else { 0.0 };
        let halo_ms = part.sent_bytes * wire.byte_us / 1e3;
        let to_leader_ms = if parts > 1.0 { all_frames * habits.frame_bytes * wire.byte_us / 1e3 } else { 0.0 };
        let digest_ms = if parts > 1.0 { drones * habits.digest_bytes * wire.byte_us / 1e3 } else { 0.0 };
        Self {
            drones,
            parts,
            part_ms,
            leader_ms,
            network_ms: barrier_ms + halo_ms.max(to_leader_ms),
            digest_ms,
            halo_bytes: part.sent_bytes,
            // The digest of a tick is gathered while the next one is computed; the slower of both counts.
            ticks_per_s: 1e3 / (part_ms.max(leader_ms) + barrier_ms + halo_ms.max(to_leader_ms)).max(digest_ms),
            ticks_per_s_without: 1e3 / (part_ms + barrier_ms + halo_ms),
        }
    }
}

/// What the place in which parts meet does with one part's announcement, µs. Chosen by hand: about a system call to read and one to
/// write.
const PER_MESSAGE_US: f64 = 5.0;

/// A square part in the middle of a grid.
pub(super) fn part_of(drones: f64, parts: f64, habits: &Habits) -> PartMeans {
    let own = drones / parts;
    let side = own.sqrt();
    let ring = |range_m: f64| {
        let rows = (range_m / habits.spacing_m).floor();
        if parts > 1.0 { 4.0 * side * rows + 4.0 * rows * rows } else { 0.0 }
    };
    let (bodies, senders) = (ring(habits.ranging_m), ring(habits.radio_m));
    let sent_frames = senders * habits.frames_per_drone;
    PartMeans {
        swarm: drones,
        drones: own,
        halo_bodies: bodies,
        frames: habits.frames_per_drone * own + sent_frames,
        sent_bytes: bodies * habits.body_bytes + sent_frames * habits.frame_bytes,
        digest_bytes: own * habits.digest_bytes,
        ..PartMeans::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HABITS: Habits = Habits {
        frames_per_drone: 0.2,
        frame_bytes: 150.0,
        body_bytes: 56.0,
        digest_bytes: 150.0,
        spacing_m: 65.0,
        ranging_m: 66.0,
        radio_m: 100.0,
    };
    const MODEL: CostModel =
        CostModel { drone_us: 2.0, frame_us: 0.5, pair_us: 0.0, exchange_drone_us: 0.1, exchange_byte_us: 0.001 };
    const WIRE: Wire = Wire { round_trip_us: 100.0, byte_us: 0.0008 };

    #[test]
    fn more_parts_help_until_the_leader_is_the_slowest() {
        let of = |parts| Forecast::new((1e6, parts), &HABITS, &MODEL, &WIRE);
        assert!(of(16.0).ticks_per_s > 5.0 * of(1.0).ticks_per_s);
        assert!(of(256.0).leader_ms > of(256.0).part_ms);
        assert!(of(256.0).ticks_per_s < of(256.0).ticks_per_s_without / 5.0);
    }

    #[test]
    fn a_part_of_a_hundred_drones_has_a_ring_of_one_row() {
        let part = part_of(1600.0, 16.0, &HABITS);
        assert_eq!((part.drones, part.halo_bodies), (100.0, 44.0));
        assert_eq!(part_of(100.0, 1.0, &HABITS).sent_bytes, 0.0);
    }
}
