//! In words: why the time of a mission is over and its goal is not reached.

use crate::tuning::STANDSTILL_S;
use skein_protocol::payload::QueuePlace;
use skein_protocol::{Lack, Phase, UnfinishedDrone};

/// This number of drones is described; the others are counted.
const DESCRIBED: usize = 3;

/// The reason of a time-out. `standstill_s` is how long no living drone has moved, if that is long.
pub(crate) fn reason(timeout_s: f64, unfinished: &[UnfinishedDrone], standstill_s: Option<f64>) -> String {
    let mut parts = vec![format!("the time of {timeout_s} s is over"), pace(unfinished, standstill_s)];
    for (lack, what) in [
        (Lack::Pass, "not past all obstacles"),
        (Lack::Slot, "not in a slot"),
        (Lack::Stop, "in a slot and too fast"),
        (Lack::Done, "not done, says the pilot"),
    ] {
        let those: Vec<&UnfinishedDrone> = unfinished.iter().filter(|drone| drone.lack == lack).collect();
        if !those.is_empty() {
            parts.push(format!("{what}: {}", described(&those)));
        }
    }
    parts.join("; ")
}

/// Whether the mission stands still or is slow.
fn pace(unfinished: &[UnfinishedDrone], standstill_s: Option<f64>) -> String {
    if let Some(still_s) = standstill_s {
        return format!("no drone has moved for {still_s:.0} s");
    }
    let moving = unfinished.iter().filter(|drone| drone.still_s < STANDSTILL_S).count();
    match (moving, unfinished.len()) {
        (_, 0) => "each drone by itself has done its part, the swarm has not".to_owned(),
        (0, 1) => "the drone that is late stands still".to_owned(),
        (0, late) => format!("the {late} drones that are late stand still"),
        (_, 1) => "slow: the drone that is late was moving".to_owned(),
        (moving, late) => format!("slow: {moving} of the {late} drones that are late were moving"),
    }
}

fn described(drones: &[&UnfinishedDrone]) -> String {
    let mut texts: Vec<String> = drones.iter().take(DESCRIBED).map(|drone| one(drone)).collect();
    if let more @ 1.. = drones.len().saturating_sub(DESCRIBED) {
        texts.push(format!("and {more} more"));
    }
    texts.join(", ")
}

fn one(drone: &UnfinishedDrone) -> String {
    let mut facts = Vec::new();
    if let (Some(gap_m), false) = (drone.slot_distance_m, drone.lack == Lack::Stop) {
        facts.push(format!("{gap_m:.0} m from the slot left for it"));
    }
    if drone.still_s >= STANDSTILL_S {
        facts.push(format!("still for {:.0} s", drone.still_s));
    }
    if let Some(stage) = drone.stage {
        facts.push(format!("before stage {}", stage + 1));
    }
    facts.push(match (drone.route, drone.rank, drone.phase) {
        (Some(route), Some(QueuePlace::NO_RANK), _) => {
            format!("behind all others in the queue of {} on route {route}", drone.group)
        }
        (Some(route), Some(rank), _) => {
            format!("place {} in the queue of {} on route {route}", u32::from(rank) + 1, drone.group)
        }
        (.., Phase::Cruise) => format!("cruises in {}", drone.group),
        (.., Phase::Avoid) => format!("avoids obstacles in {}", drone.group),
        (.., Phase::Reform) => format!("re-forms in {}", drone.group),
    });
    facts.push(drone.leader.map_or("obeys nobody".to_owned(), |leader| format!("obeys {leader}")));
    format!("drone {} ({})", drone.drone, facts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::DroneId;

    fn late(drone: u32, still_s: f64) -> UnfinishedDrone {
        UnfinishedDrone {
            drone: DroneId(drone),
            lack: Lack::Slot,
            slot_distance_m: Some(61.2),
            still_s,
            stage: Some(1),
            group: "N1".to_owned(),
            leader: Some(DroneId(7)),
            phase: Phase::Avoid,
            route: Some(0),
            rank: Some(1),
        }
    }

    #[test]
    fn a_standstill_is_named_with_its_drones() {
        assert_eq!(
            reason(932.0, &[late(3, 400.0)], Some(380.4)),
            "the time of 932 s is over; no drone has moved for 380 s; not in a slot: drone 3 (61 m from the slot left for it, \
             still for 400 s, before stage 2, place 2 in the queue of N1 on route 0, obeys 7)"
        );
    }

    #[test]
    fn a_drone_that_gave_its_place_up_is_named_as_the_last_of_its_queue() {
        let last = UnfinishedDrone { rank: Some(QueuePlace::NO_RANK), ..late(3, 400.0) };
        let text = reason(932.0, &[last], None);
        assert!(text.contains(", behind all others in the queue of N1 on route 0, "), "{text}");
    }

    #[test]
    fn a_slow_mission_is_told_from_one_that_stands_still_and_the_text_is_short() {
        let many: Vec<UnfinishedDrone> = (0..12).map(|drone| late(drone, if drone < 2 { 1.0 } else { 50.0 })).collect();
        let text = reason(60.0, &many, None);
        assert!(text.contains("slow: 2 of the 12 drones that are late were moving"), "{text}");
        assert!(text.contains("and 9 more") && text.len() < 500, "{text}");
        let text = reason(60.0, &[late(4, 20.0)], None);
        assert!(text.contains("; the drone that is late stands still; "), "{text}");
        assert_eq!(
            reason(60.0, &[], None),
            "the time of 60 s is over; each drone by itself has done its part, the swarm has not"
        );
    }
}
