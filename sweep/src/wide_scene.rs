//! Wide scenes: random scenes as hostile as a scene with a way through can be. They vary everything that a scenario of one
//! mission varies: number of drones, formation, distances, speeds, tick, ranges, radio, and walls, dead ends, staggered gaps,
//! corridors, fields, slanted bars and polygons that may overlap.
//!
//! A check of its own, a flood fill over a grid that knows nothing of the pilots' path search, keeps only scenes in which a
//! way for a single drone leads from every start to every slot at the end, and in which the arithmetic works: drones can stop
//! for what they sense, and start clear of it.

use crate::error::SceneError;
use crate::splitmix::SplitMix64;
use skein_leader::geometry::nearest;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use skein_scenario::{End, Scenario, ScenarioSource};
use std::fmt::Write as _;

/// Attempts to draw a scene before giving up.
const ATTEMPTS: u64 = 200;
/// Cells of the flood fill along the longer side at most.
const CELLS: f64 = 500.0;

/// The wide scene of this seed, as the TOML text of a scenario.
///
/// # Errors
/// [`SceneError::NoScene`] if no valid scene was found.
pub fn wide_scene_toml(seed: u64) -> Result<String, SceneError> {
    let mut last = None;
    for attempt in 0..ATTEMPTS {
        let text = Draft::new(SplitMix64::keyed(seed, 0x71de_0000 + attempt)).text(seed);
        let name = format!("wide-{seed}");
        match Scenario::parse(&text, ScenarioSource { name: &name, stem: &name }, &[]) {
            Ok(scenario) if has_way(&scenario) => return Ok(text),
            Ok(_) => {}
            Err(error) => last = Some(error),
        }
    }
    Err(SceneError::NoScene { seed, attempts: ATTEMPTS, last })
}

/// The checked scenario of this seed's wide scene, with these overrides (key path and TOML value).
///
/// # Errors
/// As [`wide_scene_toml`], and [`SceneError::Overrides`] if the overrides do not fit the scene.
pub fn wide_scene(seed: u64, overrides: &[(String, String)]) -> Result<Scenario, SceneError> {
    let name = format!("wide-{seed}");
    let text = wide_scene_toml(seed)?;
    Scenario::parse(&text, ScenarioSource { name: &name, stem: &name }, overrides).map_err(SceneError::Overrides)
}

/// A scene that is being drawn.
struct Draft {
    rng: SplitMix64,
    drones: u32,
    shape: &'static str,
    safe_m: f64,
    spacing_m: f64,
    clearance_m: f64,
    /// Half the width in which obstacles are placed, m.
    half_width_m: f64,
    /// Obstacles go on from here, m.
    x_m: f64,
    obstacles: String,
}

const SHAPES: [&str; 7] = ["nested-v", "v", "line", "column", "grid", "circle", "wedge"];

impl Draft {
    fn new(mut rng: SplitMix64) -> Self {
        let drones = [2, 3, 4, 5, 6, 8, 8, 10, 12, 16, 20, 24, 32][rng.integer(0, 12) as usize];
        let shape = SHAPES[rng.integer(0, 6) as usize];
        let safe_m = [2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 25.0, 30.0, 35.0, 40.0][rng.integer(0, 9) as usize];
        let spacing_m = safe_m * rng.between(1.08, 2.2);
        let clearance_m = (safe_m * rng.between(0.25, 0.8)).max(1.0);
        let half_width_m = spacing_m * f64::from(drones).sqrt() * 1.5;
        Self { rng, drones, shape, safe_m, spacing_m, clearance_m, half_width_m, x_m: 0.0, obstacles: String::new() }
    }

    fn text(mut self, seed: u64) -> String {
        let speed_mps = self.rng.between(2.0, 15.0);
        let acceleration_mps2 = self.rng.between(1.5, 7.0);
        let top_mps = speed_mps * self.rng.between(1.2, 2.2);
        let change_mps = speed_mps * self.rng.between(0.2, 0.6);
        let reform_mps = self.rng.between(speed_mps, top_mps);
        let mut dt_s = [0.01, 0.02, 0.02, 0.05][self.rng.integer(0, 3) as usize];
        while top_mps * dt_s > self.clearance_m.min(self.safe_m) / 4.0 {
            dt_s /= 2.0;
        }
        let stop_m = speed_mps * speed_mps / (2.0 * acceleration_mps2.min(5.0));
        let beyond_m =
            if self.rng.integer(0, 1) == 0 { self.rng.between(1.0, 10.0) } else { self.rng.between(10.0, 120.0) };
        let detection_m = stop_m + self.clearance_m + beyond_m;
        self.x_m = stop_m + self.clearance_m + 5.0 + self.rng.between(0.0, 1.5 * detection_m);
        for _ in 0..self.rng.integer(1, 4) {
            self.group();
            self.x_m +=
                if self.rng.integer(0, 1) == 0 { self.rng.between(2.0, 30.0) } else { self.rng.between(30.0, 200.0) };
        }
        let end_m = self.x_m + self.clearance_m + 2.0 * self.spacing_m + self.rng.between(0.0, 200.0);
        let front_m = end_m + self.depth_m();
        let timeout_s = (120.0 + 8.0 * (front_m + f64::from(self.drones) * self.safe_m) / speed_mps).ceil();
        let mut text = format!("# Wide random scene {seed}.\n\nname = \"wide-{seed}\"\nseed = {seed}\n");
        let _ = write!(text, "\n[time]\ndt_s = {dt_s}\ntimeout_s = {timeout_s}\n");
        let _ = write!(
            text,
            "\n[formation]\nshape = \"{}\"\ndrones = {}\nspacing_m = {:.2}\n",
            self.shape, self.drones, self.spacing_m
        );
        let end = self.end(front_m);
        let _ = write!(text, "\n[mission]\n{end}\nreform_speed_max_mps = {reform_mps:.2}\n");
        let _ = write!(
            text,
            "\n[drone]\nspeed_mps = {speed_mps:.2}\nspeed_change_mps = {change_mps:.2}\nspeed_max_mps = {:.2}\n",
            top_mps + 0.01
        );
        let _ = writeln!(text, "acceleration_max_mps2 = {acceleration_mps2:.2}\nsafe_distance_m = {}", self.safe_m);
        let planning_m = self.clearance_m * self.rng.between(1.0, 1.6);
        let _ = write!(text, "\n[sensors]\ndetection_range_m = {:.2}\n", detection_m + 0.2);
        let _ = write!(
            text,
            "\n[avoidance]\nclearance_m = {:.2}\nplanning_distance_m = {:.2}\n",
            self.clearance_m,
            planning_m + 0.01
        );
        let radio = self.rng.one(&["", "", "", "wifi", "mesh-lossy", "lte", "jammed"]);
        if !radio.is_empty() {
            let _ = write!(text, "\n[radio]\npreset = \"{radio}\"\n");
        }
        text.push_str(&self.obstacles);
        text
    }

    /// Depth of the formation along the flight, m.
    fn depth_m(&self) -> f64 {
        let drones = f64::from(self.drones);
        self.spacing_m
            * match self.shape {
                "line" => 0.0,
                "column" => drones,
                "v" => drones / 2.0,
                "grid" => drones.sqrt() + 1.0,
                "circle" => drones / 3.0 + 1.0,
                _ => (2.0 * drones).sqrt() + 1.0,
            }
    }

    fn end(&mut self, front_m: f64) -> String {
        if self.rng.integer(0, 1) == 0 {
            return format!("end = \"hold\"\nstop_x_m = {front_m:.1}");
        }
        let aside = self.rng.integer(0, 2) == 0;
        let y_m = if aside { self.rng.between(-self.half_width_m, self.half_width_m) } else { 0.0 };
        // One in five goals lies among the obstacles, if there is room.
        let x_m = if self.rng.integer(0, 4) == 0 { front_m * self.rng.between(0.5, 1.0) } else { front_m };
        format!("end = \"goal\"\ngoal_m = [{x_m:.1}, {y_m:.1}]")
    }

    /// One group of obstacles, from `x_m` on.
    fn group(&mut self) {
        let (wide_m, clear_m) = (self.half_width_m, self.clearance_m);
        let y_m = self.rng.between(-wide_m, wide_m);
        match self.rng.integer(0, 7) {
            0 => {
                let (depth_m, half_m) = (self.rng.between(1.0, 15.0), self.rng.between(5.0, 1.2 * wide_m + 20.0));
                self.bar(depth_m, y_m, half_m);
            }
            1 => self.dead_end(y_m / 2.0),
            2 => {
                for _ in 0..self.rng.integer(1, 3) {
                    let gap_m = 2.0 * clear_m * self.rng.between(0.95, 2.5);
                    let y_m = self.rng.between(-wide_m, wide_m);
                    self.gate(gap_m, y_m);
                    self.x_m += self.rng.between(2.0 * clear_m + 2.0, 6.0 * clear_m + 40.0);
                }
            }
            3 => {
                let radius_m = self.rng.between(5.0, wide_m + 40.0);
                self.disc(self.x_m + radius_m, y_m, radius_m);
                self.x_m += 2.0 * radius_m;
            }
            4 => {
                let length_m = self.rng.between(40.0, 250.0);
                for _ in 0..self.rng.integer(3, 10) {
                    let (x, y) = (self.rng.between(0.0, length_m), self.rng.between(-1.3 * wide_m, 1.3 * wide_m));
                    let radius_m = self.rng.between(1.0, 15.0);
                    self.disc(self.x_m + 15.0 + x, y, radius_m);
                }
                self.x_m += length_m + 30.0;
            }
            5 => {
                let half_m = self.rng.between(10.0, wide_m + 30.0);
                let turn_rad = self.rng.between(-1.3, 1.3);
                let thick_m = self.rng.between(1.0, 6.0);
                self.rectangle(self.x_m + half_m, y_m, half_m, thick_m, turn_rad);
                self.x_m += 2.0 * half_m;
            }
            6 => {
                let (gap_m, length_m) =
                    (2.0 * clear_m * self.rng.between(1.1, 3.0) + 6.0, self.rng.between(20.0, 150.0));
                let half_m = self.rng.between(3.0, 20.0);
                for side in [1.0, -1.0] {
                    self.rectangle(
                        self.x_m + length_m / 2.0,
                        y_m / 2.0 + side * (gap_m / 2.0 + half_m),
                        length_m / 2.0,
                        half_m,
                        0.0,
                    );
                }
                self.x_m += length_m;
            }
            _ => self.polygon(y_m),
        }
    }

    /// Three bars around a space that is open towards the swarm.
    fn dead_end(&mut self, y_m: f64) {
        let gap_m = self.rng.between(2.0 * self.clearance_m + 6.0, self.half_width_m + 3.0 * self.clearance_m + 20.0);
        let (length_m, thick_m) = (self.rng.between(10.0, 150.0), self.rng.between(2.0, 8.0));
        for side in [1.0, -1.0] {
            self.rectangle(
                self.x_m + length_m / 2.0,
                y_m + side * (gap_m / 2.0 + thick_m),
                length_m / 2.0,
                thick_m,
                0.0,
            );
        }
        self.rectangle(self.x_m + length_m + thick_m, y_m, thick_m, gap_m / 2.0 + 2.0 * thick_m, 0.0);
        self.x_m += length_m + 2.0 * thick_m;
    }

    /// Two bars with a gap between them.
    fn gate(&mut self, gap_m: f64, y_m: f64) {
        let (half_m, thick_m) = (self.rng.between(20.0, self.half_width_m + 40.0), self.rng.between(1.0, 8.0));
        for side in [1.0, -1.0] {
            self.rectangle(self.x_m + thick_m, y_m + side * (gap_m / 2.0 + half_m), thick_m, half_m, 0.0);
        }
        self.x_m += 2.0 * thick_m;
    }

    fn bar(&mut self, depth_m: f64, y_m: f64, half_m: f64) {
        self.rectangle(self.x_m + depth_m, y_m, depth_m, half_m, 0.0);
        self.x_m += 2.0 * depth_m;
    }

    fn rectangle(&mut self, x_m: f64, y_m: f64, half_x_m: f64, half_y_m: f64, turn_rad: f64) {
        let _ = write!(
            self.obstacles,
            "\n[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [{x_m:.2}, {y_m:.2}]\nhalf_size_m = [{half_x_m:.2}, {half_y_m:.2}]\n"
        );
        if turn_rad != 0.0 {
            let _ = writeln!(self.obstacles, "rotation_rad = {turn_rad:.3}");
        }
    }

    fn disc(&mut self, x_m: f64, y_m: f64, radius_m: f64) {
        let _ = write!(
            self.obstacles,
            "\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [{x_m:.2}, {y_m:.2}]\nradius_m = {radius_m:.2}\n"
        );
    }

    fn polygon(&mut self, y_m: f64) {
        let corners = self.rng.integer(3, 6);
        let radius_m = self.rng.between(5.0, 40.0);
        let mut angle = self.rng.between(0.0, 1.0);
        let step = std::f64::consts::TAU / f64::from(corners);
        let mut list = Vec::new();
        for _ in 0..corners {
            let (sin, cos) = angle.sin_cos();
            list.push(format!("[{:.2}, {:.2}]", self.x_m + radius_m * (1.0 + cos), y_m + radius_m * sin));
            angle += step * self.rng.between(0.6, 1.0);
        }
        let _ = write!(self.obstacles, "\n[[obstacle]]\nshape = \"polygon\"\nvertices_m = [{}]\n", list.join(", "));
        self.x_m += 2.0 * radius_m;
    }
}

/// Whether a way for a single drone leads from every start to every slot at the end, and the drones start with room to stop.
fn has_way(scenario: &Scenario) -> bool {
    let Ok(shapes) = scenario.shapes() else { return false };
    let slots = scenario.formation_shape().slots(scenario.formation.drones as usize, scenario.formation.spacing_m);
    let clear_m = scenario.avoidance.clearance_m;
    let stop_m = scenario.stopping_distance_m();
    let [x_m, y_m] = scenario.formation.start_m;
    let starts: Vec<Vec2> = slots.iter().map(|slot| slot + Vec2::new(x_m, y_m)).collect();
    let rear_m = shapes.iter().map(|shape| shape.bounds().1.x).fold(0.0, f64::max);
    let ends: Vec<Vec2> = match (scenario.mission.end, scenario.mission.goal_m) {
        (End::Goal, Some(goal)) => slots.iter().map(|slot| slot + Vec2::from(goal)).collect(),
        _ => vec![Vec2::new(rear_m + 3.0 * clear_m + 5.0, y_m)],
    };
    let room_m = |point: &Vec2| shapes.iter().map(|shape| distance_m(shape, *point)).fold(f64::INFINITY, f64::min);
    if starts.iter().any(|start| room_m(start) < clear_m + stop_m + 1.0) {
        return false;
    }
    // A goal hard by a wall is fine, one in the wall is not.
    if ends.iter().any(|end| room_m(end) < scenario.avoidance.planning_distance_m + 0.5) {
        return false;
    }
    Flood::new(&shapes, clear_m, &starts, &ends).connects(&starts, &ends)
}

fn distance_m(shape: &ConvexShape, point: Vec2) -> f64 {
    let core: Vec<Vec2> = shape.vertices().collect();
    (nearest(&core, point) - point).norm() - shape.radius_m
}

/// A grid over the ground; a cell is free if a drone may be anywhere in it.
struct Flood {
    low: Vec2,
    cell_m: f64,
    columns: usize,
    rows: usize,
    free: Vec<bool>,
}

impl Flood {
    fn new(shapes: &[ConvexShape], clear_m: f64, starts: &[Vec2], ends: &[Vec2]) -> Self {
        let (mut low, mut high) = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        let corners = shapes.iter().flat_map(|shape| <[Vec2; 2]>::from(shape.bounds()));
        for point in corners.chain(starts.iter().copied()).chain(ends.iter().copied()) {
            (low, high) = (low.inf(&point), high.sup(&point));
        }
        let margin = Vec2::repeat(4.0 * clear_m + 10.0);
        (low, high) = (low - margin, high + margin);
        let size = high - low;
        let cell_m = (clear_m / 3.0).max(size.max() / CELLS);
        let (columns, rows) = ((size.x / cell_m) as usize + 1, (size.y / cell_m) as usize + 1);
        let mut flood = Self { low, cell_m, columns, rows, free: vec![true; columns * rows] };
        for shape in shapes {
            flood.close(shape, clear_m + cell_m * 0.75);
        }
        flood
    }

    fn close(&mut self, shape: &ConvexShape, keep_m: f64) {
        let (low, high) = shape.bounds();
        let (from, to) = (self.cell(low - Vec2::repeat(keep_m)), self.cell(high + Vec2::repeat(keep_m)));
        for row in from.1..=to.1 {
            for column in from.0..=to.0 {
                let middle = self.low + Vec2::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell_m;
                if distance_m(shape, middle) < keep_m {
                    self.free[row * self.columns + column] = false;
                }
            }
        }
    }

    fn cell(&self, point: Vec2) -> (usize, usize) {
        let at = (point - self.low) / self.cell_m;
        ((at.x.max(0.0) as usize).min(self.columns - 1), (at.y.max(0.0) as usize).min(self.rows - 1))
    }

    /// Whether all starts and ends lie in one connected part of the free cells.
    fn connects(&self, starts: &[Vec2], ends: &[Vec2]) -> bool {
        let index = |point: &Vec2| {
            let (column, row) = self.cell(*point);
            row * self.columns + column
        };
        let Some(first) = starts.first().map(index).filter(|&cell| self.free[cell]) else { return false };
        let mut reached = vec![false; self.free.len()];
        let mut open = vec![first];
        reached[first] = true;
        while let Some(cell) = open.pop() {
            let (column, row) = (cell % self.columns, cell / self.columns);
            let beside = [
                (column > 0).then(|| cell - 1),
                (column + 1 < self.columns).then_some(cell + 1),
                (row > 0).then(|| cell - self.columns),
                (row + 1 < self.rows).then_some(cell + self.columns),
            ];
            for next in beside.into_iter().flatten().filter(|&next| self.free[next]) {
                if !std::mem::replace(&mut reached[next], true) {
                    open.push(next);
                }
            }
        }
        starts.iter().chain(ends).all(|point| reached[index(point)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_gives_one_scene_that_checks_and_has_a_way() {
        let mut all = String::new();
        for seed in 0..60 {
            let text = wide_scene_toml(seed).unwrap();
            assert_eq!(text, wide_scene_toml(seed).unwrap());
            all.push_str(&text);
        }
        for word in
            ["rectangle", "circle", "polygon", "rotation_rad", "goal", "hold", "wifi", "jammed", "column", "wedge"]
        {
            assert!(all.contains(word), "{word}");
        }
    }

    #[test]
    fn a_closed_ring_has_no_way() {
        let text = |gap: &str| {
            format!(
                "[formation]\ndrones = 1\n[mission]\nend = \"goal\"\ngoal_m = [300, 0]\n\
                 [[obstacle]]\nshape = \"rectangle\"\ncentre_m = [220, 0]\nhalf_size_m = [5, 80]\n\
                 [[obstacle]]\nshape = \"rectangle\"\ncentre_m = [300, 75]\nhalf_size_m = [85, 5]\n\
                 [[obstacle]]\nshape = \"rectangle\"\ncentre_m = [300, -75]\nhalf_size_m = [85, 5]\n{gap}"
            )
        };
        let parse = |text: &str| Scenario::parse(text, ScenarioSource { name: "t", stem: "t" }, &[]).unwrap();
        assert!(has_way(&parse(&text(""))));
        let shut = "[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [380, 0]\nhalf_size_m = [5, 80]\n";
        assert!(!has_way(&parse(&text(shut))));
    }
}
