//! Faults of sensors and clocks that a drone does not know of, in whole flights.
#![allow(clippy::unwrap_used)]

mod support;

use skein_protocol::record::Outcome;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Vec3};
use skein_runtime::{StepScratch, mission};
use support::{fly_to_the_end, parse, pilot_hosts, scenario};

const PAPERS_RULE: (&str, &str) = ("strategy", "congestion-aware-paper");

/// The same fault, with the margin that follows from it, and with one that is declared too small.
#[test]
fn the_margin_is_what_keeps_drones_apart_when_a_position_is_biased() {
    for drone in ["3", "5"] {
        let fault = format!("{{ kind = \"gnss\", position_bias_m = [0, 12], at_s = 6, for_s = 25, drone = {drone} }}");
        let sets = [PAPERS_RULE, ("sensors.ranging", "false"), ("fault.0", fault.as_str())];
        let flown = |more: &[(&str, &str)]| fly_to_the_end(&scenario("paper/s2-right", &[&sets, more].concat()), None);
        assert_eq!(flown(&[]).ended(), Some(Outcome::Reached), "drone {drone}");
        assert_eq!(flown(&[("sensors.position_error_max_m", "0")]).ended(), Some(Outcome::Unsafe), "drone {drone}");
    }
}

/// Ranging that is late, narrow or hidden by obstacles changes the flight of drones that range each other, and of no others. All of them
/// arrive with every distance kept. In S2 no drone is behind the wall and in range of another one, so the wall hides none.
#[test]
fn late_narrow_and_hidden_ranging_acts_and_is_flown_through() {
    for name in ["paper/s2-right", "paper/forest"] {
        for ranging in ["true", "false"] {
            let flown = |key: &str| {
                let fault = format!("{{ kind = \"ranging\", on = \"detected\", target = \"all\", ranging_{key} }}");
                let sets = [PAPERS_RULE, ("sensors.ranging", ranging), ("fault.0", fault.as_str())];
                fly_to_the_end(&scenario(name, &sets), None)
            };
            let harmless = flown("std_m = 0").digest();
            for key in ["latency_s = 2", "field_rad = 1.5", "occlusion = true"] {
                let (world, what) = (flown(key), format!("{name}, ranging {ranging}, {key}"));
                assert_eq!((world.ended(), world.violations()), (Some(Outcome::Reached), 0), "{what}");
                let acts = ranging == "true" && (name, key) != ("paper/s2-right", "occlusion = true");
                assert_eq!(world.digest() != harmless, acts, "{what}");
            }
        }
    }
}

/// While no drone senses obstacles, each hovers: none would tell it of one ahead. Then the mission goes on.
#[test]
fn a_swarm_in_which_no_drone_senses_obstacles_waits() {
    for name in ["paper/forest", "narrow/gap"] {
        let fault = r#"{ kind = "blind", sensor = "obstacles", at_s = 6, for_s = 30, target = "all" }"#;
        let world = fly_to_the_end(&scenario(name, &[PAPERS_RULE, ("fault.0", fault)]), None);
        assert_eq!((world.ended(), world.violations()), (Some(Outcome::Reached), 0), "{name}");
    }
}

/// The process of a drone with a wrong position and clock is stopped, or replaced, while its faults begin and end.
#[test]
fn faults_of_sensors_outlive_the_process() {
    let wrong = [
        "{ kind = \"clock\", clock_offset_s = -1, at_s = 8, for_s = 3, drone = 3 }",
        "{ kind = \"clock\", clock_offset_s = 1, clock_drift_ppm = 500, at_s = 10, drone = 3 }",
        "{ kind = \"gnss\", position_bias_m = [1, 1], position_drift_mps = [-0.1, 0], at_s = 10, for_s = 20, drone = 3 }",
    ];
    for kind in ["restart", "freeze"] {
        for (ranging, reaction_time_s) in [("true", "0"), ("true", "0.2"), ("false", "0"), ("false", "0.2")] {
            let stopped = format!("{{ kind = \"{kind}\", at_s = 9, for_s = 3, drone = 3 }}");
            let sets = [
                PAPERS_RULE,
                ("sensors.ranging", ranging),
                ("drone.reaction_time_s", reaction_time_s),
                ("fault.0", stopped.as_str()),
                ("fault.1", wrong[0]),
                ("fault.2", wrong[1]),
                ("fault.3", wrong[2]),
            ];
            let world = fly_to_the_end(&scenario("paper/s2-right", &sets), None);
            let what = format!("{kind}, ranging {ranging}, reaction time {reaction_time_s} s");
            assert_eq!((world.ended(), world.violations()), (Some(Outcome::Reached), 0), "{what}");
        }
    }
}

/// A drone that reacts late takes a clock that jumps ahead for what it is, and not for ticks that it has missed: it does not brake.
#[test]
fn a_jump_of_the_clock_voids_no_command() {
    let text = "[formation]\ndrones = 1\n[drone]\nreaction_time_s = 0.2\n[mission]\nend = \"hold\"\nstop_x_m = 500\n\
        [[fault]]\nkind = \"clock\"\nclock_offset_s = 1\nat_s = 3\ndrone = 0\n";
    let scenario = parse(text, &[PAPERS_RULE]);
    let (mut world, mut hosts) = (mission::world(&scenario).unwrap(), pilot_hosts(&scenario));
    let (mut scratch, mut stats) = (StepScratch::default(), LinkStats::default());
    while world.now().secs() < 4.0 {
        let mut slot = Slot::default();
        let down = world.downlink().view();
        let frames: Vec<_> = hosts[0].step(&down, &mut scratch, &mut slot, &mut stats).frames().collect();
        world.take_slot(DroneId(0), &slot);
        world.take_frames(DroneId(0), &frames);
        world.advance();
        let speed_mps = Vec3::from(world.record().rows[0].velocity_mps).norm();
        assert!(speed_mps > 9.9, "{speed_mps} m/s at {} s", world.now().secs());
    }
}
