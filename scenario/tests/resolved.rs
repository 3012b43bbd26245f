//! What follows from a valid scenario.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use proptest::prelude::*;
use skein_protocol::Vec2;
use skein_protocol::formation::Shape;
use skein_protocol::radio::Radio;
use skein_scenario::{Failsafe, Scenario, ScenarioSource, Strategy, schema};

const SOURCE: ScenarioSource<'_> = ScenarioSource { name: "s.toml", stem: "my mission" };

fn parse(text: &str, sets: &[(&str, &str)]) -> Scenario {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    Scenario::parse(text, SOURCE, &sets).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn the_shortest_scenario_has_the_defaults_of_the_paper() {
    let s = parse("[formation]", &[]);
    assert_eq!((s.name.as_str(), s.seed, s.strategy), ("my-mission", 1, Strategy::PaperRule));
    assert!((9.81 * s.drone.drag_coefficient - 5.0).abs() < 1e-12);
    assert!((s.stopping_distance_m() - 10.0).abs() < 1e-9);
    assert_eq!(s.starts(), Shape::NestedV.slots(8, 40.0));
    assert_eq!((s.radio(), s.channel()), (Radio { seed: 1, ..Radio::default() }, None));
    assert_eq!(s.faults.failsafe, Failsafe::Hover);
    assert!(s.shapes().unwrap().is_empty());
}

#[test]
fn defaults_follow_the_scenario() {
    let of = |sets: &[(&str, &str)]| parse("[formation]", sets);
    // A drone brakes with g·c_d, at most with its greatest acceleration.
    assert!((of(&[("drone.drag_coefficient", "0.2")]).braking_mps2() - 1.962).abs() < 1e-12);
    assert_eq!(of(&[("drone.drag_coefficient", "5")]).braking_mps2(), 5.0);
    // All beacons take at most a quarter of the satellite's 256 kbit/s.
    let beacon_s = |preset, drones| of(&[("radio.preset", preset), ("formation.drones", drones)]).beacon_period_s();
    let frame_bits = 8.0 * (8 + size_of::<skein_protocol::payload::Pose>()) as f64;
    assert_eq!((beacon_s("ideal", "64"), beacon_s("wifi", "8")), (0.1, 0.1));
    assert!((beacon_s("satellite", "16") - 16.0 * frame_bits / 64_000.0).abs() < 1e-12);
    assert_eq!(beacon_s("satellite", "200"), 0.5, "a third of the peer time-out");
    assert_eq!(of(&[("radio.preset", "satellite"), ("protocol.beacon_period_s", "0.2")]).beacon_period_s(), 0.2);
    // Of a column with 40 m between two drones, 31 are within 600 m of one; all share the channel of a satellite.
    let column =
        |preset: &str| of(&[("radio.preset", preset), ("formation.shape", "column"), ("formation.drones", "64")]);
    assert_eq!((column("wifi").channel_drones(), column("satellite").channel_drones()), (31, 64));
    // A column of 64 is 2520 m long, and its stop is 100 m ahead: 262 s at 10 m/s. 64 headways of 3.85 s come on top.
    assert_eq!(of(&[]).timeout_s(), 600.0);
    let column = of(&[("formation.shape", "column"), ("formation.drones", "64")]);
    assert_eq!(column.timeout_s(), (5.0 * (262.0 + 64.0 * 3.85_f64)).ceil());
    // One drone: five times the way and one headway, wherever the destination is.
    let to = |end: &[(&str, &str)]| of(&[end, &[("formation.drones", "1")]].concat()).timeout_s();
    let smooth_s = |way_m: f64| (5.0 * (way_m / 10.0 + 3.85)).ceil();
    assert_eq!(to(&[("mission.stop_x_m", "5000")]), smooth_s(5000.0));
    for goal in ["[3000, 0]", "[0, -3000]", "[-3000, 0]"] {
        assert_eq!(to(&[("mission.end", "'goal'"), ("mission.goal_m", goal)]), smooth_s(3000.0), "{goal}");
    }
    assert_eq!(of(&[("time.timeout_s", "7")]).timeout_s(), 7.0);
    // While re-forming, drones fly at most at v + δ.
    assert_eq!(of(&[]).reform_speed_max_mps(), 15.0);
    let small = [("drone.speed_mps", "3"), ("drone.speed_change_mps", "2"), ("drone.speed_max_mps", "4")];
    assert_eq!((of(&small[..2]).reform_speed_max_mps(), of(&small).reform_speed_max_mps()), (5.0, 4.0));
    assert_eq!(of(&[("mission.reform_speed_max_mps", "20")]).reform_speed_max_mps(), 20.0);
}

#[test]
fn overrides_are_toml_or_strings() {
    let text = "[formation]\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [200, 0]\nradius_m = 5";
    let sets = [
        ("strategy", "fixed:5/3"),
        ("obstacle.0.centre_m", "[300, 20]"),
        ("obstacle.0.centre_m.1", "21"),
        ("radio.delay_s", "0.2"),
        ("radio.range_m", "500"),
        ("faults.failsafe", "\"land\""),
        ("seed", "9223372036854775807"),
    ];
    let s = parse(text, &sets);
    assert_eq!(s.strategy, Strategy::Fixed { left: 5, right: 3 });
    assert_eq!(s.shapes().unwrap()[0].centre(), Vec2::new(300.0, 21.0));
    let Radio { seed, channel: air, .. } = s.radio();
    assert_eq!((air.delay.mean_s, air.range.map(|range| range.half_m), seed), (0.2, Some(500.0), i64::MAX as u64));
    assert_eq!(s.faults.failsafe, Failsafe::Land);
    assert_eq!(Scenario::parse(&s.to_toml().unwrap(), SOURCE, &[]).unwrap(), s);
}

#[test]
fn jitter_is_uniform_in_its_disc_and_depends_on_seed_and_drone() {
    let with = |seed: &str| {
        parse("[formation]\nshape = \"line\"\ndrones = 4000\nspacing_m = 60\nstart_jitter_m = 10", &[("seed", seed)])
    };
    let (one, two) = (with("1"), with("2"));
    let moved = |s: &Scenario| s.starts().iter().zip(s.slots()).map(|(a, b)| (a - b) / 10.0).collect::<Vec<_>>();
    let (a, b) = (moved(&one), moved(&two));
    assert_eq!(a, moved(&one));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).norm() > 1e-9), "another seed gives another jitter");
    assert!(a.iter().all(|p| p.norm() <= 1.0 + 1e-9));
    // Uniform in the disc: a quarter within half the radius, ± five standard deviations; the mean at the centre.
    let inner = a.iter().filter(|p| p.norm() < 0.5).count() as f64;
    assert!((inner - 1000.0).abs() < 5.0 * (4000.0f64 * 0.25 * 0.75).sqrt(), "{inner}");
    let mean = a.iter().sum::<Vec2>() / 4000.0;
    assert!(mean.norm() < 5.0 * 0.5 / 4000.0f64.sqrt() * 2.0f64.sqrt(), "{mean}");
}

#[test]
fn polygons_of_both_orientations_and_ellipses_become_convex_shapes() {
    let shape = |obstacle: &str| parse(&format!("[formation]\n[[obstacle]]\n{obstacle}"), &[]).shapes().unwrap()[0];
    let left = shape("shape = \"polygon\"\nvertices_m = [[100, 0], [110, 0], [110, 8]]");
    let right = shape("shape = \"polygon\"\nvertices_m = [[110, 8], [110, 0], [100, 0]]");
    assert_eq!(left, right);
    let ellipse = shape("shape = \"ellipse\"\ncentre_m = [200, 5]\nsemi_axes_m = [30, 10]\nrotation_rad = 0.3");
    assert_eq!(ellipse.count, 16);
    let (sin, cos) = 0.3f64.sin_cos();
    for i in 0..360 {
        let (s, c) = f64::from(i).to_radians().sin_cos();
        let on = Vec2::new(200.0 + 30.0 * c * cos - 10.0 * s * sin, 5.0 + 30.0 * c * sin + 10.0 * s * cos);
        let n = 16;
        let edge = |k: usize| (ellipse.vertex(k), ellipse.vertex((k + 1) % n));
        assert!((0..n).map(edge).all(|(a, b)| (b - a).perp(&(on - a)) > -1e-9), "the ellipse sticks out at {i}°");
    }
    assert!(ellipse.vertices().all(|v| (v - Vec2::new(200.0, 5.0)).norm() < 30.0 * 1.02));
}

#[test]
fn offsets_replace_the_shape() {
    let s = parse("[formation]\noffsets_m = [[0, 0], [-40, 30], [-40, -30]]\nstart_m = [7, 1]", &[]);
    assert_eq!((s.formation.shape, s.formation.drones), (None, 3));
    assert_eq!(s.starts()[1], Vec2::new(-33.0, 31.0));
    assert_eq!(Scenario::parse(&s.to_toml().unwrap(), SOURCE, &[]).unwrap(), s);
    let json = serde_json::to_value(&s).unwrap();
    assert_eq!(Scenario::from_json(&json, SOURCE).unwrap(), s);
}

#[test]
fn json_is_checked_like_toml() {
    let mut json = serde_json::to_value(parse("[formation]", &[])).unwrap();
    json["formation"]["drones"] = 1_000_000_000.into();
    let error = Scenario::from_json(&json, SOURCE).unwrap_err().to_string();
    assert!(error.contains("formation.drones: found 1000000000, expected a whole number from 1 to 10000"), "{error}");
}

#[test]
fn ten_thousand_drones_are_checked() {
    for shape in ["nested-v", "v", "line", "column", "grid", "circle"] {
        let s = parse(
            &format!("[formation]\nshape = \"{shape}\"\ndrones = 10000\nstart_jitter_m = 1\nspacing_m = 40"),
            &[],
        );
        assert_eq!(s.starts().len(), 10_000);
    }
}

#[test]
fn ranges_are_in_the_schema() {
    let schema = schema();
    let at = |path: &str| schema.pointer(path).unwrap_or_else(|| panic!("no {path}"));
    assert_eq!(at("/properties/formation/properties/drones/maximum"), 10_000);
    assert_eq!(at("/properties/time/properties/dt_s/minimum"), 1e-4);
    assert_eq!(at("/properties/time/properties/timeout_s/exclusiveMinimum"), 0.0);
    assert_eq!(at("/properties/formation/properties/offsets_m/items/items/maximum"), 1e6);
    assert_eq!(at("/properties/mission/properties/goal_m/items/minimum"), -1e6);
    assert_eq!(at("/properties/obstacle/items/oneOf/0/properties/half_size_m/items/minimum"), 1e-3);
    assert_eq!(at("/properties/obstacle/maxItems"), 1024);
    assert_eq!(at("/required"), &serde_json::json!(["formation"]));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_bytes_are_parsed_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..60)) {
        let mut text = b"[formation]\n".to_vec();
        text.extend(bytes);
        let _ = Scenario::parse_bytes(&text, SOURCE, &[]).map_err(|errors| errors.to_string());
    }

    #[test]
    fn any_override_is_parsed_without_a_panic(key in "[a-z_.0-9]{0,20}", value in "[\\[\\]{}=a-z0-9.,\"\n ]{0,20}") {
        let sets = [(key, value)];
        let file = "[formation]\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [200, 0]\nradius_m = 5";
        let _ = Scenario::parse(file, SOURCE, &sets).map_err(|errors| errors.to_string());
    }

    #[test]
    fn json_and_toml_keep_every_bit(speed in 5.0..20.0f64, x in -1e6..1e6f64, seed in 0..i64::MAX) {
        let set = |key: &str, value: String| (key.to_owned(), value);
        let sets = [
            set("drone.speed_mps", format!("{speed:?}")),
            set("formation.start_m", format!("[{x:?}, 0]")),
            set("seed", seed.to_string()),
            set("sensors.detection_range_m", "100".to_owned()),
        ];
        let s = Scenario::parse("[formation]", SOURCE, &sets).unwrap();
        prop_assert_eq!(&serde_json::from_str::<Scenario>(&serde_json::to_string(&s).unwrap()).unwrap(), &s);
        prop_assert_eq!(&Scenario::parse(&s.to_toml().unwrap(), SOURCE, &[]).unwrap(), &s);
    }
}

#[test]
fn obstacles_above_and_below_are_not_in_the_way() {
    let block = |x: f64, heights: &str| {
        format!("[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [{x}, 0]\nhalf_size_m = [5, 5]\n{heights}\n")
    };
    let blocks = [(100.0, ""), (200.0, "top_m = 30"), (300.0, "top_m = 30.5"), (400.0, "floor_m = 70\ntop_m = 80")];
    let text: String = blocks.iter().map(|(x, heights)| block(*x, heights)).collect();
    let s = parse(&format!("[formation]\n{text}"), &[]);
    assert_eq!((s.altitude_m(), s.shapes().unwrap().len()), (50.0, 4));
    let in_the_way: Vec<u32> = s.shapes_in_the_way().unwrap().into_iter().map(|(id, _)| id).collect();
    assert_eq!(in_the_way, [0, 2]);
    assert_eq!(parse("[formation]\n[avoidance]\nclearance_m = 80\nplanning_distance_m = 90", &[]).altitude_m(), 80.0);
}

#[test]
fn a_ring_of_obstacles_is_closed_by_gaps_of_twice_the_distance_to_keep() {
    let closed = |gap_m: f64, sets: &[(&str, &str)]| {
        let wall = |x: f64, y: f64, half_x: f64, half_y: f64| {
            format!("[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [{x}, {y}]\nhalf_size_m = [{half_x}, {half_y}]\n")
        };
        let door = [1.0, -1.0].map(|side| wall(100.0, side * (50.0 + gap_m / 2.0), 5.0, 50.0));
        let others = wall(0.0, 110.0, 105.0, 10.0) + &wall(0.0, -110.0, 105.0, 10.0) + &wall(-100.0, 0.0, 5.0, 105.0);
        let scenario = parse(&format!("[formation]\ndrones = 1\n{}{others}", door.concat()), sets);
        !scenario.drones_without_a_way().unwrap().is_empty()
    };
    assert_eq!([30.007, 30.009].map(|gap_m| closed(gap_m, &[])), [true, false]);
    let error = [("sensors.obstacle_error_max_m", "0.5")];
    assert_eq!([31.007, 31.009].map(|gap_m| closed(gap_m, &error)), [true, false]);
}
