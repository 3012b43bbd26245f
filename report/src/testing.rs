//! Facts and rows for the tests of this crate.

use crate::facts::{MissionEnd, RunFacts};
use skein_protocol::formation::Shape;
use skein_protocol::record::{DroneRow, ROW_ALIVE};

/// A run of `drones` in the nested V, without obstacles.
pub(crate) fn facts(drones: u32) -> RunFacts {
    RunFacts {
        scenario: "s1".to_owned(),
        strategy: "congestion-aware".to_owned(),
        seed: 7,
        runtime: "processes".to_owned(),
        clock: "lockstep".to_owned(),
        drones,
        dt_s: 0.02,
        shape: Shape::NestedV,
        spacing_m: 35.0,
        end: MissionEnd::Hold,
        course: skein_protocol::Course::East,
        course_y_m: 0.0,
        safe_distance_m: 25.0,
        clearance_m: 15.0,
        planning_distance_m: 20.0,
        arrival_error_m: 0.8,
        radio_range_m: None,
        pilots: Vec::new(),
        obstacles: Vec::new(),
        topics: vec![],
        scene: Default::default(),
    }
}

/// A living drone at rest.
pub(crate) fn row(x_m: f64, y_m: f64) -> DroneRow {
    DroneRow { position_m: [x_m, y_m, 50.0], flags: ROW_ALIVE, ..DroneRow::default() }
}
