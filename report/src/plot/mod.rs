//! The plots of a run, drawn from its recorded files, so that they can be drawn again at any time. They are SVGs on a light
//! background, in colours that colour-blind people can distinguish.

mod colour_scale;
mod curves;
mod flight;
mod lines;
mod own;
mod recording;
pub mod reproduce;
mod samples;
mod series;
mod shown_frames;
mod shown_sign;
mod style;
pub mod surface;
pub mod sweep;
mod timeline;
mod tracks;

use crate::deviation::{DeviationWriter, ShapeDeviation};
use crate::error::{DrawError, ReportError};
use crate::facts::RunFacts;
pub use crate::files::PLOT_FILES as FILES;
use crate::files::{FORMATION, PLOTS};
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use curves::{Band, Figure, Level};
use recording::Recording;
use samples::Samples;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use style::{BLUE, RED};

/// A plot of a run.
pub(crate) struct Plot {
    /// Name of its file, one of [`FILES`].
    pub file: &'static str,
    /// The drawing.
    pub svg: String,
}

/// Draws the plots of a run from its trace.csv and run.mcap into its folder `plots`, and writes formation.csv, the
/// deviation from the target shape over time. Returns the paths of the plots. Plots without data are left out: all plots
/// if the trace is empty, those of distances for a single drone, those of the shape for a very large swarm.
///
/// # Errors
/// [`ReportError::Io`], [`ReportError::Content`] for an invalid trace, [`ReportError::Recording`], [`ReportError::Plot`],
/// [`ReportError::Interrupted`].
pub fn write(folder: &RunFolder, facts: &RunFacts, interrupted: &Interrupted<'_>) -> Result<Vec<PathBuf>, ReportError> {
    let plots = draw_and_write(folder, facts, interrupted)?;
    Ok(plots.iter().map(|plot| folder.path().join(PLOTS).join(plot.file)).collect())
}

/// As [`write`]; returns the plots.
pub(crate) fn draw_and_write(
    folder: &RunFolder,
    facts: &RunFacts,
    interrupted: &Interrupted<'_>,
) -> Result<Vec<Plot>, ReportError> {
    let deviations = BufWriter::new(folder.files().begin(FORMATION)?);
    let plots = draw(folder, facts, interrupted, deviations).inspect_err(|_| folder.files().give_up(FORMATION))?;
    folder.files().keep(FORMATION)?;
    let subfolder = folder.files().subfolder(PLOTS)?;
    plots.iter().try_for_each(|plot| subfolder.write(plot.file, plot.svg.as_bytes()))?;
    Ok(plots)
}

/// Draws the plots, and writes the deviation from the target shape to `deviations`.
pub(crate) fn draw(
    folder: &RunFolder,
    facts: &RunFacts,
    interrupted: &Interrupted<'_>,
    deviations: impl Write,
) -> Result<Vec<Plot>, ReportError> {
    let path = folder.path().join(FORMATION);
    let io = |result: std::io::Result<()>| result.map_err(ReportError::io(&path));
    let mut deviations = DeviationWriter::new(deviations).map_err(ReportError::io(&path))?;
    let samples = Samples::read(folder, facts, interrupted, |deviation| io(deviations.take(deviation)))?;
    io(deviations.flush())?;
    let recording = Recording::read(folder, interrupted)?;
    let mut plots = Vec::new();
    for (file, draw) in FILES.into_iter().zip(DRAWINGS) {
        interrupted.check()?;
        if let Some(svg) = draw(&samples, &recording, facts) {
            let path = || folder.path().join(PLOTS).join(file);
            plots.push(Plot { file, svg: svg.map_err(|source| ReportError::Plot { path: path(), source })? });
        }
    }
    Ok(plots)
}

/// The SVG of a plot, or the error; `None` without data.
type Drawn = Option<Result<String, DrawError>>;

/// The drawings in the order of [`FILES`].
const DRAWINGS: [fn(&Samples, &Recording, &RunFacts) -> Drawn; FILES.len()] = [
    draw_tracks,
    |samples, _, facts| curve(separation(samples, facts)),
    |samples, _, facts| curve(speed(samples, facts)),
    |samples, _, facts| curve(distance(samples, facts)),
    |samples, _, facts| curve(energy(samples, facts)),
    |samples, _, facts| curve(slot_error(samples, facts)),
    draw_leaders,
    draw_messages,
    |samples, recording, facts| flight::draw(samples, recording, facts).map(Ok),
    |samples, _, facts| curve(disturbance(samples, facts)),
    |samples, _, facts| curve(bending(samples, facts)),
    |samples, _, facts| own::draw(samples, &run(facts)),
];

fn curve(figure: Figure) -> Drawn {
    (!figure.band.is_empty()).then(|| figure.draw(BLUE))
}

/// The run as the titles name it.
fn run(facts: &RunFacts) -> String {
    format!("{}, {} drones, {}", facts.scenario, facts.drones, facts.strategy)
}

fn draw_tracks(samples: &Samples, recording: &Recording, facts: &RunFacts) -> Drawn {
    let any = !samples.speed.samples().is_empty();
    any.then(|| tracks::draw(samples, recording.groups(), facts, &format!("Tracks: {}", run(facts))))
}

fn draw_leaders(samples: &Samples, recording: &Recording, facts: &RunFacts) -> Drawn {
    let terms = timeline::terms(recording.events(), samples.end_s);
    (!terms.is_empty()).then(|| timeline::draw(&terms, recording.events(), recording.groups(), facts, samples.end_s))
}

fn draw_messages(_: &Samples, recording: &Recording, facts: &RunFacts) -> Drawn {
    let title = format!("Messages: {}", run(facts));
    recording.has_messages().then(|| lines::draw(&title, "messages per second", &recording.lines()))
}

fn separation(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Least separation: {}", run(facts)),
        y_label: "distance between the two nearest drones (m)",
        line_label: if samples.is_thinned {
            "least separation, in the recorded ticks alone"
        } else {
            "least separation"
        },
        band: without_deviation(samples.separation.samples().iter().copied()),
        level: Some(safe_distance(facts)),
    }
}

fn speed(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Speed: {}", run(facts)),
        y_label: "speed (m/s)",
        line_label: "mean over drones",
        band: samples.speed.samples().to_vec(),
        level: None,
    }
}

fn distance(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Distance between drones: {}", run(facts)),
        y_label: "distance between drones (m)",
        line_label: "mean over pairs",
        band: samples.distance.samples().to_vec(),
        level: Some(safe_distance(facts)),
    }
}

fn energy(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Energy: {}", run(facts)),
        y_label: "energy used by a drone (kJ)",
        line_label: "mean over drones",
        band: samples.energy.samples().iter().map(|band| band.scaled(1e-3)).collect(),
        level: None,
    }
}

fn slot_error(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Largest slot error after the best translation: {}", run(facts)),
        y_label: "distance from the slot (m)",
        line_label: "drone farthest from its slot",
        band: without_deviation(samples.formation.samples().iter().copied()),
        level: Some(Level {
            label: format!("limit of a closed formation, {} m", facts.arrival_error_m),
            colour: RED,
            value: facts.arrival_error_m,
        }),
    }
}

fn disturbance(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Disturbance of the formation: {}", run(facts)),
        y_label: "distance from the target shape (m)",
        line_label: "root mean square over drones, after the best translation and assignment",
        band: of_deviations(samples, |deviation| deviation.disturbance_m),
        level: None,
    }
}

fn bending(samples: &Samples, facts: &RunFacts) -> Figure {
    Figure {
        title: format!("Bending energy: {}", run(facts)),
        y_label: "bending energy (1)",
        line_label: "of the thin-plate spline from the target shape to the drones",
        band: of_deviations(samples, |deviation| deviation.bending),
        level: None,
    }
}

fn safe_distance(facts: &RunFacts) -> Level {
    Level { label: format!("safe distance, {} m", facts.safe_distance_m), colour: RED, value: facts.safe_distance_m }
}

fn of_deviations(samples: &Samples, quantity: fn(&ShapeDeviation) -> f64) -> Vec<Band> {
    without_deviation(samples.deviations.samples().iter().map(|deviation| (deviation.t_s, quantity(deviation))))
}

/// A quantity over time that has no standard deviation.
fn without_deviation(points: impl Iterator<Item = (f64, f64)>) -> Vec<Band> {
    points.map(|(t_s, mean)| Band { t_s, mean, deviation: 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;
    use skein_protocol::Vec2;
    use skein_protocol::shape::ConvexShape;
    use std::fmt::Write as _;

    fn recorded(drones: u32, ticks: u32) -> (tempfile::TempDir, RunFolder) {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut csv = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j\n".to_owned();
        for tick in 1..=ticks {
            let t_s = f64::from(tick) * 0.02;
            for drone in 0..drones {
                writeln!(csv, "{t_s},{drone},{},{},10,0,50,0,N{},0,1", t_s * 10.0, drone * 40, drone + 1).unwrap();
            }
        }
        std::fs::write(folder.path().join("trace.csv"), csv).unwrap();
        // A recording without messages.
        let scenario = serde_json::json!({});
        let file = folder.files().create("run.mcap").unwrap();
        let path = folder.path().join("run.mcap");
        crate::mcap::McapWriter::new(file, path, &facts(drones), &scenario).unwrap().finish().unwrap();
        (root, folder)
    }

    #[test]
    fn every_plot_has_labels() {
        let (_root, folder) = recorded(3, 500);
        let block = ConvexShape::rectangle(Vec2::new(60.0, 20.0), Vec2::new(5.0, 15.0), 0.3).unwrap();
        let written = write(&folder, &RunFacts { obstacles: vec![block], ..facts(3) }, &Interrupted::never()).unwrap();
        let names: Vec<_> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        let drawn = |name: &&str| !["leaders.svg", "messages.svg", "metrics.svg"].contains(name);
        assert_eq!(names, FILES.into_iter().filter(drawn).collect::<Vec<_>>());
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
    fn plots_without_data_are_left_out() {
        let (_root, folder) = recorded(0, 0);
        assert_eq!(write(&folder, &facts(3), &Interrupted::never()).unwrap(), Vec::<PathBuf>::new());
        let (_root, folder) = recorded(1, 10);
        let written = write(&folder, &facts(1), &Interrupted::never()).unwrap();
        let names: Vec<_> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["trace.svg", "speed.svg", "energy.svg", "formation.svg", "flight.svg"]);
    }

    #[test]
    fn a_missing_trace_is_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let error = write(&folder, &facts(3), &Interrupted::never()).unwrap_err().to_string();
        assert!(error.contains("trace.csv"), "{error}");
    }
}
