//! RVO2 by its Python module `pyrvo`, in a process of its own.

use crate::error::BenchError;
use crate::runtime::workload::Workload;
use serde::Deserialize;
use serde_json::json;
use std::path::Path;
use std::process::Command;

/// Flies the grid. The time of its own, not Python's start, is measured.
const SCRIPT: &str = include_str!("rvo2.py");
/// Neighbours that an agent looks at, as in the library's own examples.
const NEIGHBOURS: u32 = 10;
/// Time for which velocities have to be free of collisions, s, as in the library's own examples.
const HORIZON_S: f64 = 10.0;
/// Steps before the measurement.
const WARM_UP: u32 = 60;

/// What the script prints.
#[derive(Deserialize)]
struct Measured {
    cpu_s: f64,
    steps: f64,
    flown_m: f64,
}

/// Checks that Python has the module.
pub(super) fn check(python: &Path) -> Result<(), BenchError> {
    run(python, "import pyrvo", None).map(|_| ())
}

/// Agent-steps per second of CPU time.
pub(super) fn steps_per_s(python: &Path, workload: &Workload) -> Result<f64, BenchError> {
    let scenario = &workload.scenario;
    let flight = json!({
        "positions_m": scenario.starts().iter().map(|place| [place.x, place.y]).collect::<Vec<_>>(),
        "ticks": workload.window(), "warm_up": WARM_UP, "dt_s": scenario.time.dt_s,
        "neighbour_m": scenario.ranging_m(), "neighbours": NEIGHBOURS, "horizon_s": HORIZON_S,
        "radius_m": scenario.drone.safe_distance_m / 2.0,
        "speed_mps": scenario.drone.speed_mps, "speed_max_mps": scenario.drone.speed_max_mps,
    });
    let printed = run(python, SCRIPT, Some(&flight.to_string()))?;
    let broken = |why: String| BenchError::NoPeer { python: python.to_owned(), why };
    let measured: Measured = serde_json::from_str(&printed).map_err(|error| broken(error.to_string()))?;
    let wanted_m = scenario.drone.speed_mps * scenario.time.dt_s * (workload.window() + u64::from(WARM_UP)) as f64;
    if (measured.flown_m - wanted_m).abs() > 0.01 * wanted_m {
        return Err(broken(format!("its agents flew {} m of {wanted_m} m", measured.flown_m)));
    }
    Ok(measured.steps / measured.cpu_s)
}

fn run(python: &Path, script: &str, argument: Option<&str>) -> Result<String, BenchError> {
    let broken = |why: String| BenchError::NoPeer { python: python.to_owned(), why };
    let mut command = Command::new(python);
    command.args(["-c", script]).args(argument).env("OMP_NUM_THREADS", "1");
    let done = command.output().map_err(|error| broken(error.to_string()))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(broken(said.lines().last().unwrap_or("it failed without a word").to_owned()));
    }
    Ok(String::from_utf8_lossy(&done.stdout).into_owned())
}
