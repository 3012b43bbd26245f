//! Routes and shortest paths: golden tables, and properties that hold for any obstacles and positions.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use proptest::prelude::*;
use skein_leader::funnel::Corridor;
use skein_leader::routes::{Body, Constraint, RouteParams, Routes, Side};
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{ObstacleId, Vec2};
use std::fmt::Write;

/// Distance behind the exit at which a path ends, m.
const RUN_OUT_M: f64 = 60.0;

const PARAMS: RouteParams =
    RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL };

fn rectangle(x: f64, y: f64, half_x: f64, half_y: f64) -> ConvexShape {
    ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(half_x, half_y), 0.0).unwrap()
}

fn circle(x: f64, y: f64, radius: f64) -> ConvexShape {
    ConvexShape::circle(Vec2::new(x, y), radius).unwrap()
}

fn routes(shapes: &[ConvexShape]) -> Routes {
    let numbered: Vec<_> = shapes.iter().enumerate().map(|(i, shape)| (ObstacleId(i as u32), *shape)).collect();
    Routes::new(&numbered, &PARAMS)
}

fn lane(routes: &Routes, route: usize, bodies: &[Body]) -> Corridor {
    Corridor::new(&[(routes, route)], bodies, Vec2::new(routes.exit_x_m() + RUN_OUT_M, 0.0))
}

/// The gate, the exit, and for each route its walls: the path's side, the bounding box, the number of constraint points.
fn table(shapes: &[ConvexShape]) -> String {
    let routes = routes(shapes);
    let mut text = format!("gate {:.1} exit {:.1}\n", routes.gate_x_m(), routes.exit_x_m());
    for index in 0..routes.count() {
        let route = routes.route(index);
        write!(text, "route {index}, {} points:", route.constraints().len()).unwrap();
        for wall in route.walls() {
            let low = wall.outline.iter().copied().reduce(|a, b| a.inf(&b)).unwrap();
            let high = wall.outline.iter().copied().reduce(|a, b| a.sup(&b)).unwrap();
            let side = wall.side;
            write!(text, " {side:?} ({:.1} {:.1})..({:.1} {:.1})", low.x, low.y, high.x, high.y).unwrap();
        }
        text.push('\n');
    }
    text
}

#[test]
fn one_rectangle_has_two_routes() {
    let wanted = "gate 167.0 exit 197.0\n\
        route 0, 16 points: Below (137.0 -205.0)..(197.0 -15.0)\n\
        route 1, 16 points: Above (137.0 -205.0)..(197.0 -15.0)\n";
    assert_eq!(table(&[rectangle(167.0, -110.0, 10.0, 75.0)]), wanted);
}

#[test]
fn a_wide_gap_is_a_route_at_full_distance() {
    let wanted = "gate 640.0 exit 670.0\n\
        route 0, 32 points: Below (610.0 -80.0)..(670.0 -10.0) Below (610.0 10.0)..(670.0 80.0)\n\
        route 1, 32 points: Above (610.0 -80.0)..(670.0 -10.0) Below (610.0 10.0)..(670.0 80.0)\n\
        route 2, 32 points: Above (610.0 -80.0)..(670.0 -10.0) Above (610.0 10.0)..(670.0 80.0)\n";
    assert_eq!(table(&[rectangle(640.0, 45.0, 10.0, 15.0), rectangle(640.0, -45.0, 10.0, 15.0)]), wanted);
}

#[test]
fn a_path_through_a_narrow_gap_leads_through_its_middle() {
    let wanted = "gate 105.0 exit 140.0\n\
        route 0, 32 points: Below (70.0 -70.0)..(130.0 -10.0) Below (80.0 -16.0)..(140.0 44.0)\n\
        route 1, 32 points: Above (73.1 -66.9)..(126.9 -13.1) Below (83.1 -12.9)..(136.9 40.9)\n\
        route 2, 32 points: Above (70.0 -70.0)..(130.0 -10.0) Above (80.0 -16.0)..(140.0 44.0)\n";
    assert_eq!(table(&[rectangle(110.0, 14.0, 10.0, 10.0), rectangle(100.0, -40.0, 10.0, 10.0)]), wanted);
}

#[test]
fn a_gap_of_twice_the_clearance_is_closed() {
    let wanted = "gate 105.0 exit 140.0\n\
        route 0, 17 points: Below (70.0 -70.0)..(140.0 50.0)\n\
        route 1, 17 points: Above (70.0 -70.0)..(140.0 50.0)\n";
    assert_eq!(table(&[rectangle(110.0, 10.0, 10.0, 20.0), rectangle(100.0, -45.0, 10.0, 5.0)]), wanted);
}

#[test]
fn a_gap_is_a_route_if_it_is_wider_than_the_narrowest_passable_one() {
    let params = RouteParams { half_gap_m: 15.5, ..PARAMS };
    let routes = |gap_m: f64| {
        let shapes =
            [rectangle(100.0, 20.0 + gap_m / 2.0, 10.0, 20.0), rectangle(100.0, -20.0 - gap_m / 2.0, 10.0, 20.0)];
        Routes::new(&shapes.map(|shape| (ObstacleId(0), shape)), &params)
    };
    assert_eq!([routes(30.9).count(), routes(31.1).count()], [2, 3]);
    // Beside the wall, on the side of another route, the gap is not open to a drone that keeps the clearance.
    assert!(!routes(31.1).is_open(1, Vec2::new(100.0, 70.6)) && routes(31.1).is_open(1, Vec2::new(100.0, 70.5)));
}

#[test]
fn a_circle_and_a_rectangle_are_enveloped() {
    let wanted = "gate 102.5 exit 135.0\n\
        route 0, 17 points: Below (70.0 -30.0)..(135.0 65.0)\n\
        route 1, 17 points: Above (70.0 -30.0)..(135.0 65.0)\n";
    assert_eq!(table(&[circle(100.0, 0.0, 10.0), rectangle(110.0, 40.0, 5.0, 5.0)]), wanted);
}

#[test]
fn an_envelope_can_close_the_gap_to_a_third() {
    let (a, b, c) = (rectangle(0.0, 0.0, 5.0, 5.0), rectangle(30.0, 30.0, 5.0, 5.0), rectangle(-13.0, 43.0, 5.0, 5.0));
    let wanted = "gate 8.5 exit 55.0\n\
        route 0, 17 points: Below (-38.0 -25.0)..(55.0 68.0)\n\
        route 1, 17 points: Above (-38.0 -25.0)..(55.0 68.0)\n";
    assert_eq!(routes(&[a, c]).count(), 3);
    assert_eq!(routes(&[b, c]).count(), 3);
    assert_eq!(table(&[a, b, c]), wanted);
}

#[test]
fn tilted_neighbours_are_ordered_as_a_line_across_meets_them() {
    // The long bar's centre lies to the left of the disc's, but where they are abreast the bar is to the right.
    let bar = ConvexShape::rectangle(Vec2::new(200.0, 60.0), Vec2::new(150.0, 5.0), 0.5).unwrap();
    let disc = circle(90.0, 55.0, 10.0);
    let routes = routes(&[bar, disc]);
    assert_eq!(routes.count(), 3);
    let (right, left) = (&routes.route(1).walls()[0], &routes.route(1).walls()[1]);
    assert_eq!((right.side, left.side), (Side::Above, Side::Below));
    assert_eq!(left.distance_m(Vec2::new(90.0, 55.0)), 0.0);
}

#[test]
fn a_drone_in_the_strip_behind_a_wall_is_not_led_back_round_it() {
    // Routes keep a little more than the clearance, which is all that drones keep.
    let params = RouteParams { half_gap_m: 15.004, ..PARAMS };
    let routes = Routes::new(&[(ObstacleId(0), rectangle(100.0, -100.0, 5.0, 100.0))], &params);
    let lane = lane(&routes, 1, &[]);
    let towards = |x: f64, y: f64| lane.pull(Vec2::new(x, y), routes.gate_x_m()).direction;
    // The rear is at 105 m, the clearance ends at 120 m, and the planning distance at 125 m. The wall's corner is at 0 m.
    assert!(towards(119.0, -80.0).y > 0.99, "it still has the wall to pass: {:?}", towards(119.0, -80.0));
    for (x, y) in [120.001, 120.1, 124.9, 125.1].into_iter().flat_map(|x| [-80.0, -5.0, -1.0].map(|y| (x, y))) {
        let straight = (lane.target() - Vec2::new(x, y)).normalize();
        assert!((towards(x, y) - straight).norm() < 1e-9, "{:?} at {x} m, {y} m", towards(x, y));
    }
}

#[test]
fn without_obstacles_there_is_one_free_route() {
    let mut broken = circle(0.0, 0.0, 1.0);
    broken.count = 99;
    for routes in [routes(&[]), routes(&[broken])] {
        assert_eq!((routes.count(), routes.route(7).constraints().len()), (1, 0));
        let pull = lane(&routes, 0, &[]).pull(Vec2::new(-90.0, 0.0), routes.gate_x_m());
        assert_eq!((pull.direction, pull.to_gate_m, pull.total_m), (Vec2::x(), 90.0, 90.0 + RUN_OUT_M));
    }
}

#[test]
fn the_path_bends_at_the_corners_and_is_measured_to_the_gate() {
    let routes = routes(&[rectangle(167.0, 0.0, 10.0, 75.0)]);
    let lane = lane(&routes, 1, &[]);
    let pull = lane.pull(Vec2::new(0.0, 0.0), 167.0);
    assert!(pull.direction.y > 0.5 && (pull.direction.norm() - 1.0).abs() < 1e-12);
    // Longer than straight to the corner of the planning distance, shorter than round its box.
    assert!(pull.to_gate_m > Vec2::new(157.0, 95.0).norm() && pull.to_gate_m < 137.0 + 95.0);
    let straight_m = pull.total_m - pull.to_gate_m;
    assert!(straight_m > Vec2::new(90.0, 95.0).norm() && straight_m < 90.0 + 95.0);
    assert_eq!(lane.pull(Vec2::new(180.0, 95.0), 167.0).to_gate_m, -13.0);
    assert!((lane.pull(Vec2::new(0.0, 0.0), 1167.0).to_gate_m - (pull.total_m + 1167.0 - 257.0)).abs() < 1e-9);
}

#[test]
fn past_the_target_the_path_leads_on_along_the_course() {
    let routes = routes(&[rectangle(100.0, 0.0, 10.0, 10.0)]);
    let pull = lane(&routes, 0, &[]).pull(Vec2::new(900.0, 40.0), 100.0);
    assert_eq!(pull.direction, Vec2::new(30.0, -40.0) / 50.0);
    assert_eq!(pull.to_gate_m, -800.0);
}

#[test]
fn a_body_at_a_wall_becomes_part_of_it_and_a_free_body_keeps_its_side() {
    let routes = routes(&[rectangle(100.0, 0.0, 10.0, 40.0)]);
    let body = |x: f64, y: f64| Body { centre_m: Vec2::new(x, y), radius_m: 30.0 };
    // Half-way along the obstacle the string from nearer than this leads outward.
    let height_m = |bodies: &[Body], route: usize| {
        let (lane, sign) = (lane(&routes, route, bodies), if route == 0 { -1.0 } else { 1.0 });
        let inward = |y: &f64| lane.pull(Vec2::new(100.0, *y), 100.0).direction.y * sign <= 0.0;
        (0..2000).map(|i| f64::from(i) / 10.0 * sign).find(inward)
    };
    for (route, sign) in [(0, -1.0), (1, 1.0)] {
        let free = height_m(&[], route).unwrap();
        assert!((free - sign * 60.0).abs() < 1.0, "{free}");
        let closed = height_m(&[body(100.0, sign * 70.0)], route).unwrap();
        assert!((closed - sign * 100.0).abs() < 1.0, "{closed}");
        // Not closed by itself, but by the body between it and the wall.
        let chained = height_m(&[body(100.0, sign * 110.0), body(100.0, sign * 70.0)], route).unwrap();
        assert!((chained - sign * 140.0).abs() < 1.0, "{chained}");
        let aside = height_m(&[body(100.0, sign * 110.0)], route).unwrap();
        assert!((aside - sign * 60.0).abs() < 1.0, "{aside}");
    }
}

#[test]
fn a_body_in_a_gap_becomes_part_of_the_nearer_wall() {
    let routes = routes(&[rectangle(640.0, 60.0, 10.0, 15.0), rectangle(640.0, -60.0, 10.0, 15.0)]);
    for sign in [-1.0, 1.0] {
        let body = Body { centre_m: Vec2::new(640.0, sign * 35.0), radius_m: 30.0 };
        let pull = lane(&routes, 1, &[body]).pull(Vec2::new(500.0, sign * 25.0), 640.0);
        // It leads away from the body, to the other half of the gap.
        assert!(pull.direction.y * sign < -0.1, "{pull:?}");
    }
}

#[test]
fn all_routes_but_the_outer_ones_lead_between_two_obstacles() {
    let between = |routes: &Routes| (0..routes.count()).map(|route| routes.is_between(route)).collect::<Vec<_>>();
    assert_eq!(between(&routes(&[])), [false]);
    assert_eq!(between(&routes(&[rectangle(640.0, 0.0, 10.0, 15.0)])), [false, false]);
    let two = routes(&[rectangle(640.0, 60.0, 10.0, 15.0), rectangle(640.0, -60.0, 10.0, 15.0)]);
    assert_eq!(between(&two), [false, true, false]);
}

#[test]
fn bodies_bar_a_gap_if_they_leave_no_room_beside_them() {
    let routes = routes(&[rectangle(640.0, 60.0, 10.0, 15.0), rectangle(640.0, -60.0, 10.0, 15.0)]);
    let body = |x: f64, y: f64| Body { centre_m: Vec2::new(x, y), radius_m: 30.0 };
    let barred = |bodies: &[Body]| [0, 1, 2].map(|route| routes.is_barred(route, Vec2::new(600.0, 0.0), bodies));
    assert_eq!(barred(&[]), [false; 3]);
    assert_eq!(barred(&[body(640.0, 0.0)]), [false, true, false]);
    assert_eq!(barred(&[body(640.0, 35.0)]), [false; 3], "there is room on one side");
    assert_eq!(barred(&[body(640.0, 35.0), body(640.0, -20.0)]), [false, true, false], "two bar it together");
    assert_eq!(barred(&[body(710.0, 0.0)]), [false; 3], "beyond the gap");
    assert!(!routes.is_barred(1, Vec2::new(650.0, 0.0), &[body(640.0, 0.0)]), "it is behind");
}

#[test]
fn a_corridor_past_two_sets_keeps_the_constraints_of_both() {
    let (first, second) = (routes(&[rectangle(100.0, 0.0, 10.0, 40.0)]), routes(&[rectangle(220.0, 0.0, 10.0, 40.0)]));
    let target = Vec2::new(second.exit_x_m() + RUN_OUT_M, 0.0);
    let crossing = Corridor::new(&[(&first, 0), (&second, 1)], &[], target);
    let position = Vec2::new(100.0, -60.0);
    let pull = crossing.pull(position, second.gate_x_m());
    // From the right of the first to the left of the second: level along the first, then across, then level again.
    assert_eq!(pull.direction, Vec2::x());
    assert!(pull.to_gate_m > Vec2::new(120.0, 120.0).norm() && pull.to_gate_m < 240.0, "{pull:?}");
    assert_eq!(crossing.pull(position, first.gate_x_m()).to_gate_m, 0.0);
    let straight = Corridor::new(&[(&second, 0), (&first, 0)], &[], target).pull(position, second.gate_x_m());
    assert!((straight.to_gate_m - 120.0).abs() < 1e-9);
}

fn shape() -> impl Strategy<Value = ConvexShape> {
    let rectangles = (0.0..200.0, -150.0..150.0, 2.0..40.0, 2.0..80.0, -1.5..1.5)
        .prop_map(|(x, y, hx, hy, turn)| ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), turn).unwrap());
    let circles = (0.0..200.0, -150.0..150.0, 1.0..40.0).prop_map(|(x, y, r)| circle(x, y, r));
    prop_oneof![rectangles, circles]
}

fn shapes() -> impl Strategy<Value = Vec<ConvexShape>> {
    prop::collection::vec(shape(), 1..6)
}

fn mirrored(shape: &ConvexShape) -> ConvexShape {
    let mut vertices: Vec<Vec2> = shape.vertices().map(|v| Vec2::new(v.x, -v.y)).collect();
    vertices.reverse();
    ConvexShape::new(&vertices, shape.radius_m).unwrap()
}

/// Length of the shortest path over constraint points that keeps all constraints. `None` if there is none.
fn shortest(constraints: &[Constraint], from: Vec2, target: Vec2) -> Option<f64> {
    let ahead: Vec<&Constraint> = constraints.iter().filter(|c| c.x_m > from.x + 1e-6 && c.x_m < target.x).collect();
    let mut nodes = vec![from];
    nodes.extend(ahead.iter().map(|c| Vec2::new(c.x_m, c.y_m)));
    nodes.push(target);
    let keeps = |a: Vec2, b: Vec2| {
        ahead.iter().filter(|c| c.x_m > a.x && c.x_m <= b.x).all(|c| {
            let y_m = a.y + (b.y - a.y) * (c.x_m - a.x) / (b.x - a.x);
            if c.side == Side::Above { y_m >= c.y_m - 1e-6 } else { y_m <= c.y_m + 1e-6 }
        })
    };
    let mut least = vec![f64::INFINITY; nodes.len()];
    least[0] = 0.0;
    for j in 1..nodes.len() {
        for i in 0..j {
            if least[i].is_finite() && nodes[j].x > nodes[i].x && keeps(nodes[i], nodes[j]) {
                least[j] = least[j].min(least[i] + (nodes[j] - nodes[i]).norm());
            }
        }
    }
    least.last().copied().filter(|length| length.is_finite())
}

/// Whether the routes past mirrored obstacles are as long as the mirrored routes, from a start at this ordinate, m.
fn routes_are_mirrored(shapes: &[ConvexShape], y: f64) -> Result<(), TestCaseError> {
    let other = routes(&shapes.iter().map(mirrored).collect::<Vec<_>>());
    let routes = routes(shapes);
    prop_assert_eq!(routes.count(), other.count());
    for index in 0..routes.count() {
        let pull = |routes: &Routes, index, y| lane(routes, index, &[]).pull(Vec2::new(-150.0, y), routes.gate_x_m());
        let (a, b) = (pull(&routes, index, y), pull(&other, routes.count() - 1 - index, -y));
        prop_assert!((a.total_m - b.total_m).abs() < 1e-3, "route {}: {:?} is not {:?}", index, a, b);
        prop_assert!((a.to_gate_m - b.to_gate_m).abs() < 1e-3);
    }
    Ok(())
}

/// The first two are too close to pass between them. The envelope of both has an edge across the flight, and the last disc lies exactly
/// behind this edge.
#[test]
fn obstacles_that_are_exactly_behind_each_other_have_mirrored_routes() -> Result<(), TestCaseError> {
    let bar = [
        Vec2::new(37.07969855948021, -88.31322266716366),
        Vec2::new(40.30197649859741, -85.94321741757484),
        Vec2::new(-37.07969855948021, 19.265521877344383),
        Vec2::new(-40.30197649859741, 16.89551662775557),
    ];
    let bar = ConvexShape::new(&bar, 0.0).unwrap();
    let disc = circle(83.19230059228826, -118.14275573690614, 26.633610926628833);
    let behind = circle(157.70998411708092, -117.75753220444955, 9.722355108771811);
    routes_are_mirrored(&[bar, behind, disc], 0.0)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Drones that fly side by side at a distance, past obstacles that leave room on both sides only.
    #[test]
    fn lanes_keep_the_order_and_the_least_distance_of_a_crowd(
        shapes in shapes(),
        ordinates in prop::collection::btree_set(-4000..4000i32, 2..40),
        distance_m in 10.0..80.0f64,
        squeeze in 0.2..1.0f64,
    ) {
        let routes = routes(&shapes);
        let leftmost = routes.count() - 1;
        let sides_m = |route: usize| routes.route(route).constraints().iter().map(|point| point.y_m);
        let (right_m, left_m) = (sides_m(0).fold(f64::MAX, f64::min), sides_m(leftmost).fold(f64::MIN, f64::max));
        // Each drone takes the nearer side. No two are closer than the distance.
        let ordinates = ordinates.into_iter().map(|number| f64::from(number) * distance_m / 10.0).collect::<Vec<_>>();
        let starts: Vec<f64> = ordinates.iter().scan(f64::MIN, |last, &y_m| {
            *last = y_m.max(*last + distance_m);
            Some(*last)
        }).collect();
        let lane = |y_m: f64| if y_m < (right_m + left_m) / 2.0 {
            right_m - routes.lane_m(0, y_m, squeeze)
        } else {
            left_m + routes.lane_m(leftmost, y_m, squeeze)
        };
        for pair in starts.windows(2) {
            let apart_m = lane(pair[1]) - lane(pair[0]);
            let same_side = (pair[0] < (right_m + left_m) / 2.0) == (pair[1] < (right_m + left_m) / 2.0);
            prop_assert!(!same_side || apart_m >= distance_m * squeeze - 1e-9, "{apart_m} m");
            prop_assert!(apart_m > 0.0);
        }
        prop_assert!((1..leftmost).all(|route| routes.lane_m(route, starts[0], squeeze) == 0.0));
        let far_m = left_m + (left_m - right_m) / (1.0 - squeeze).max(1e-3);
        prop_assert!((lane(far_m) - far_m).abs() < 1e-6 || squeeze > 0.999, "a drone that is far away keeps its ordinate");
    }

    #[test]
    fn no_path_is_shorter(shapes in shapes(), y in -200.0..200.0, pick in any::<prop::sample::Index>()) {
        let routes = routes(&shapes);
        let route = pick.index(routes.count());
        let (from, target) = (Vec2::new(-150.0, y), Vec2::new(routes.exit_x_m() + RUN_OUT_M, 0.0));
        let pull = lane(&routes, route, &[]).pull(from, routes.gate_x_m());
        let Some(least_m) = shortest(routes.route(route).constraints(), from, target) else {
            return Err(TestCaseError::fail(format!("route {route} is closed")));
        };
        prop_assert!((pull.total_m - least_m).abs() < 1e-3, "{} is not {}", pull.total_m, least_m);
        prop_assert!(pull.to_gate_m >= routes.gate_x_m() - from.x - 1e-9 && pull.to_gate_m <= pull.total_m);
    }

    #[test]
    fn the_path_is_finite_wherever_the_drone_is(
        shapes in shapes(), (x, y) in (-100.0..400.0, -250.0..250.0), corner in any::<prop::sample::Index>(),
        bodies in prop::collection::vec((-50.0..300.0, -150.0..150.0), 0..4),
    ) {
        let routes = routes(&shapes);
        let bodies: Vec<Body> =
            bodies.iter().map(|&(x, y)| Body { centre_m: Vec2::new(x, y), radius_m: 30.0 }).collect();
        for index in 0..routes.count() {
            let route = routes.route(index);
            let point = route.constraints()[corner.index(route.constraints().len())];
            let lane = lane(&routes, index, &bodies);
            for position in [Vec2::new(x, y), Vec2::new(point.x_m, y), Vec2::new(point.x_m, point.y_m)] {
                let pull = lane.pull(position, routes.gate_x_m());
                prop_assert!((pull.direction.norm() - 1.0).abs() < 1e-9 && pull.direction.x > 0.0, "{:?}", pull);
                prop_assert!(pull.to_gate_m.is_finite() && pull.total_m.is_finite() && pull.total_m > 0.0);
                prop_assert!(pull.to_gate_m >= routes.gate_x_m() - position.x - 1e-9);
            }
        }
    }

    #[test]
    fn the_order_of_the_obstacles_does_not_matter(shapes in shapes()) {
        let mut numbered: Vec<_> = shapes.iter().enumerate().map(|(i, s)| (ObstacleId(i as u32), *s)).collect();
        let routes = Routes::new(&numbered, &PARAMS);
        numbered.reverse();
        prop_assert_eq!(&routes, &Routes::new(&numbered, &PARAMS));
        numbered.rotate_left(1);
        prop_assert_eq!(&routes, &Routes::new(&numbered, &PARAMS));
    }

    #[test]
    fn mirrored_obstacles_have_mirrored_routes(shapes in shapes(), y in -200.0..200.0) {
        routes_are_mirrored(&shapes, y)?;
    }
}

/// The obstacles on the right of a route, of those whose middles have these abscissas, m.
fn on_the_right(routes: &Routes, route: usize, middles_m: &[f64]) -> Vec<bool> {
    let walls = routes.route(route).walls();
    let covers = |wall: &&skein_leader::routes::Wall, x_m: f64| {
        let xs = wall.outline.iter().map(|point| point.x);
        xs.clone().fold(f64::INFINITY, f64::min) < x_m && x_m < xs.fold(f64::NEG_INFINITY, f64::max)
    };
    let side = |&x_m: &f64| walls.iter().find(|wall| covers(wall, x_m)).map(|wall| wall.side == Side::Above);
    middles_m.iter().filter_map(side).collect()
}

/// Of the wall behind a circle, more and more is seen. Its middle was to the right of the circle, and is to the left of it now.
#[test]
fn a_route_stays_on_the_same_side_of_each_obstacle_while_outlines_grow() {
    let middles_m = [0.0, 130.0];
    let numbered = |low_m: f64, high_m: f64| {
        let wall = rectangle(130.0, f64::midpoint(low_m, high_m), 5.0, (high_m - low_m) / 2.0);
        [(ObstacleId(0), circle(0.0, 0.0, 40.0)), (ObstacleId(1), wall)]
    };
    let before = Routes::new(&numbered(-60.0, 30.0), &PARAMS);
    assert_eq!(
        on_the_right(&before, 1, &middles_m),
        [false, true],
        "past the circle on its right, past the wall on its left"
    );
    let grown = before.redrawn(&numbered(-60.0, 90.0), &PARAMS);
    assert_eq!(on_the_right(&grown, 1, &middles_m), [false, true]);
    assert_eq!(on_the_right(&Routes::new(&numbered(-60.0, 90.0), &PARAMS), 1, &middles_m), [true, false]);
    assert_eq!(grown.redrawn(&numbered(-60.0, 120.0), &PARAMS).count(), 3);
}

/// The gap on whose right two of three obstacles lie is closed.
#[test]
fn the_routes_past_obstacles_that_have_grown_together_keep_their_numbers() {
    let shapes = |half_m: f64| {
        let middle = rectangle(100.0, 0.0, 5.0, half_m);
        [rectangle(0.0, -150.0, 5.0, 40.0), middle, rectangle(200.0, 100.0, 105.0, 10.0)]
            .into_iter()
            .enumerate()
            .map(|(i, shape)| (ObstacleId(i as u32), shape))
            .collect::<Vec<_>>()
    };
    let before = Routes::new(&shapes(40.0), &PARAMS);
    let grown = before.redrawn(&shapes(80.0), &PARAMS);
    let sides = |routes: &Routes, route| on_the_right(routes, route, &[0.0, 200.0]);
    assert_eq!((before.count(), grown.count()), (4, 4));
    assert_eq!(
        (0..4).map(|route| sides(&before, route)).collect::<Vec<_>>(),
        [[false, false], [true, false], [true, false], [true, true]]
    );
    assert_eq!(
        (0..4).map(|route| sides(&grown, route)).collect::<Vec<_>>(),
        [[false, false], [true, false], [true, false], [true, true]]
    );
    assert_eq!(grown.route(1), grown.route(2), "no gap is left between the second and the third");
    assert!(before.route(1) != before.route(2));
    assert!(grown.is_between(2) && !grown.is_between(3));
}
