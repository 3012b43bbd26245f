//! Plots of a flown run, drawn from its trace.csv, so that they can be redone at any time. SVG, light background, colours
//! that colour-blind people tell apart (Okabe and Ito).

mod curves;
mod flight;
mod lines;
mod recording;
pub mod reproduce;
mod samples;
mod style;
pub mod surface;
pub mod sweep;
mod timeline;
mod tracks;

use crate::deviation::ShapeDeviation;
use crate::error::{DrawError, ReportError};
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use curves::{Band, Curve, Figure};
use recording::Recording;
use samples::Samples;
use std::path::PathBuf;
use style::{BLUE, RED};
pub(crate) use tracks::outline;

/// Names of the plots in a run's `plots` folder: tracks, least separation, speed, distance between drones, energy,
/// slot error, who led, messages; the flight, animated; distance from the target shape, bending energy.
pub const FILES: [&str; 11] = [
    "trace.svg",
    "separation.svg",
    "speed.svg",
    "distance.svg",
    "energy.svg",
    "formation.svg",
    "leaders.svg",
    "messages.svg",
    "flight.svg",
    "disturbance.svg",
    "bending.svg",
];

/// Draws the plots of a run from its trace.csv, and from the events and counts in its run.mcap, and writes formation.csv
/// beside it: how far the swarm was from its target shape. Plots that have no data are left out: all of them for an empty
/// trace, those of distances for a lone drone, those of the shape for a very large swarm.
///
/// # Errors
/// [`ReportError::Io`], [`ReportError::Content`] for a broken trace, [`ReportError::Recording`], [`ReportError::Plot`].
pub fn write(folder: &RunFolder, facts: &RunFacts) -> Result<Vec<PathBuf>, ReportError> {
    let samples = Samples::read(&folder.path().join(crate::trace::FILE), facts)?;
    crate::deviation::write(folder.path(), &samples.deviations.samples)?;
    let recording = Recording::read(folder)?;
    let plots = folder.plots()?;
    let mut written = Vec::new();
    for (name, svg) in FILES.iter().zip(draw(&samples, &recording, facts)) {
        let path = plots.join(name);
        if let Some(svg) = svg {
            let svg = svg.map_err(|source| ReportError::Plot { path: path.clone(), source })?;
            std::fs::write(&path, svg).map_err(ReportError::io(&path))?;
            written.push(path);
        }
    }
    Ok(written)
}

/// The colours of groups, in order, as red, green and blue.
pub(crate) fn palette() -> [(u8, u8, u8); 7] {
    style::PALETTE.map(|colour| (colour.0, colour.1, colour.2))
}

/// A drawn plot, or why it cannot be drawn; `None` without data.
type Drawn = Option<Result<String, DrawError>>;

fn draw(samples: &Samples, recording: &Recording, facts: &RunFacts) -> [Drawn; 11] {
    let run = format!("{}, {} drones, {}", facts.scenario, facts.drones, facts.strategy);
    let safe = || Curve {
        label: format!("safe distance, {} m", facts.safe_distance_m),
        colour: RED,
        level: facts.safe_distance_m,
    };
    let separation = Figure {
        title: format!("Least separation: {run}"),
        y_label: "distance between the two nearest drones (m)",
        line_label: "least separation",
        band: exact(&samples.separation),
        level: Some(safe()),
    };
    let speed = Figure {
        title: format!("Speed: {run}"),
        y_label: "speed (m/s)",
        line_label: "mean over drones",
        band: samples.speed.clone(),
        level: None,
    };
    let distance = Figure {
        title: format!("Distance between drones: {run}"),
        y_label: "distance between drones (m)",
        line_label: "mean over pairs",
        band: samples.distance.clone(),
        level: Some(safe()),
    };
    let shape = |title: &str, y_label, line_label, of: fn(&ShapeDeviation) -> f64| {
        let band = |deviation: &ShapeDeviation| Band { t_s: deviation.t_s, mean: of(deviation), deviation: 0.0 };
        let band = samples.deviations.samples.iter().map(band).collect();
        Figure { title: format!("{title}: {run}"), y_label, line_label, band, level: None }
    };
    let disturbance = shape(
        "Disturbance of the formation",
        "distance from the target shape (m)",
        "root mean square over drones, after the best translation and assignment",
        |deviation| deviation.disturbance_m,
    );
    let bending = shape(
        "Bending energy",
        "bending energy (1)",
        "of the thin-plate spline that takes the target shape to the drones",
        |deviation| deviation.bending,
    );
    let energy = Figure {
        title: format!("Energy: {run}"),
        y_label: "energy used by a drone (J)",
        line_label: "mean over drones",
        band: samples.energy.clone(),
        level: None,
    };
    let formation = Figure {
        title: format!("Largest slot error, after the best translation: {run}"),
        y_label: "distance from the slot (m)",
        line_label: "drone farthest from its slot",
        band: exact(&samples.formation),
        level: Some(Curve {
            label: format!("closed, {} m", facts.arrival_error_m),
            colour: RED,
            level: facts.arrival_error_m,
        }),
    };
    let tracks = (!samples.speed.is_empty()).then(|| tracks::draw(samples, facts, &format!("Tracks: {run}")));
    let curve = |figure: Figure| (!figure.band.is_empty()).then(|| figure.draw(BLUE));
    let terms = timeline::terms(&recording.events, samples.end_s);
    let leaders = (!terms.is_empty()).then(|| timeline::draw(&terms, &recording.events, facts, samples.end_s));
    let messages =
        recording.any().then(|| lines::draw(&format!("Messages: {run}"), "messages a second", &recording.lines()));
    let [separation, speed, distance, energy, formation] = [separation, speed, distance, energy, formation].map(curve);
    let flight = flight::draw(samples, facts).map(Ok);
    let (disturbance, bending) = (curve(disturbance), curve(bending));
    [tracks, separation, speed, distance, energy, formation, leaders, messages, flight, disturbance, bending]
}

fn exact(points: &[(f64, f64)]) -> Vec<Band> {
    points.iter().map(|&(t_s, mean)| Band { t_s, mean, deviation: 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;
    use skein_protocol::Vec2;
    use skein_protocol::shape::ConvexShape;
    use std::fmt::Write;

    fn flown(drones: u32, ticks: u32) -> (tempfile::TempDir, RunFolder) {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut csv = "t_s,drone,x_m,y_m,vx_mps,vy_mps,group,leader,energy_j\n".to_owned();
        for tick in 1..=ticks {
            let t_s = f64::from(tick) * 0.02;
            for drone in 0..drones {
                writeln!(csv, "{t_s},{drone},{},{},10,0,N{},0,1", t_s * 10.0, drone * 40, drone + 1).unwrap();
            }
        }
        std::fs::write(folder.path().join("trace.csv"), csv).unwrap();
        // A recording in which nothing is said.
        let scenario = serde_json::json!({});
        crate::mcap::McapWriter::create(folder.path(), &facts(drones), &scenario).unwrap().finish().unwrap();
        (root, folder)
    }

    #[test]
    fn every_plot_says_what_it_shows() {
        let (_root, folder) = flown(3, 500);
        let block = ConvexShape::rectangle(Vec2::new(60.0, 20.0), Vec2::new(5.0, 15.0), 0.3).unwrap();
        let written = write(&folder, &RunFacts { obstacles: vec![block], ..facts(3) }).unwrap();
        let names: Vec<_> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        let silent = |name: &&str| !["leaders.svg", "messages.svg"].contains(name);
        assert_eq!(names, FILES.into_iter().filter(silent).collect::<Vec<_>>());
        let text = |i: usize| std::fs::read_to_string(&written[i]).unwrap();
        for group in ["N1", "N2", "N3", "start", "end", "obstacle", "x (m)"] {
            assert!(text(0).contains(group), "{group} is not in the legend");
        }
        assert!(text(1).contains("safe distance, 25 m") && text(3).contains("safe distance, 25 m"));
        assert!(text(2).contains("speed (m/s)") && !text(2).contains("safe distance"));
        assert!(text(1).contains("time (s)"));
        assert!(text(7).contains("target shape (m)") && text(8).contains("bending energy (1)"));
    }

    #[test]
    fn what_has_no_data_is_left_out() {
        let (_root, folder) = flown(0, 0);
        assert_eq!(write(&folder, &facts(3)).unwrap(), Vec::<PathBuf>::new());
        let (_root, folder) = flown(1, 10);
        let written = write(&folder, &facts(1)).unwrap();
        let names: Vec<_> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["trace.svg", "speed.svg", "energy.svg", "formation.svg", "flight.svg"]);
    }

    #[test]
    fn a_missing_trace_is_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let error = write(&folder, &facts(3)).unwrap_err().to_string();
        assert!(error.contains("trace.csv"), "{error}");
    }
}
