//! Random scenes: a formation and obstacles drawn by a seed alone. Start and end lie clear of all obstacles in an
//! unbounded plane, so a free way always exists.

use super::draw::Draw;
use skein_leader::geometry::separation;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use skein_scenario::{Scenario, ScenarioSource};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// How many drones and obstacles a scene may have, least and most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Drones.
    pub drones: [u32; 2],
    /// Obstacles.
    pub obstacles: [u32; 2],
}

impl Bounds {
    /// These bounds, if a scene can be made of them.
    ///
    /// # Errors
    /// What was found and what was expected.
    pub fn checked(self) -> Result<Self, String> {
        for (what, [least, most], limits) in [("drones", self.drones, [1, 64]), ("obstacles", self.obstacles, [0, 8])] {
            if least > most || least < limits[0] || most > limits[1] {
                let [from, to] = limits;
                return Err(format!("{what}: found {least} to {most}, expected [least, most] from {from} to {to}"));
            }
        }
        Ok(self)
    }
}

impl Default for Bounds {
    fn default() -> Self {
        Self { drones: [5, 16], obstacles: [1, 4] }
    }
}

/// Clearance and planning distance of every scene, m.
const CLEARANCE_M: f64 = 15.0;
const PLANNING_M: f64 = 20.0;

/// A gap counts as closed below the first, as a way above the second, in units of the narrowest passable gap. Between
/// them it is left to rounding which of the two it is: no scene has such a gap.
const CLOSED: f64 = 0.9;
const OPEN: f64 = 1.2;

/// Draws of a place for one obstacle before the scene is drawn anew, and of scenes before giving up.
const PLACES: usize = 32;
const SCENES: u64 = 64;

/// The scene of this seed, as TOML.
///
/// # Errors
/// If no scene of these bounds was found, which takes hundreds of obstacles.
pub fn scene_toml(seed: u64, bounds: Bounds) -> Result<String, String> {
    let mut last = String::new();
    for attempt in 0..SCENES {
        let Some(text) = scene(&mut Draw::keyed(seed, attempt), seed, bounds) else { continue };
        match parse(seed, &text, &[]) {
            Ok(_) => return Ok(text),
            Err(error) => last = error,
        }
    }
    Err(format!("random scene {seed}: none found in {SCENES} draws; {last}"))
}

/// The scene of this seed, checked, with these overrides.
///
/// # Errors
/// As [`scene_toml`], and if the overrides do not fit the scene.
pub fn random_scene(seed: u64, bounds: Bounds, overrides: &[(String, String)]) -> Result<Scenario, String> {
    parse(seed, &scene_toml(seed, bounds)?, overrides)
}

fn parse(seed: u64, text: &str, overrides: &[(String, String)]) -> Result<Scenario, String> {
    let name = format!("random-{seed}");
    Scenario::parse(text, ScenarioSource { name: &name, stem: &name }, overrides).map_err(|error| error.to_string())
}

/// One draw of a scene; `None` if an obstacle found no place.
fn scene(draw: &mut Draw, seed: u64, bounds: Bounds) -> Option<String> {
    let drones = draw.integer(bounds.drones[0], bounds.drones[1]);
    let shape = draw.one(&["nested-v", "v", "line", "column", "grid", "circle"]);
    let safe_m = draw.between(20.0, 40.0).round();
    // Rounded up: the spacing is 1.5 safe distances at least.
    let spacing_m = (safe_m * draw.between(1.5, 2.5)).ceil();
    let count = draw.integer(bounds.obstacles[0], bounds.obstacles[1]);
    let (size, depth_m) = extent(shape, drones, spacing_m);
    let obstacles = obstacles(draw, count, size)?;
    let rear_m = obstacles.iter().map(|(shape, _)| shape.bounds().1.x).fold(0.0, f64::max);
    // Where the formation comes to rest: its last slot is beyond the last obstacle's planning distance.
    let end_x_m = (rear_m + PLANNING_M + depth_m + 20.0).ceil();
    let mission = match draw.integer(0, 2) {
        0 => format!("end = \"goal\"\ngoal_m = [{end_x_m}, 0]"),
        _ => format!("end = \"hold\"\nstop_x_m = {end_x_m}"),
    };
    let mut text = format!("# Random scene {seed}.\n\nname = \"random-{seed}\"\nseed = {seed}\n");
    let _ = write!(text, "\n[time]\ntimeout_s = 600\n");
    let _ = write!(text, "\n[formation]\nshape = \"{shape}\"\ndrones = {drones}\nspacing_m = {spacing_m}\n");
    let _ = write!(text, "\n[mission]\n{mission}\nreform_speed_max_mps = {}\n", draw.one(&["10", "15", "20"]));
    let _ = write!(text, "\n[drone]\nsafe_distance_m = {safe_m}\n");
    let _ = write!(text, "\n[sensors]\ndetection_range_m = {}\n", draw.between(60.0, 120.0).round());
    let _ = write!(text, "\n[avoidance]\nclearance_m = {CLEARANCE_M}\nplanning_distance_m = {PLANNING_M}\n");
    obstacles.iter().for_each(|(_, table)| text.push_str(table));
    Some(text)
}

/// Half the width of the formation across the flight and its depth along it, m.
fn extent(shape: &str, drones: u32, spacing_m: f64) -> (f64, f64) {
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
    let half_width_m = slots.iter().map(|slot| slot.y.abs()).fold(0.0, f64::max);
    (half_width_m, slots.iter().map(|slot| -slot.x).fold(0.0, f64::max))
}

/// The obstacles, each with its TOML table, between 80 m ahead of the front slot and a depth that grows with their
/// number, across the formation's way.
fn obstacles(draw: &mut Draw, count: u32, half_width_m: f64) -> Option<Vec<(ConvexShape, String)>> {
    let reach_m = 80.0 + draw.between(50.0, 250.0) * f64::from(count);
    let across_m = half_width_m.max(60.0);
    let mut placed: Vec<(ConvexShape, String)> = Vec::new();
    for _ in 0..count {
        let found = (0..PLACES).find_map(|_| {
            let centre = Vec2::new(draw.between(120.0, 120.0 + reach_m), draw.between(-across_m, across_m));
            let (shape, table) = obstacle(draw, tenths(centre))?;
            let fits = shape.bounds().0.x >= 80.0 && placed.iter().all(|(other, _)| told_apart(&shape, other));
            fits.then_some((shape, table))
        });
        placed.push(found?);
    }
    Some(placed)
}

/// Whether the gap between two obstacles is clearly closed or clearly a way.
fn told_apart(a: &ConvexShape, b: &ConvexShape) -> bool {
    let core = |shape: &ConvexShape| shape.vertices().collect::<Vec<_>>();
    let gap_m = separation(&core(a), &core(b)).norm() - a.radius_m - b.radius_m;
    !(CLOSED..OPEN).contains(&(gap_m / (2.0 * CLEARANCE_M)))
}

/// One obstacle of any shape around a centre, and its TOML table.
fn obstacle(draw: &mut Draw, centre: Vec2) -> Option<(ConvexShape, String)> {
    let half = tenths(Vec2::new(draw.between(5.0, 40.0), draw.between(10.0, 90.0)));
    let turn_rad = (draw.between(-PI / 2.0, PI / 2.0) * 100.0).round() / 100.0;
    let at = format!("centre_m = [{}, {}]", centre.x, centre.y);
    let sides = format!("[{}, {}]\nrotation_rad = {turn_rad}", half.x, half.y);
    let table = match draw.integer(0, 3) {
        0 => format!("shape = \"rectangle\"\n{at}\nhalf_size_m = {sides}"),
        1 => format!("shape = \"circle\"\n{at}\nradius_m = {}", half.y.min(50.0)),
        2 => format!("shape = \"ellipse\"\n{at}\nsemi_axes_m = {sides}"),
        _ => format!("shape = \"polygon\"\nvertices_m = {}", polygon(draw, centre, half + Vec2::repeat(5.0))),
    };
    let parsed: skein_scenario::Obstacle = toml::from_str(&table).ok()?;
    Some((parsed.shape().ok()?, format!("\n[[obstacle]]\n{table}\n")))
}

/// Corners on an ellipse, far enough from each other that rounding keeps them convex.
fn polygon(draw: &mut Draw, centre: Vec2, half: Vec2) -> String {
    let corners = draw.integer(3, 8);
    let corner = |k: u32, draw: &mut Draw| {
        let angle = TAU * (f64::from(k) + draw.between(0.25, 0.75)) / f64::from(corners);
        let at = centre + Vec2::new(angle.cos() * half.x, angle.sin() * half.y);
        format!("[{:.2}, {:.2}]", at.x, at.y)
    };
    let list: Vec<String> = (0..corners).map(|k| corner(k, draw)).collect();
    format!("[{}]", list.join(", "))
}

/// To a tenth of a metre.
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
            let scenario = random_scene(seed, Bounds::default(), &[]).unwrap();
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
                    assert!(!(27.0..36.0).contains(&gap_m), "seed {seed}: {gap_m} m is neither closed nor a way");
                }
            }
            texts.insert(scene_toml(seed, Bounds::default()).unwrap());
        }
        assert_eq!(texts.len(), 300);
    }

    #[test]
    fn all_shapes_and_ends_occur_and_a_seed_always_gives_the_same() {
        let all: String = (1..=60).map(|seed| scene_toml(seed, Bounds::default()).unwrap()).collect();
        for word in ["rectangle", "circle", "ellipse", "polygon", "nested-v", "line", "grid", "goal", "hold"] {
            assert!(all.contains(word), "{word}");
        }
        assert_eq!(scene_toml(7, Bounds::default()), scene_toml(7, Bounds::default()));
    }

    #[test]
    fn bounds_are_kept() {
        let bounds = Bounds { drones: [3, 3], obstacles: [6, 6] };
        for seed in 0..20 {
            let scenario = random_scene(seed, bounds, &[]).unwrap();
            assert_eq!((scenario.formation.drones, scenario.obstacles.len()), (3, 6));
        }
    }
}
