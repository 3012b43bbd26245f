//! The mission's routine and obstacle detection: A1, A2, E1 to E4.

use super::flown::{Flown, fly_file, scenario, velocity};
use skein_agent::detection::Braking;
use skein_protocol::Phase;
use skein_protocol::record::EventKind;
use skein_scenario::{Scenario, ScenarioSource};

#[test]
fn a1_the_steps_of_the_routine_follow_each_other() {
    let flown = fly_file("paper/s2-right", &[]);
    let phase =
        |wanted: Phase| move |what: &EventKind| matches!(what, EventKind::Grouping { phase, .. } if *phase == wanted);
    let steps = [
        flown.when(|what| matches!(what, EventKind::Leader { leads: true, .. })),
        flown.when(phase(Phase::Cruise)),
        flown.detected_s(0),
        flown.when(phase(Phase::Avoid)),
        flown.passed_s(0),
        flown.when(phase(Phase::Reform)),
        flown.when(|what| matches!(what, EventKind::End { .. })),
    ];
    assert!(steps.is_sorted(), "{steps:?}");
}

#[test]
fn a2_an_obstacle_is_detected_in_the_tick_in_which_it_is_in_range() {
    for (name, range_m) in [("paper/s1-right", 115.0), ("paper/s2-right", 90.0), ("paper/forest", 70.0)] {
        let flown = fly_file(name, &[]);
        let first = flown.events.iter().find_map(|event| match event.what {
            EventKind::Detected { distance_m, .. } => Some(distance_m),
            _ => None,
        });
        // At 10 m/s a tick is 0.2 m.
        let distance_m = first.unwrap();
        assert!(distance_m <= range_m && distance_m > range_m - 0.21, "{name}: {distance_m} m");
    }
}

#[test]
fn e1_to_e4_a_scenario_has_the_stopping_distance_of_the_equations_and_must_sense_that_far() {
    let s2 = |t_c: &str| scenario("paper/s2-right", &[("drone.reaction_time_s", t_c)]);
    for (t_c, stopping_m) in [("0", 10.0), ("0.3", 13.0)] {
        let flown = s2(t_c);
        let braking = Braking { deceleration_mps2: flown.braking_mps2(), reaction_time_s: flown.drone.reaction_time_s };
        assert!((braking.stopping_m(10.0) - stopping_m).abs() < 1e-9);
        assert!((flown.stopping_distance_m() - stopping_m).abs() < 1e-9);
    }
    // A drone must be able to stop 15 m before an obstacle that it senses. That takes 25 m without t_c, and 30 m with half a
    // second.
    let text = s2("0").to_toml().unwrap();
    let with = |t_c: &str| {
        let sets = [("drone.reaction_time_s", t_c), ("sensors.detection_range_m", "26")];
        let sets = sets.map(|(key, value)| (key.to_owned(), value.to_owned()));
        Scenario::parse(&text, ScenarioSource { name: "s2", stem: "s2" }, &sets)
    };
    assert!(with("0").is_ok());
    let refused = with("0.5").unwrap_err().to_string();
    assert!(refused.contains("detection_range_m"), "{refused}");
}

/// When the first drone leaves the course, s.
fn turns_s(flown: &Flown) -> f64 {
    let turned = |(_, rows): &&(f64, Vec<_>)| rows.iter().any(|row| velocity(row).y.abs() > 0.05);
    flown.ticks.iter().find(turned).unwrap().0
}

#[test]
fn e4_a_reaction_time_delays_the_drone_and_increases_its_distances() {
    let (quick, slow) =
        (fly_file("paper/s2-right", &[]), fly_file("paper/s2-right", &[("drone.reaction_time_s", "0.4")]));
    let [decided, later] = [&quick, &slow].map(|flown| turns_s(flown) - flown.grouping().1);
    assert!((0.4..0.6).contains(&(later - decided)), "turned {decided} and {later} s after the decision");
    assert!(slow.separation_m() > quick.separation_m() + 0.5, "{} and {}", slow.separation_m(), quick.separation_m());
}
