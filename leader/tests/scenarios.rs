//! The paper's single-obstacle scenarios: the forecasts of the cost model and the exact grouping.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use skein_leader::cost::{Flight, trip};
use skein_leader::routes::{RouteParams, Routes};
use skein_leader::split::{ArrivalTable, RouteAssignment};
use skein_protocol::formation::Shape;
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{ObstacleId, Vec2};

const PARAMS: RouteParams =
    RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL };
const FLIGHT: Flight = Flight { speed_mps: 10.0, course_y_m: 0.0 };

/// Spacing, d_safe, half sizes and centre of the obstacle, detection range; m.
struct Scene {
    spacing_m: f64,
    d_safe_m: f64,
    half_m: Vec2,
    centre_m: Vec2,
    range_m: f64,
}

fn s1(shift_m: f64) -> Scene {
    Scene {
        spacing_m: 35.0,
        d_safe_m: 33.0,
        half_m: Vec2::new(10.0, 75.0),
        centre_m: Vec2::new(167.0, shift_m),
        range_m: 115.0,
    }
}

fn s2(shift_m: f64) -> Scene {
    Scene {
        spacing_m: 65.0,
        d_safe_m: 37.0,
        half_m: Vec2::new(5.0, 80.0),
        centre_m: Vec2::new(144.0, shift_m),
        range_m: 90.0,
    }
}

fn s3b(shift_m: f64) -> Scene {
    Scene {
        spacing_m: 90.0,
        d_safe_m: 35.0,
        half_m: Vec2::new(5.0, 80.0),
        centre_m: Vec2::new(70.0, shift_m),
        range_m: 65.0,
    }
}

impl Scene {
    fn distance_m(&self, point: Vec2) -> f64 {
        ((point - self.centre_m).abs() - self.half_m).sup(&Vec2::zeros()).norm()
    }

    /// The swarm's positions when the first drone detects the obstacle.
    fn detection(&self) -> Vec<Vec2> {
        let mut swarm = Shape::NestedV.slots(8, self.spacing_m);
        loop {
            let nearest_m = swarm.iter().map(|&p| self.distance_m(p)).fold(f64::INFINITY, f64::min);
            if nearest_m <= self.range_m + 1e-6 {
                return swarm;
            }
            swarm.iter_mut().for_each(|p| p.x += nearest_m - self.range_m);
        }
    }

    fn table(&self) -> ArrivalTable {
        let shape = ConvexShape::rectangle(self.centre_m, self.half_m, 0.0).unwrap();
        let routes = Routes::new(&[(ObstacleId(0), shape)], &PARAMS);
        let row =
            |&p: &Vec2| (0..routes.count()).map(|route| trip(&[], &routes, route, p, &FLIGHT).arrival_s).collect();
        let rows: Vec<Vec<f64>> = self.detection().iter().map(row).collect();
        ArrivalTable::new(&rows, &[1.1 * self.d_safe_m / FLIGHT.speed_mps; 2]).unwrap()
    }
}

fn counts(split: &RouteAssignment) -> Vec<usize> {
    split.queues.iter().map(Vec::len).collect()
}

#[test]
fn forecasts_are_those_of_the_published_splits() {
    let makers: [fn(f64) -> Scene; 3] = [s1, s2, s3b];
    let wanted = [(110.0, [30.10, 37.36, 27.57]), (115.0, [29.95, 38.08, 27.36]), (130.0, [28.93, 34.68, 27.60])];
    for (scene, (shift_m, [best_s, shortest_s, centred_s])) in makers.into_iter().zip(wanted) {
        let close = |split: &RouteAssignment, wanted_s: f64, wanted: [usize; 2]| {
            assert!((split.makespan_s - wanted_s).abs() < 0.15, "T* {} is not {wanted_s}", split.makespan_s);
            assert_eq!(counts(split), wanted, "T* {wanted_s}");
        };
        // Route 0 is the rightmost one: past an obstacle on the right the long way, past one on the left the short way.
        close(&scene(-shift_m).table().split(), best_s, [2, 6]);
        close(&scene(shift_m).table().split(), best_s, [6, 2]);
        close(&scene(-shift_m).table().shortest(), shortest_s, [0, 8]);
        close(&scene(shift_m).table().shortest(), shortest_s, [8, 0]);
        close(&scene(0.0).table().split(), centred_s, [4, 4]);
    }
}

#[test]
fn mirrored_scenes_have_mirrored_arrivals_and_equal_forecasts() {
    for (left, right) in [(s1(110.0), s1(-110.0)), (s2(115.0), s2(-115.0)), (s3b(130.0), s3b(-130.0))] {
        let (left, right) = (left.table().split(), right.table().split());
        assert_eq!((left.makespan_s, left.total_s), (right.makespan_s, right.total_s));
    }
}

#[test]
fn the_forced_split_of_s1_costs_more_than_the_best() {
    let table = s1(-110.0).table();
    let times: Vec<f64> = (0..=8).map(|left| table.fixed(&[8 - left, left]).unwrap().makespan_s).collect();
    let least = times.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(least, table.split().makespan_s);
    assert_eq!(times[6], least, "{times:?}");
    assert!(times[..6].is_sorted_by(|a, b| a > b) && times[6..].is_sorted(), "{times:?}");
}
