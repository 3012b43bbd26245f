use super::*;
use crate::experiment::Experiment;
use skein_scenario::{Fault, FaultKind};
use std::f64::consts::TAU;
use std::path::Path;

/// Hunts in an experiment with more wind than drones can resist: some are blown into obstacles.
fn hunted(flights: usize, shrink_flights: usize, workers: usize) -> HuntReport {
    let experiment = Experiment::parse(SCENES, "test", Path::new("")).unwrap();
    let wind =
        [("fault.0.kind", "wind"), ("fault.0.wind_mps2", "[12, 0]"), ("fault.0.at_s", "0"), ("fault.0.target", "all")];
    // Drones that are blown away do not come back: these flights would last until the end of their time.
    let keys = wind.into_iter().chain([("time.timeout_s", "60")]);
    let overrides: Vec<_> = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
    let grid = Grid::new(&experiment, &overrides);
    Hunt::new(&grid, &skein_runtime::PilotRegistry::built_in().unwrap())
        .flights(flights)
        .shrink_flights(shrink_flights)
        .workers(workers)
        .run(|_, _| {})
        .unwrap()
}

/// Small random scenes.
const SCENES: &str = r#"
    scenario = "random"
    seeds = 6
    [random]
    drones = [2, 4]
    obstacles = [1, 2]
"#;

#[test]
fn a_hunt_finds_a_failure_and_makes_it_small() {
    let report = hunted(12, 30, 2);
    let finding = report.findings.iter().find(|finding| finding.failure.kind == FailureKind::Clearance);
    let finding = finding.expect("a swarm is blown into an obstacle");
    assert!(finding.failure.value < 1.0 && finding.toml.contains("wind"), "{}", finding.toml);
    assert!(finding.toml.matches("[[obstacle]]").count() == 1 && finding.toml.len() < 1500, "{}", finding.toml);
}

#[test]
fn the_number_of_workers_does_not_change_what_is_found() {
    let report = hunted(8, 10, 1);
    assert!(!report.findings.is_empty());
    assert_eq!(report, hunted(8, 10, 2));
}

#[test]
fn neighbours_are_valid_and_differ() {
    let experiment = Experiment::parse("scenario = \"wide\"\nseeds = 1", "test", Path::new("")).unwrap();
    let parent = Grid::new(&experiment, &[]).scenario(0).unwrap();
    let near: Vec<Scenario> = (0..60).filter_map(|number| mutation::neighbour(&parent, 1, number)).collect();
    assert!(near.iter().any(|one| !one.fault_plan.is_empty()), "faults are added");
    assert!(near.len() >= 45 && near.iter().filter(|one| **one != parent).count() >= 36, "{}", near.len());
}

/// Ranging fails in every way: it is wrong, missing, late and narrow, and obstacles hide others from some of the drones.
#[test]
fn faults_of_ranging_are_drawn_with_all_their_keys() {
    let experiment = Experiment::parse("scenario = \"wide\"\nseeds = 1", "test", Path::new("")).unwrap();
    let parent = Grid::new(&experiment, &[]).scenario(0).unwrap();
    let near = (0..600).filter_map(|number| mutation::neighbour(&parent, 1, number));
    let faults: Vec<Fault> =
        near.flat_map(|one| one.fault_plan).filter(|fault| fault.kind == FaultKind::Ranging).collect();
    let every = |key: fn(&Fault) -> Option<f64>, below: f64| {
        faults.iter().all(|fault| key(fault).is_some_and(|value| value > 0.0 && value < below))
    };
    assert!(every(|fault| fault.ranging_std_m, 100.0) && every(|fault| fault.ranging_dropout_share, 0.5));
    assert!(every(|fault| fault.ranging_latency_s, 2.0) && every(|fault| fault.ranging_field_rad, TAU));
    for hidden in [true, false] {
        assert!(faults.iter().any(|fault| fault.ranging_occlusion == Some(hidden)), "{hidden} in {}", faults.len());
    }
}
