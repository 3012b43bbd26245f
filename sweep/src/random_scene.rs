//! Random scenes: a formation, obstacles and a destination that follow from a seed alone. Start and end lie clear of all
//! obstacles in an unbounded plane, so a free path always exists.
//!
//! The destination is drawn without looking at the obstacles. It lies beyond the whole field in which obstacles may be, so
//! it tells a swarm neither how many obstacles there are nor which one is the last.

use crate::error::SceneError;
use crate::splitmix::SplitMix64;
use skein_leader::geometry::separation;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use skein_scenario::{Scenario, ScenarioErrors, ScenarioSource};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// How many drones and obstacles a scene may have, each as least and greatest number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SceneBounds {
    /// Number of drones, from 1 to 64.
    pub drones: [u32; 2],
    /// Number of obstacles, from 0 to 8.
    pub obstacles: [u32; 2],
    /// How far the last slot at the destination is behind the last obstacle, m, from 40 to 10 000. `None`: the destination is drawn
    /// without the obstacles, beyond the field in which they may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room_m: Option<u32>,
}

impl SceneBounds {
    /// Returns these bounds if scenes can be made within them.
    ///
    /// # Errors
    /// [`SceneError::Bounds`].
    pub fn checked(self) -> Result<Self, SceneError> {
        let limits = [("drones", self.drones, [1, 64]), ("obstacles", self.obstacles, [0, 8])];
        for (what, [least, most], [lowest, highest]) in limits {
            if least > most || least < lowest || most > highest {
                return Err(SceneError::Bounds { what, least, most, lowest, highest });
            }
        }
        match self.room_m {
            Some(room_m) if !(LEAST_ROOM_M..=MOST_ROOM_M).contains(&room_m) => {
                Err(SceneError::Room { found: room_m, lowest: LEAST_ROOM_M, highest: MOST_ROOM_M })
            }
            _ => Ok(self),
        }
    }
}

impl Default for SceneBounds {
    fn default() -> Self {
        Self { drones: [5, 16], obstacles: [1, 4], room_m: None }
    }
}

/// Clearance of every scene, m.
const CLEARANCE_M: f64 = 15.0;
/// Planning distance of every scene, m.
const PLANNING_M: f64 = 20.0;

/// Bounds of a given distance of the destination behind the last obstacle, m. With less, its slots could not be reached.
const LEAST_ROOM_M: u32 = 40;
const MOST_ROOM_M: u32 = 10_000;

/// A gap narrower than this is closed, in units of the narrowest passable gap.
const CLOSED: f64 = 0.9;
/// A gap wider than this is open, in the same unit. No scene has a gap between the two limits, because rounding would
/// decide whether it is open.
const OPEN: f64 = 1.2;

/// The field in which obstacles may be begins at this abscissa, m.
const FIELD_M: f64 = 120.0;
/// The least length of the field, m, and the range of what each obstacle adds to it, m.
const FIELD_LENGTH_M: (f64, [f64; 2]) = (80.0, [50.0, 250.0]);
/// An obstacle reaches at most this far from its centre, m.
const REACH_M: f64 = 100.0;
/// Room that is drawn between the field and the destination, m.
const ROOM_M: [f64; 2] = [0.0, 400.0];
/// Key of the stream from which the destination is drawn, beside those of the attempts.
const DESTINATIONS: u64 = 0xde57_0000;

/// Attempts to place one obstacle before the scene is drawn again.
const PLACES: usize = 32;
/// Attempts to draw a scene before giving up.
const SCENES: u64 = 64;

/// The scene of this seed, as the TOML text of a scenario.
///
/// # Errors
/// [`SceneError::NoScene`] if no valid scene was found.
pub fn scene_toml(seed: u64, bounds: SceneBounds) -> Result<String, SceneError> {
    let mut last = None;
    for attempt in 0..SCENES {
        let room_m = SplitMix64::keyed(seed, DESTINATIONS + attempt).between(ROOM_M[0], ROOM_M[1]);
        let Some(text) = scene(&mut SplitMix64::keyed(seed, attempt), seed, bounds, room_m) else { continue };
        match parse(seed, &text, &[]) {
            Ok(_) => return Ok(text),
            Err(error) => last = Some(error),
        }
    }
    Err(SceneError::NoScene { seed, attempts: SCENES, last })
}

/// The checked scenario of this seed's scene, with these overrides (key path and TOML value).
///
/// # Errors
/// As [`scene_toml`], and [`SceneError::Overrides`] if the overrides do not fit the scene.
pub fn random_scene(seed: u64, bounds: SceneBounds, overrides: &[(String, String)]) -> Result<Scenario, SceneError> {
    parse(seed, &scene_toml(seed, bounds)?, overrides).map_err(SceneError::Overrides)
}

fn parse(seed: u64, text: &str, overrides: &[(String, String)]) -> Result<Scenario, ScenarioErrors> {
    let name = format!("random-{seed}");
    Scenario::parse(text, ScenarioSource { name: &name, stem: &name }, overrides)
}

/// An obstacle and its table in the scenario.
struct PlacedObstacle {
    shape: ConvexShape,
    toml: String,
}

/// Half the width of a formation across the direction of flight, and its depth along it, m.
struct Extent {
    half_width_m: f64,
    depth_m: f64,
}

/// One attempt at a scene; `None` if an obstacle found no place. `room_m`: between the field and the destination, m.
fn scene(rng: &mut SplitMix64, seed: u64, bounds: SceneBounds, room_m: f64) -> Option<String> {
    let drones = rng.integer(bounds.drones[0], bounds.drones[1]);
    let shape = rng.one(&["nested-v", "v", "line", "column", "grid", "circle"]);
    let safe_m = rng.between(20.0, 40.0).round();
    // Rounded up: the spacing is 1.5 safe distances at least.
    let spacing_m = (safe_m * rng.between(1.5, 2.5)).ceil();
    let count = rng.integer(bounds.obstacles[0], bounds.obstacles[1]);
    let extent = extent(shape, drones, spacing_m);
    let obstacles = obstacles(rng, count, extent.half_width_m)?;
    // Where the formation comes to rest: its last slot is beyond the planning distance of any obstacle that there may be.
    let last_m = obstacles.iter().map(|obstacle| obstacle.shape.bounds().1.x).fold(FIELD_M, f64::max);
    let behind_m = bounds.room_m.map(|room_m| last_m + f64::from(room_m));
    let end_x_m = (behind_m.unwrap_or(field_end_m(bounds) + room_m + PLANNING_M) + extent.depth_m).ceil();
    let mission = match rng.integer(0, 2) {
        0 => format!("end = \"goal\"\ngoal_m = [{end_x_m}, 0]"),
        _ => format!("end = \"hold\"\nstop_x_m = {end_x_m}"),
    };
    let mut text = format!("# Random scene {seed}.\n\nname = \"random-{seed}\"\nseed = {seed}\n");
    let _ = write!(text, "\n[time]\ntimeout_s = 600\n");
    let _ = write!(text, "\n[formation]\nshape = \"{shape}\"\ndrones = {drones}\nspacing_m = {spacing_m}\n");
    let _ = write!(text, "\n[mission]\n{mission}\nreform_speed_max_mps = {}\n", rng.one(&["10", "15", "20"]));
    let _ = write!(text, "\n[drone]\nsafe_distance_m = {safe_m}\n");
    let _ = write!(text, "\n[sensors]\ndetection_range_m = {}\n", rng.between(60.0, 120.0).round());
    let _ = write!(text, "\n[avoidance]\nclearance_m = {CLEARANCE_M}\nplanning_distance_m = {PLANNING_M}\n");
    for obstacle in &obstacles {
        text.push_str(&obstacle.toml);
    }
    Some(text)
}

/// Abscissa behind which no scene within these bounds has an obstacle, m.
fn field_end_m(bounds: SceneBounds) -> f64 {
    let (least_m, [_, each_m]) = FIELD_LENGTH_M;
    FIELD_M + least_m + each_m * f64::from(bounds.obstacles[1]) + REACH_M
}

fn extent(shape: &str, drones: u32, spacing_m: f64) -> Extent {
    use skein_protocol::formation::Shape;
    let shape = match shape {
        "nested-v" => Shape::NestedV,
        "v" => Shape::V,
        "line" => Shape::Line,
        "column" => Shape::Column,
        "grid" => Shape::Grid,
        _ => Shape::Circle,
    };
    let slots = shape.slots(drones as usize, spacing_m);
    Extent {
        half_width_m: slots.iter().map(|slot| slot.y.abs()).fold(0.0, f64::max),
        depth_m: slots.iter().map(|slot| -slot.x).fold(0.0, f64::max),
    }
}

/// Places the obstacles across the formation's course: at least 80 m ahead of the front slot, and over a length that
/// grows with their number. `None` if an obstacle found no place.
fn obstacles(rng: &mut SplitMix64, count: u32, half_width_m: f64) -> Option<Vec<PlacedObstacle>> {
    let (least_m, each_m) = FIELD_LENGTH_M;
    let reach_m = least_m + rng.between(each_m[0], each_m[1]) * f64::from(count);
    let across_m = half_width_m.max(60.0);
    let mut placed: Vec<PlacedObstacle> = Vec::new();
    for _ in 0..count {
        let found = (0..PLACES).find_map(|_| {
            let centre = Vec2::new(rng.between(FIELD_M, FIELD_M + reach_m), rng.between(-across_m, across_m));
            let new = obstacle(rng, tenths(centre))?;
            let ahead = new.shape.bounds().0.x >= 80.0;
            let fits = ahead && placed.iter().all(|other| gap_is_clear_cut(&new.shape, &other.shape));
            fits.then_some(new)
        });
        placed.push(found?);
    }
    Some(placed)
}

/// Whether the gap between two obstacles is either clearly closed or clearly open.
fn gap_is_clear_cut(a: &ConvexShape, b: &ConvexShape) -> bool {
    let core = |shape: &ConvexShape| shape.vertices().collect::<Vec<_>>();
    let gap_m = separation(&core(a), &core(b)).norm() - a.radius_m - b.radius_m;
    !(CLOSED..OPEN).contains(&(gap_m / (2.0 * CLEARANCE_M)))
}

/// One obstacle of any shape around a centre.
fn obstacle(rng: &mut SplitMix64, centre: Vec2) -> Option<PlacedObstacle> {
    let half = tenths(Vec2::new(rng.between(5.0, 40.0), rng.between(10.0, 90.0)));
    let turn_rad = (rng.between(-PI / 2.0, PI / 2.0) * 100.0).round() / 100.0;
    let at = format!("centre_m = [{}, {}]", centre.x, centre.y);
    let sides = format!("[{}, {}]\nrotation_rad = {turn_rad}", half.x, half.y);
    let table = match rng.integer(0, 3) {
        0 => format!("shape = \"rectangle\"\n{at}\nhalf_size_m = {sides}"),
        1 => format!("shape = \"circle\"\n{at}\nradius_m = {}", half.y.min(50.0)),
        2 => format!("shape = \"ellipse\"\n{at}\nsemi_axes_m = {sides}"),
        _ => format!("shape = \"polygon\"\nvertices_m = {}", polygon(rng, centre, half + Vec2::repeat(5.0))),
    };
    let parsed: skein_scenario::Obstacle = toml::from_str(&table).ok()?;
    Some(PlacedObstacle { shape: parsed.shape().ok()?, toml: format!("\n[[obstacle]]\n{table}\n") })
}

/// Corners on an ellipse, so far from each other that rounding keeps the polygon convex.
fn polygon(rng: &mut SplitMix64, centre: Vec2, half: Vec2) -> String {
    let corners = rng.integer(3, 8);
    let corner = |k: u32, rng: &mut SplitMix64| {
        let angle = TAU * (f64::from(k) + rng.between(0.25, 0.75)) / f64::from(corners);
        let at = centre + Vec2::new(angle.cos() * half.x, angle.sin() * half.y);
        format!("[{:.2}, {:.2}]", at.x, at.y)
    };
    let list: Vec<String> = (0..corners).map(|k| corner(k, rng)).collect();
    format!("[{}]", list.join(", "))
}

/// Rounds to a tenth of a metre.
fn tenths(point: Vec2) -> Vec2 {
    point.map(|value| (value * 10.0).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn three_hundred_seeds_give_valid_and_different_scenes() {
        let mut texts = BTreeSet::new();
        for seed in 1..=300 {
            let scenario = random_scene(seed, SceneBounds::default(), &[]).unwrap();
            assert_eq!(scenario.seed, seed);
            assert!((5..=16).contains(&scenario.formation.drones));
            assert!((1..=4).contains(&scenario.obstacles.len()));
            assert!(scenario.formation.spacing_m >= 1.5 * scenario.drone.safe_distance_m);
            let shapes = scenario.shapes().unwrap();
            for (i, a) in shapes.iter().enumerate() {
                assert!(a.bounds().0.x >= 80.0, "seed {seed}: drones start with room to stop");
                for b in &shapes[..i] {
                    let (p, q): (Vec<Vec2>, Vec<Vec2>) = (a.vertices().collect(), b.vertices().collect());
                    let gap_m = separation(&p, &q).norm() - a.radius_m - b.radius_m;
                    assert!(!(27.0..36.0).contains(&gap_m), "seed {seed}: {gap_m} m is neither closed nor open");
                }
            }
            texts.insert(scene_toml(seed, SceneBounds::default()).unwrap());
        }
        assert_eq!(texts.len(), 300);
    }

    #[test]
    fn all_shapes_and_ends_occur_and_a_seed_always_gives_the_same_scene() {
        let all: String = (1..=60).map(|seed| scene_toml(seed, SceneBounds::default()).unwrap()).collect();
        for word in ["rectangle", "circle", "ellipse", "polygon", "nested-v", "line", "grid", "goal", "hold"] {
            assert!(all.contains(word), "{word}");
        }
        let again = || scene_toml(7, SceneBounds::default()).unwrap();
        assert_eq!(again(), again());
    }

    #[test]
    fn the_destination_can_lie_at_a_given_distance_behind_the_same_obstacles() {
        let bounds = |room_m| SceneBounds { room_m, ..SceneBounds::default() }.checked();
        let scene = |seed, room_m| random_scene(seed, bounds(room_m).unwrap(), &[]).unwrap();
        for seed in 1..=60 {
            let drawn = scene(seed, None);
            for room_m in [40, 340] {
                let given = scene(seed, Some(room_m));
                assert_eq!((&given.obstacles, given.slots()), (&drawn.obstacles, drawn.slots()), "seed {seed}");
                let front_m = given.mission.goal_m.map_or(given.mission.stop_x_m, |goal| goal[0]);
                let last_m = front_m + given.slots().iter().map(|slot| slot.x).fold(0.0, f64::min);
                let rear_m = given.shapes().unwrap().iter().map(|shape| shape.bounds().1.x).fold(FIELD_M, f64::max);
                let found_m = last_m - rear_m;
                assert!((0.0..1.0).contains(&(found_m - f64::from(room_m))), "seed {seed}: {found_m} m");
            }
        }
        assert!(matches!(bounds(Some(39)), Err(SceneError::Room { found: 39, .. })));
    }

    #[test]
    fn the_destination_is_drawn_without_the_obstacles_and_lies_beyond_all_of_them() {
        let bounds = SceneBounds::default();
        let mut rooms = Vec::new();
        for seed in 1..=200 {
            let scenario = random_scene(seed, bounds, &[]).unwrap();
            let front_m = scenario.mission.goal_m.map_or(scenario.mission.stop_x_m, |goal| goal[0]);
            let last_m = front_m + scenario.slots().iter().map(|slot| slot.x).fold(0.0, f64::min);
            let room_m = last_m - field_end_m(bounds);
            assert!((PLANNING_M..=PLANNING_M + ROOM_M[1] + 1.0).contains(&room_m), "seed {seed}: {room_m} m");
            let rear_m = scenario.shapes().unwrap().iter().map(|shape| shape.bounds().1.x).fold(0.0, f64::max);
            assert!(rear_m <= field_end_m(bounds), "seed {seed}: an obstacle ends at {rear_m} m");
            rooms.push((room_m, rear_m));
        }
        let mean = |of: fn(&(f64, f64)) -> f64| rooms.iter().map(of).sum::<f64>() / rooms.len() as f64;
        let (room_m, rear_m) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let covariance: f64 = rooms.iter().map(|pair| (pair.0 - room_m) * (pair.1 - rear_m)).sum();
        let squares =
            |of: fn(&(f64, f64)) -> f64, mean: f64| rooms.iter().map(|pair| (of(pair) - mean).powi(2)).sum::<f64>();
        let correlation = covariance / (squares(|pair| pair.0, room_m) * squares(|pair| pair.1, rear_m)).sqrt();
        assert!(correlation.abs() < 0.2, "{correlation}");
    }

    #[test]
    fn bounds_are_kept() {
        let bounds = SceneBounds { drones: [3, 3], obstacles: [6, 6], ..SceneBounds::default() };
        for seed in 0..20 {
            let scenario = random_scene(seed, bounds, &[]).unwrap();
            assert_eq!((scenario.formation.drones, scenario.obstacles.len()), (3, 6));
        }
    }
}
