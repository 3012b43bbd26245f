//! What arithmetic alone says against a scenario: it is valid, but it cannot work, or not at its nominal speed.

use crate::mission;
use skein_agent::PilotParams;
use skein_protocol::shape::{ConvexShape, ShapeError};
use skein_protocol::{DroneId, SimTime, Vec2};
use skein_scenario::{End, FaultKind, OutlineSensing, Parts, Scenario, Sensor};

/// The greatest speed from which a drone of this scenario stops within what it senses, m/s: before an obstacle at the edge of the
/// detection range, and before a drone that comes the other way at the edge of the ranging distance.
#[must_use]
pub fn speed_on_sight_mps(scenario: &Scenario) -> f64 {
    let params = pilot(scenario);
    params.speed_on_sight_mps(mission::reaction_ticks(scenario))
}

/// The distances that the drones of a scenario keep, with all margins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptDistances {
    /// Between two drones, as they read their positions, m.
    pub separation_m: f64,
    /// From the outline of an obstacle, as it is sensed, m.
    pub clearance_m: f64,
    /// Whether drones keep apart by messages alone.
    pub by_words: bool,
}

/// The distances that drones keep while nothing hinders them.
#[must_use]
pub fn kept_distances(scenario: &Scenario) -> KeptDistances {
    let params = pilot(scenario);
    KeptDistances {
        separation_m: params.separation_kept_m(),
        clearance_m: params.safety.clearance_m + params.sensing.obstacle_m,
        by_words: params.apart_by_words,
    }
}

/// Sentences about what cannot work in this scenario, each with its numbers and the keys to change. Empty if there is nothing.
///
/// # Errors
/// [`ShapeError`] if an obstacle has an invalid shape. A checked scenario has none.
pub fn warnings(scenario: &Scenario) -> Result<Vec<String>, ShapeError> {
    let shapes = scenario.shapes_in_the_way()?;
    let no_way = scenario.drones_without_a_way()?;
    let found = [
        too_fast(scenario, "drone.speed_mps", scenario.drone.speed_mps),
        too_fast(scenario, "mission.reform_speed_max_mps", scenario.reform_speed_max_mps()),
        too_short(scenario),
        slots_too_close(scenario),
        slots_out_of_reach(scenario),
        slots_too_blurred(scenario),
        goal_beside_an_obstacle(scenario, &shapes),
        radio_too_weak(scenario),
        radio_one_way(scenario),
        start_too_fast(scenario, &shapes),
        stops_unseen(scenario, &shapes),
        enclosed(&no_way, 2.0 * scenario.half_gap_m()),
        beyond_the_margin(
            "the position that a drone reads of itself",
            (scenario.position_error_possible_m(), scenario.position_error_max_m()),
            ("sensors.position_error_max_m", "m"),
        ),
        beyond_the_margin(
            "a drone's clock",
            (scenario.clock_error_possible_s(), scenario.clock_error_max_s()),
            ("sensors.clock_error_max_s", "s"),
        ),
    ];
    Ok(found.into_iter().flatten().chain(outside_the_proof(scenario)).chain(killed_by_words(scenario)).collect())
}

fn pilot(scenario: &Scenario) -> PilotParams {
    mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO)
}

fn too_fast(scenario: &Scenario, key: &str, speed_mps: f64) -> Option<String> {
    let limit_mps = speed_on_sight_mps(scenario);
    (speed_mps > limit_mps + 1e-9).then(|| {
        // A sum of two keys may end in a rounding error.
        let speed_mps = (speed_mps * 1e6).round() / 1e6;
        let ranging_m = scenario.ranging_m();
        format!(
            "{key} = {speed_mps} m/s, but drones fly at most {limit_mps:.2} m/s: from a higher speed they cannot stop within \
             sensors.detection_range_m = {} m and sensors.ranging_m = {ranging_m:.1} m",
            scenario.sensors.detection_range_m
        )
    })
}

/// A time limit in which the formation cannot fly to its destination.
fn too_short(scenario: &Scenario) -> Option<String> {
    let (way_m, speed_mps) = (scenario.way_m() - scenario.mission.arrival_error_m, scenario.drone.speed_max_mps);
    let (limit_s, least_s) = (scenario.timeout_s(), way_m / speed_mps);
    (limit_s < least_s).then(|| {
        format!(
            "time.timeout_s = {limit_s} s, but the formation's way to its destination is {way_m:.1} m long: at \
             drone.speed_max_mps = {speed_mps} m/s this takes {least_s:.1} s; raise time.timeout_s"
        )
    })
}

/// Slots that are closer together than the drones let each other come.
fn slots_too_close(scenario: &Scenario) -> Option<String> {
    let keep_m = pilot(scenario).separation_kept_m();
    let slots = scenario.slots();
    let nearest_m = nearest_pair_m(&slots)?;
    (nearest_m < keep_m).then(|| {
        format!(
            "the nearest slots of the formation are {nearest_m:.2} m apart, but drones keep {keep_m:.2} m \
             (drone.safe_distance_m, its margin, the reaction time, and twice sensors.position_error_max_m where words keep them \
             apart): the formation may not close; raise formation.spacing_m or lower drone.reaction_time_s"
        )
    })
}

/// A formation in parts that are too far apart for drones to hear each other.
fn slots_out_of_reach(scenario: &Scenario) -> Option<String> {
    let range_m = scenario.radio().beacon_range_m();
    if range_m.is_infinite() || scenario.mission.parts == Parts::Each {
        return None;
    }
    let gap_m = widest_gap_m(&scenario.slots())?;
    (gap_m > range_m).then(|| {
        format!(
            "two parts of the formation are {gap_m:.1} m apart, and drones hear each other over radio.range_m = {range_m} m: the \
             parts do not hear each other; raise radio.range_m, lower formation.spacing_m, or set mission.parts = \"each\""
        )
    })
}

/// An error of the drones' positions with which some drone is often farther from its slot than a drone in its slot may be.
fn slots_too_blurred(scenario: &Scenario) -> Option<String> {
    let (std_m, allowed_m) = (scenario.sensors.position_std_m, scenario.mission.arrival_error_m);
    let closes = matches!(scenario.mission.end, End::Hold | End::Goal);
    (closes && 2.0 * std_m > allowed_m).then(|| {
        format!(
            "sensors.position_std_m = {std_m} m, but a drone is in its slot within mission.arrival_error_m = {allowed_m} m: the \
             formation may not close while a drone is off by more than that; raise mission.arrival_error_m"
        )
    })
}

/// A slot at the goal from which an outline that is sensed wrongly may keep its drone away.
fn goal_beside_an_obstacle(scenario: &Scenario, shapes: &[(u32, ConvexShape)]) -> Option<String> {
    let goal = scenario.mission.goal_m.filter(|_| scenario.mission.end == End::Goal)?;
    let (error_m, clearance_m) = (scenario.sensors.obstacle_error_max_m, scenario.avoidance.clearance_m);
    // The outline may be sensed nearer than it is, and the drone allows for one that is nearer than it is sensed.
    let (away_m, arrived_m) = (clearance_m + 2.0 * error_m, scenario.mission.arrival_error_m);
    let slots: Vec<Vec2> = scenario.slots().iter().map(|slot| slot + Vec2::from(goal)).collect();
    let distances = slots.iter().enumerate().flat_map(|(number, &at)| {
        let distance_m = move |shape| skein_agent::braking_filter::distance_m(shape, at, at);
        shapes.iter().map(move |(id, shape)| (number, *id, distance_m(shape)))
    });
    let (number, obstacle, nearest_m) = distances.min_by(|a, b| a.2.total_cmp(&b.2))?;
    (nearest_m + arrived_m < away_m - 1e-6).then(|| {
        let at = slots[number];
        format!(
            "goal slot {number} at [{:.3}, {:.3}] m is {nearest_m:.2} m from obstacle {obstacle}, but with \
             sensors.obstacle_error_max_m = {error_m} m a drone may have to stay {away_m:.2} m away from it, and it arrives within \
             mission.arrival_error_m = {arrived_m} m: the mission may not end; move mission.goal_m, or raise mission.arrival_error_m",
            at.x, at.y
        )
    })
}

/// A radio over which drones do not hear each other, or hear each other late.
fn radio_too_weak(scenario: &Scenario) -> Option<String> {
    let radio = &scenario.radio;
    if scenario.formation.drones < 2 {
        return None;
    }
    if radio.loss >= 1.0 {
        return Some("radio.loss = 1: no drone hears another one".to_owned());
    }
    let messages = skein_agent::separation::messages(mission::drones(scenario));
    let (rate_bps, beacons_bps) = (radio.rate_bps?, scenario.beacons_bps(messages));
    (beacons_bps > rate_bps / 2.0).then(|| {
        format!(
            "radio.rate_bps = {rate_bps} bit/s, but the beacons of the {} drones that share it take {beacons_bps:.0} bit/s alone: with all \
             other messages the channel may be full, and messages late or dropped; raise radio.rate_bps or protocol.peer_timeout_s",
            scenario.channel_drones()
        )
    })
}

/// A radio over which a drone may hear another one that does not hear it.
fn radio_one_way(scenario: &Scenario) -> Option<String> {
    let (loss, asymmetry) = (scenario.radio.loss, scenario.radio.asymmetry);
    let one_way = scenario.formation.drones > 1 && loss < 1.0 && loss * (1.0 + asymmetry) >= 1.0;
    one_way.then(|| {
        format!(
            "radio.loss = {loss} with radio.asymmetry = {asymmetry}: a link may lose all frames in one direction; lower one of them"
        )
    })
}

/// The least range over which all points are connected, over any number of others, m; `None` for fewer than two. The longest edge of a
/// minimum spanning tree (Prim).
fn widest_gap_m(points: &[Vec2]) -> Option<f64> {
    let (first, others) = points.split_first()?;
    let mut left: Vec<(Vec2, f64)> = others.iter().map(|point| (*point, (point - first).norm())).collect();
    let mut widest_m: Option<f64> = None;
    while let Some(next) = (0..left.len()).min_by(|&a, &b| left[a].1.total_cmp(&left[b].1)) {
        let (joined, gap_m) = left.swap_remove(next);
        widest_m = Some(widest_m.map_or(gap_m, |widest_m| widest_m.max(gap_m)));
        left.iter_mut().for_each(|(point, gap_m)| *gap_m = gap_m.min((*point - joined).norm()));
    }
    widest_m
}

/// Distance of the two nearest points, m; `None` for fewer than two. A sweep along x.
fn nearest_pair_m(points: &[Vec2]) -> Option<f64> {
    let mut order: Vec<Vec2> = points.to_vec();
    order.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut nearest_m = f64::INFINITY;
    for (i, a) in order.iter().enumerate() {
        for b in &order[i + 1..] {
            if b.x - a.x >= nearest_m {
                break;
            }
            nearest_m = nearest_m.min((b - a).norm());
        }
    }
    nearest_m.is_finite().then_some(nearest_m)
}

/// A drone that starts so close to an obstacle that it cannot stop before it.
fn start_too_fast(scenario: &Scenario, shapes: &[(u32, ConvexShape)]) -> Option<String> {
    let (stop_m, clearance_m) = (scenario.stopping_distance_m(), scenario.avoidance.clearance_m);
    scenario.starts().into_iter().enumerate().find_map(|(drone, start)| {
        let end = start + scenario.course().direction() * stop_m;
        let distance_m = |(id, shape): &(u32, ConvexShape)| (*id, skein_agent::braking_filter::distance_m(shape, start, end));
        let (obstacle, nearest_m) =
            shapes.iter().map(distance_m).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (nearest_m < clearance_m).then(|| {
            format!(
                "drone {drone} starts at {} m/s and stops within {stop_m:.2} m, {nearest_m:.2} m from obstacle {obstacle}, \
                 expected at least avoidance.clearance_m = {clearance_m} m: it cannot keep the clearance",
                scenario.drone.speed_mps
            )
        })
    })
}

/// A formation that stops before any drone senses the first obstacle.
fn stops_unseen(scenario: &Scenario, shapes: &[(u32, ConvexShape)]) -> Option<String> {
    let (stop_x_m, range_m) = (scenario.mission.stop_x_m, scenario.sensors.detection_range_m);
    if scenario.mission.end != End::Hold || shapes.is_empty() {
        return None;
    }
    let first_x_m = shapes.iter().map(|(_, shape)| shape.bounds().0.x).fold(f64::INFINITY, f64::min);
    (stop_x_m + range_m < first_x_m).then(|| {
        format!(
            "the formation stops at mission.stop_x_m = {stop_x_m} m and senses {range_m} m far, but the first obstacle begins at \
             x = {first_x_m:.1} m: no drone senses an obstacle before the mission ends"
        )
    })
}

/// An error of a sensor that can be greater, with its faults, than the margins allow for. `key`: what bounds it, and its unit.
fn beyond_the_margin(what: &str, (possible, allowed): (f64, f64), (key, unit): (&str, &str)) -> Option<String> {
    (possible > allowed + 1e-9).then(|| {
        // Rounded up, so that the key can be set to it.
        let possible = (possible * 1e3 - 1e-6).ceil() / 1e3;
        format!(
            "{what} may be wrong by {possible:.3} {unit} with all faults, but the margins allow for {allowed:.3} {unit}: the flight is \
             outside the safety statement; raise {key} to {possible:.3} at least"
        )
    })
}

/// The faults of kinds for which nothing is proved (docs/safety.md, "Outside the scope of the proof"), a sentence for each.
fn outside_the_proof(scenario: &Scenario) -> impl Iterator<Item = String> {
    scenario.fault_plan.iter().enumerate().filter_map(|(number, fault)| {
        let reason = match fault.kind {
            FaultKind::Wind => "wind weakens braking",
            FaultKind::Slow => "commands that were given take effect later than planned",
            FaultKind::Noise if fault.velocity_bias_mps.is_some() || fault.velocity_std_mps.is_some() => {
                "no margin allows for a wrong velocity"
            }
            FaultKind::Blind
                if fault.sensor != Some(Sensor::Ranging)
                    && !scenario.obstacles.is_empty()
                    && scenario.sensors.outline == OutlineSensing::Whole =>
            {
                "the drone may hit an obstacle that nobody has reported; while it hears no drone whose sensors work, or with sensors.outline = \"seen\", it hovers"
            }
            _ => return None,
        };
        Some(format!("fault.{number} ({}) is outside the safety statement: {reason}", fault.kind.word()))
    })
}

/// The faults that kill a drone for good where drones keep apart by words: nobody may pass into its half of the plane any more.
fn killed_by_words(scenario: &Scenario) -> impl Iterator<Item = String> {
    let by_words = pilot(scenario).apart_by_words;
    let kills = scenario.fault_plan.iter().enumerate().filter(|(_, fault)| match fault.kind {
        FaultKind::Kill => true,
        FaultKind::HostDown => fault.for_s.is_none(),
        _ => false,
    });
    kills.filter(move |_| by_words).map(|(number, fault)| {
        format!(
            "fault.{number} ({}): without ideal ranging, the others stay on their sides of their last lines to a killed drone. \
             Distances are kept, but a mission that has to pass there does not arrive",
            fault.kind.word()
        )
    })
}

fn enclosed(drones: &[u32], gap_m: f64) -> Option<String> {
    let ids: Vec<String> = drones.iter().map(u32::to_string).collect();
    (!ids.is_empty()).then(|| {
        format!(
            "obstacles whose gaps are narrower than {gap_m:.3} m, which a drone needs, enclose drone {} or the goal: the mission ends as stuck",
            ids.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_scenario::ScenarioSource;

    fn warned(text: &str) -> String {
        let text =
            if text.contains("[formation]") { text.to_owned() } else { format!("[formation]\ndrones = 8\n{text}") };
        let scenario = Scenario::parse(&text, ScenarioSource { name: "test", stem: "test" }, &[]).unwrap();
        warnings(&scenario).unwrap().join("\n")
    }

    #[test]
    fn a_scenario_that_works_gives_no_warning() {
        assert_eq!(warned("[formation]\ndrones = 8\n"), "");
    }

    #[test]
    fn errors_of_sensors_add_to_the_distances() {
        let kept = |keys: &str| {
            let text = format!("[formation]\ndrones = 8\n[sensors]\nobstacle_error_max_m = 0.5\n{keys}");
            kept_distances(&Scenario::parse(&text, ScenarioSource { name: "test", stem: "test" }, &[]).unwrap())
        };
        let (ranged, said) = (kept("position_std_m = 2\n"), kept("position_std_m = 2\nranging = false\n"));
        assert!(!ranged.by_words && said.by_words && ranged.clearance_m == 15.5);
        assert!((said.separation_m - (1.01 * 35.0 + 12.0)).abs() < 1e-9, "{said:?}");
        assert!(ranged.separation_m < 38.0, "{ranged:?}");
        assert!(warned("[sensors]\nposition_std_m = 2\nranging = false\n").contains("sensors.position_error_max_m"));
    }

    #[test]
    fn faults_of_sensors_add_to_the_margins_or_are_warned_of() {
        let fault = |keys: &str| format!("[[fault]]\nat_s = 5\ndrone = 1\n{keys}");
        let gnss = fault("kind = \"gnss\"\nposition_bias_m = [3, 4]\n");
        assert_eq!(warned(&gnss), "", "the margins allow for it");
        let noisy = "[mission]\narrival_error_m = 1\n[sensors]\nposition_std_m = 0.5\n";
        let less = warned(&format!("{noisy}position_error_max_m = 4\n{gnss}"));
        assert!(less.contains("wrong by 6.500 m with all faults, but the margins allow for 4.000 m"), "{less}");
        assert_eq!(warned(&format!("{noisy}position_error_max_m = 6.5\n{gnss}")), "");
        let noise = warned(&fault("kind = \"noise\"\nposition_bias_m = [3, 4]\n"));
        assert!(noise.contains("5.000 m with all faults, but the margins allow for 0.000 m"), "{noise}");
        let clock = fault("kind = \"clock\"\nclock_offset_s = -1\n");
        assert_eq!(warned(&clock), "");
        let less = warned(&format!("[sensors]\nclock_error_max_s = 0.5\n{clock}"));
        assert!(
            less.contains("wrong by 1.000 s") && less.contains("raise sensors.clock_error_max_s to 1.000"),
            "{less}"
        );
    }

    #[test]
    fn faults_outside_the_safety_statement_are_warned_of() {
        let wall = "[[obstacle]]\nshape = \"rectangle\"\nhalf_size_m = [5, 50]\ncentre_m = [150, 0]\n";
        let fault = |keys: &str| warned(&format!("{wall}[[fault]]\nat_s = 5\ntarget = \"all\"\n{keys}"));
        let wind = fault("kind = \"wind\"\ngust_mps2 = 0.5\n");
        assert_eq!(wind, "fault.0 (wind) is outside the safety statement: wind weakens braking");
        assert!(fault("kind = \"slow\"\nreaction_time_s = 0.1\n").contains("fault.0 (slow) is outside"));
        assert!(fault("kind = \"noise\"\nvelocity_std_mps = 0.1\n").contains("fault.0 (noise) is outside"));
        assert!(fault("kind = \"blind\"\n").contains("sensors.outline"));
        assert_eq!(fault("kind = \"blind\"\nsensor = \"ranging\"\n"), "");
        assert_eq!(fault("kind = \"blind\"\n[sensors]\noutline = \"seen\"\n"), "");
        assert_eq!(fault("kind = \"freeze\"\nfor_s = 1\n"), "");
    }

    #[test]
    fn a_fault_of_ranging_leaves_the_distances_to_words() {
        let text =
            "[formation]\ndrones = 8\n[[fault]]\nkind = \"ranging\"\nat_s = 5\ndrone = 1\nranging_dropout_share = 1\n";
        let scenario = Scenario::parse(text, ScenarioSource { name: "test", stem: "test" }, &[]).unwrap();
        assert!(kept_distances(&scenario).by_words);
    }

    #[test]
    fn a_drone_that_is_killed_by_words_is_warned_of() {
        let kill = "[[fault]]\nkind = \"kill\"\nat_s = 5\ndrone = 1\n";
        assert_eq!(warned(kill), "");
        assert!(
            warned(&format!("[sensors]\nranging = false\n{kill}")).starts_with("fault.0 (kill): without ideal ranging")
        );
    }

    #[test]
    fn a_radio_that_is_too_weak_is_warned_of() {
        assert!(warned("[radio]\nloss = 1").contains("no drone hears another one"));
        assert!(warned("[radio]\nloss = 0.7\nasymmetry = 1").contains("a link may lose all frames in one direction"));
        assert_eq!(warned("[radio]\nloss = 0.7\nasymmetry = 0.4"), "");
        assert_eq!(warned("[formation]\ndrones = 1\n[radio]\nloss = 0.7\nasymmetry = 1"), "");
        assert!(warned("[radio]\nrate_bps = 20_000").contains("raise radio.rate_bps"));
        assert_eq!(warned("[radio]\nrate_bps = 100_000"), "");
        assert_eq!(warned("[formation]\ndrones = 1\n[radio]\nloss = 1"), "");
    }

    #[test]
    fn positions_that_are_too_uncertain_for_slots_are_warned_of() {
        assert!(warned("[sensors]\nposition_std_m = 0.5").contains("raise mission.arrival_error_m"));
        assert_eq!(warned("[sensors]\nposition_std_m = 0.5\n[mission]\narrival_error_m = 1"), "");
    }

    #[test]
    fn a_goal_slot_that_a_wrong_outline_may_keep_free_is_warned_of() {
        let beside = |keys: &str| {
            warned(&format!(
                "[formation]\ndrones = 3\nshape = \"line\"\nspacing_m = 60\n[mission]\nend = \"goal\"\ngoal_m = [600, 0]\n{keys}\
                 [[obstacle]]\nshape = \"rectangle\"\nhalf_size_m = [30, 10]\ncentre_m = [600, 85.2]\n"
            ))
        };
        assert_eq!(beside(""), "");
        assert_eq!(beside("[sensors]\nobstacle_error_max_m = 0.4\n"), "");
        let close = beside("[sensors]\nobstacle_error_max_m = 1.5\n");
        assert!(close.starts_with("goal slot 1 at [600.000, 60.000] m is 15.20 m from obstacle 0"), "{close}");
        assert!(close.contains("stay 18.00 m away") && close.contains("raise mission.arrival_error_m"), "{close}");
        assert_eq!(beside("arrival_error_m = 3\n[sensors]\nobstacle_error_max_m = 1.5\n"), "");
    }

    #[test]
    fn a_time_limit_that_is_too_short_is_warned_of() {
        let far = |limit: &str| format!("[formation]\ndrones = 1\n[mission]\nstop_x_m = 5000\n{limit}");
        assert_eq!(warned(&far("")), "");
        assert!(warned(&far("[time]\ntimeout_s = 200")).contains("raise time.timeout_s"));
    }

    #[test]
    fn a_formation_whose_parts_do_not_hear_each_other_is_warned_of() {
        let line = "[formation]\ndrones = 6\nshape = \"line\"\nspacing_m = 60\n";
        assert_eq!(warned(&format!("{line}[radio]\nrange_m = 61\n")), "", "drones pass on what others do not hear");
        let cut = warned(&format!("{line}[radio]\nrange_m = 59\n"));
        assert!(cut.contains("60.0 m apart") && cut.contains("radio.range_m = 59 m"), "{cut}");
        assert_eq!(warned(&format!("{line}[mission]\nparts = \"each\"\n[radio]\nrange_m = 59\n")), "");
    }

    #[test]
    fn a_sum_of_two_keys_has_no_rounding_error() {
        let fast = warned("[drone]\nspeed_mps = 0.63\nspeed_change_mps = 0.63\n[sensors]\ndetection_range_m = 15.05\n");
        assert!(fast.contains("mission.reform_speed_max_mps = 1.26 m/s"), "{fast}");
    }

    #[test]
    fn each_warning_names_its_keys() {
        let blind = warned("[drone]\nspeed_mps = 12\n[sensors]\nranging_m = 36\n");
        assert!(blind.contains("drone.speed_mps = 12") && blind.contains("sensors.ranging_m"), "{blind}");
        let late = warned("[drone]\nreaction_time_s = 1.5\n[sensors]\ndetection_range_m = 200\n");
        assert!(late.contains("formation.spacing_m"), "{late}");
        let wall = "[[obstacle]]\nshape = \"rectangle\"\nhalf_size_m = [5, 50]\ncentre_m = ";
        let close = warned(&format!("{wall}[27, 0]\n"));
        assert!(close.contains("drone 0 starts at 10 m/s") && close.contains("obstacle 0"), "{close}");
        let unseen = warned(&format!("[mission]\nstop_x_m = 100\n{wall}[900, 0]\n"));
        assert!(unseen.contains("mission.stop_x_m = 100"), "{unseen}");
        let ring: String = [(0, 100, 100, 5), (0, -100, 100, 5), (-95, 0, 5, 100), (95, 0, 5, 100)]
            .map(|(x, y, hx, hy)| {
                format!("[[obstacle]]\nshape = \"rectangle\"\nhalf_size_m = [{hx}, {hy}]\ncentre_m = [{x}, {y}]\n")
            })
            .concat();
        let caught = warned(&format!("[formation]\ndrones = 1\n{ring}"));
        assert!(caught.contains("narrower than 30.008 m") && caught.contains("enclose drone 0"), "{caught}");
    }
}
