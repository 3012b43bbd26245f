//! Rules between keys, and the geometry of start, goal and obstacles.

use crate::broken_rule::{BrokenRule, quantity};
use crate::keys::{End, Parts, Scenario};
use crate::name::is_name_char;
use crate::node::number;
use crate::strategy::Strategy;
use crate::{fault_rules, host_rules, near, pilot_rules};
use skein_protocol::Vec2;
use skein_protocol::shape::{ConvexShape, ShapeError};

/// Tolerance for the rounding of slots and shapes, m.
const ROUNDING_M: f64 = 1e-6;

/// All rules that a scenario breaks whose keys are valid one by one.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let mut rules = Rules { scenario, broken: Vec::new() };
    rules.name();
    rules.speeds();
    rules.distances();
    rules.periods();
    rules.mission();
    rules.strategy();
    rules.spacing();
    rules.obstacles();
    rules.broken.extend(crate::radio::broken(scenario));
    rules.broken.extend(fault_rules::broken(scenario));
    rules.broken.extend(pilot_rules::broken(scenario));
    rules.broken.extend(host_rules::broken(scenario));
    rules.broken
}

struct Rules<'a> {
    scenario: &'a Scenario,
    broken: Vec<BrokenRule>,
}

impl Rules<'_> {
    fn expect(&mut self, holds: bool, keys: &[&str], message: impl FnOnce() -> String) {
        if !holds {
            let keys = keys.iter().map(|k| (*k).to_owned()).collect();
            self.broken.push(BrokenRule { keys, message: message() });
        }
    }

    /// The first key's value must not exceed the second's.
    fn at_most(&mut self, (low_key, low): (&str, f64), (high_key, high): (&str, f64), unit: &str) {
        let (found, limit) = (quantity(low, unit), quantity(high, unit));
        self.expect(low <= high, &[low_key, high_key], || {
            format!("found {found}, expected at most {high_key} = {limit}")
        });
    }

    fn name(&mut self) {
        let name = &self.scenario.name;
        let first = name.chars().next();
        let starts = first.is_some_and(|c| c.is_ascii_alphanumeric() || c == '_');
        let fits = name.len() <= 64 && name.chars().all(is_name_char);
        self.expect(starts && fits, &["name"], || {
            format!("found {name:?}, expected 1 to 64 letters, digits, `.`, `_` or `-`, a letter, digit or `_` first")
        });
    }

    fn speeds(&mut self) {
        let (drone, mission) = (&self.scenario.drone, &self.scenario.mission);
        let (nominal, top) = (("drone.speed_mps", drone.speed_mps), ("drone.speed_max_mps", drone.speed_max_mps));
        self.at_most(nominal, top, "m/s");
        self.at_most(("drone.speed_change_mps", drone.speed_change_mps), nominal, "m/s");
        if let Some(reform_mps) = mission.reform_speed_max_mps {
            self.at_most(("mission.reform_speed_max_mps", reform_mps), top, "m/s");
        }
        let margin_m = self.scenario.avoidance.clearance_m.min(drone.safe_distance_m) / 4.0;
        let step_m = drone.speed_max_mps * self.scenario.time.dt_s;
        let keys = ["time.dt_s", "drone.speed_max_mps", "avoidance.clearance_m", "drone.safe_distance_m"];
        self.expect(step_m <= margin_m, &keys, || {
            let (dt, longest) = (number(self.scenario.time.dt_s), number(margin_m / drone.speed_max_mps));
            format!(
                "found {dt} s, in which a drone moves {} at drone.speed_max_mps, expected at most {longest} s: a quarter \
                 of the smaller of avoidance.clearance_m and drone.safe_distance_m",
                quantity(step_m, "m")
            )
        });
    }

    fn distances(&mut self) {
        let Scenario { avoidance, sensors, .. } = self.scenario;
        let clearance = ("avoidance.clearance_m", avoidance.clearance_m);
        self.at_most(clearance, ("formation.altitude_m", self.scenario.altitude_m()), "m");
        self.expect(
            avoidance.planning_distance_m >= clearance.1,
            &["avoidance.planning_distance_m", clearance.0],
            || {
                let (found, least) = (quantity(avoidance.planning_distance_m, "m"), quantity(clearance.1, "m"));
                format!("found {found}, expected at least avoidance.clearance_m = {least}")
            },
        );
        let stop_m = self.scenario.stopping_distance_m();
        let least_m = stop_m + avoidance.clearance_m;
        let keys = [
            "sensors.detection_range_m",
            "drone.speed_mps",
            "drone.drag_coefficient",
            "drone.reaction_time_s",
            "drone.acceleration_max_mps2",
            "avoidance.clearance_m",
        ];
        self.expect(sensors.detection_range_m >= least_m - ROUNDING_M, &keys, || {
            format!(
                "found {}, expected at least {}: the stopping distance {} at drone.speed_mps plus avoidance.clearance_m",
                quantity(sensors.detection_range_m, "m"),
                quantity(least_m, "m"),
                quantity(stop_m, "m")
            )
        });
    }

    fn periods(&mut self) {
        let p = &self.scenario.protocol;
        let heartbeat = ("protocol.heartbeat_period_s", p.heartbeat_period_s);
        self.at_most(heartbeat, ("protocol.leader_timeout_s", p.leader_timeout_s), "s");
        let peer_timeout = ("protocol.peer_timeout_s", p.peer_timeout_s);
        if let Some(beacon_s) = p.beacon_period_s {
            self.at_most(("protocol.beacon_period_s", beacon_s), peer_timeout, "s");
        }
    }

    fn mission(&mut self) {
        let mission = &self.scenario.mission;
        self.expect(mission.end != End::Goal || mission.goal_m.is_some(), &["mission.goal_m", "mission.end"], || {
            "is missing: mission.end = \"goal\" needs the position of the front slot, [x, y]".to_owned()
        });
        self.expect(
            mission.end != End::Time || mission.duration_s.is_some(),
            &["mission.duration_s", "mission.end"],
            || "is missing: mission.end = \"time\" needs the duration of the mission".to_owned(),
        );
        self.expect(mission.parts == Parts::One || mission.end == End::Hold, &["mission.parts", "mission.end"], || {
            "found mission.parts = \"each\", expected it with mission.end = \"hold\" alone: two parts cannot share one goal".to_owned()
        });
        if let (End::Time, Some(duration_s), Some(timeout_s)) =
            (mission.end, mission.duration_s, self.scenario.time.timeout_s)
        {
            self.at_most(("mission.duration_s", duration_s), ("time.timeout_s", timeout_s), "s");
        }
    }

    fn strategy(&mut self) {
        let Strategy::Fixed { left, right } = self.scenario.strategy else { return };
        let (sum, drones) = (u64::from(left) + u64::from(right), self.scenario.formation.drones);
        self.expect(sum == u64::from(drones), &["strategy", "formation.drones"], || {
            format!("found fixed:{left}/{right}, {sum} drones, expected a sum of formation.drones = {drones}")
        });
        let obstacles = self.scenario.obstacles.len();
        self.expect(obstacles == 1, &["strategy", "obstacle"], || {
            format!("found fixed:{left}/{right} with {obstacles} obstacles, expected exactly one [[obstacle]]")
        });
    }

    fn spacing(&mut self) {
        let Scenario { formation, drone, .. } = self.scenario;
        let before = self.broken.len();
        if formation.offsets_m.is_some() {
            self.apart("formation.offsets_m", "slots", &self.scenario.slots());
        } else {
            let fits = formation.drones < 2 || formation.spacing_m >= drone.safe_distance_m;
            self.expect(fits, &["formation.spacing_m", "drone.safe_distance_m"], || {
                let (found, least) = (quantity(formation.spacing_m, "m"), quantity(drone.safe_distance_m, "m"));
                format!("found {found}, expected at least drone.safe_distance_m = {least}")
            });
        }
        if self.broken.len() == before && formation.start_jitter_m > 0.0 {
            self.apart("formation.start_jitter_m", "drones", &self.scenario.starts());
        }
    }

    fn apart(&mut self, key: &str, what: &str, points: &[Vec2]) {
        let safe_m = self.scenario.drone.safe_distance_m;
        let Some(close) = near::closest_pair(points, safe_m - ROUNDING_M) else { return };
        let (a, b) = close.pair;
        let others = if close.pairs > 1 { format!(" ({} such pairs)", close.pairs) } else { String::new() };
        self.expect(false, &[key, "drone.safe_distance_m", "formation.spacing_m", "seed"], || {
            format!(
                "{what} {a} and {b} are {} apart at the start{others}, expected at least drone.safe_distance_m = {}",
                quantity(close.distance_m, "m"),
                quantity(safe_m, "m")
            )
        });
    }

    fn obstacles(&mut self) {
        let starts = self.scenario.starts();
        let goal = self.scenario.mission.goal_m.filter(|_| self.scenario.mission.end == End::Goal);
        let goals: Option<Vec<Vec2>> =
            goal.map(|goal| self.scenario.slots().iter().map(|slot| slot + Vec2::from(goal)).collect());
        for (i, obstacle) in self.scenario.obstacles.iter().enumerate() {
            match obstacle.shape() {
                Ok(shape) => {
                    self.clear_of(i, &shape, ("start", "formation.start_m"), &starts);
                    if let Some(goals) = &goals {
                        self.clear_of(i, &shape, ("goal", "mission.goal_m"), goals);
                    }
                }
                Err(ShapeError::Heights) => self.expect(false, &[&format!("obstacle.{i}.top_m")], || {
                    let (floor_m, top_m) = obstacle.heights_m();
                    let found = |height_m: Option<f64>| height_m.map_or("none".to_owned(), |m| quantity(m, "m"));
                    format!("found {}, expected more than floor_m = {}", found(top_m), found(floor_m))
                }),
                Err(ShapeError::NotConvex) => self.expect(false, &[&format!("obstacle.{i}.vertices_m")], || {
                    "found corners that do not form a convex polygon, expected corners in order that all turn the same \
                     way, none of them straight or repeated"
                        .to_owned()
                }),
                Err(error) => self.expect(false, &[&format!("obstacle.{i}")], || error.to_string()),
            }
        }
    }

    /// Checks that the slots of the start or of the goal keep the clearance from obstacle `i`.
    fn clear_of(&mut self, i: usize, shape: &ConvexShape, (end, key): (&str, &str), slots: &[Vec2]) {
        let clearance_m = self.scenario.avoidance.clearance_m;
        if !shape.blocks(self.scenario.altitude_m(), clearance_m - ROUNDING_M) {
            return;
        }
        let Some(close) = near::closest_slot(shape, slots, clearance_m - ROUNDING_M) else { return };
        let at = slots[close.slot];
        let place = match close.distance_m {
            d if d > 0.0 => format!("{} from it", quantity(d, "m")),
            _ => "inside it".to_owned(),
        };
        let others = if close.slots > 1 { format!(" ({} such slots)", close.slots) } else { String::new() };
        let keys = [&format!("obstacle.{i}"), key, "formation.spacing_m", "formation.drones", "avoidance.clearance_m"];
        self.expect(false, &keys, || {
            format!(
                "{end} slot {} at [{:.3}, {:.3}] m is {place}{others}, expected at least avoidance.clearance_m = {}",
                close.slot,
                at.x,
                at.y,
                quantity(clearance_m, "m")
            )
        });
    }
}
