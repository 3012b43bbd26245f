//! The scenario files of this repository, and the key reference.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, reason = "tests read files, and fail where they cannot")]

use skein_scenario::{End, Scenario, ScenarioSource};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "toml") {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn load(path: &Path) -> Scenario {
    let (name, stem) = (path.to_string_lossy(), path.file_stem().unwrap().to_string_lossy());
    let source = ScenarioSource { name: &name, stem: &stem };
    Scenario::parse_bytes(&std::fs::read(path).unwrap(), source, &[]).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn every_file_below_scenarios_is_valid_and_survives_json_and_toml() {
    let files = files(&root().join("scenarios"));
    assert!(files.len() >= 9, "only {} files", files.len());
    for path in files {
        let scenario = load(&path);
        let source = ScenarioSource { name: "again", stem: "again" };
        let json = serde_json::to_string(&scenario).unwrap();
        assert_eq!(serde_json::from_str::<Scenario>(&json).unwrap(), scenario, "{}", path.display());
        let checked = Scenario::from_json(&serde_json::from_str(&json).unwrap(), source);
        assert_eq!(checked.unwrap(), scenario, "{}", path.display());
        assert_eq!(Scenario::parse(&scenario.to_toml().unwrap(), source, &[]).unwrap(), scenario);
    }
}

#[test]
fn the_paper_scenarios_have_the_published_parameters() {
    // Id, spacing, safe distance, detection range, centre x, shift, half sizes, greatest speed while re-forming.
    let table = [
        ("s1", 35.0, 33.0, 115.0, 167.0, 110.0, [10.0, 75.0], 20.0),
        ("s2", 65.0, 37.0, 90.0, 144.0, 115.0, [5.0, 80.0], 15.0),
        ("s3b", 90.0, 35.0, 65.0, 70.0, 130.0, [5.0, 80.0], 10.0),
    ];
    for (id, spacing, safe, range, x, shift, half, reform) in table {
        for (place, side) in [("centred", 0.0), ("left", 1.0), ("right", -1.0)] {
            let s = load(&root().join(format!("scenarios/paper/{id}-{place}.toml")));
            assert_eq!(s.name, format!("{id}-{place}"));
            assert_eq!((s.formation.drones, s.formation.spacing_m, s.drone.safe_distance_m), (8, spacing, safe));
            assert_eq!((s.sensors.detection_range_m, s.reform_speed_max_mps()), (range, reform));
            let (low, high) = s.shapes().unwrap()[0].bounds();
            assert_eq!(
                [low.x, low.y, high.x, high.y],
                [x - half[0], side * shift - half[1], x + half[0], side * shift + half[1]]
            );
            let goal = (id == "s3b").then_some([425.0, 0.0]);
            assert_eq!((s.mission.goal_m, s.mission.end == End::Goal), (goal, goal.is_some()));
        }
    }
}

/// `SKEIN_WRITE_DOCS=1 cargo test -p skein-scenario` writes the page instead of comparing with it.
#[test]
fn the_key_reference_is_up_to_date() {
    let path = root().join("docs/scenario.md");
    let page = skein_scenario::markdown();
    if std::env::var_os("SKEIN_WRITE_DOCS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(written == page, "docs/scenario.md is out of date: run this test with SKEIN_WRITE_DOCS=1");
}

#[test]
fn every_key_has_a_meaning_a_range_and_a_default() {
    for key in skein_scenario::keys() {
        assert!(key.meaning.ends_with('.'), "{key:?}");
        assert!(!key.range.is_empty() && !key.default.is_empty(), "{key:?}");
        assert!(!key.range.contains("finite"), "{key:?} has no limits");
    }
}
