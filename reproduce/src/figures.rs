//! The paper's figures, drawn from our flights.

use crate::cases::{DRONES, GEOMETRIES, PLACEMENTS, STRATEGIES, fixed, title};
use crate::flight::Flight;
use crate::forest::Forest;
use crate::results::Results;
use crate::row::{CONVENTIONS, Convention, pass_s};
use skein_report::DrawError;
use skein_report::plot::reproduce::{BarGroup, Bars};
use skein_report::plot::sweep::{Lines, Point, Series};

/// A drawn figure.
pub(crate) struct Figure {
    /// Name of its file in the folder `figures`.
    pub(crate) file: String,
    /// Text below the figure.
    pub(crate) caption: String,
    /// The drawing.
    pub(crate) svg: String,
}

/// All figures that have data.
pub(crate) fn figures(results: &Results, forest: &Forest) -> Result<Vec<Figure>, DrawError> {
    let mut figures = Vec::new();
    // S2 first: it is the geometry closest to the published numbers.
    for geometry in ["s2", "s1", "s3b"] {
        figures.extend(time_against_split(results, geometry)?);
    }
    figures.push(Figure {
        file: "f2-snapshots.svg".to_owned(),
        caption: "F2. The forest mission at the paper's moments and at its end.".to_owned(),
        svg: forest.snapshots.draw(&forest.facts, "Snapshots of the forest mission"),
    });
    let plots = [
        ("trace.svg", "f3-trace.svg", "F3. Trace of the whole forest mission: ◇ start, ● end."),
        ("speed.svg", "f4-speed.svg", "F4. Average speed of the drones, ± standard deviation, forest."),
        (
            "distance.svg",
            "f5-distance.svg",
            "F5. Average distance between drones, ± standard deviation over pairs, forest; the safe distance is the \
             red line.",
        ),
        (
            "separation.svg",
            "f5-separation.svg",
            "F5, beside it: the least distance of two drones, which is what the safe distance bounds.",
        ),
        (
            "disturbance.svg",
            "e6-disturbance.svg",
            "E6. Disturbance of the formation over time, forest: distance of the drones from the target shape.",
        ),
        (
            "bending.svg",
            "e6-bending.svg",
            "E6. Bending energy over time, forest: ∬(f_xx² + 2 f_xy² + f_yy²) dx dy of the thin-plate spline f that \
             takes each slot of the target shape to its drone (λ = 0).",
        ),
    ];
    for (plot, file, caption) in plots {
        let svg = forest.plots.iter().find(|drawn| drawn.file == plot).map(|drawn| drawn.svg.clone());
        figures.extend(svg.map(|svg| Figure { file: file.to_owned(), caption: caption.to_owned(), svg }));
    }
    figures.push(energies(results));
    Ok(figures)
}

fn time_against_split(results: &Results, geometry: &str) -> Result<Option<Figure>, DrawError> {
    let line = |placement: &str| {
        let point = |left: u32| {
            let flight = Flight::new(&format!("{geometry}-{placement}"), &fixed(left));
            let mean = pass_s(results.reached(&flight)?)?;
            Some(Point { x: left.into(), mean, low: mean, high: mean })
        };
        Series { label: format!("obstacle {placement}"), points: (0..=DRONES).filter_map(point).collect() }
    };
    let series: Vec<Series> = PLACEMENTS.map(line).into_iter().filter(|line| !line.points.is_empty()).collect();
    if series.is_empty() {
        return Ok(None);
    }
    let name = title(geometry);
    let lines = Lines {
        title: format!("Time to pass against the split, {name}"),
        x_label: format!("drones past the left side, of {DRONES}"),
        y_label: "time from detection until the last drone is past (s)".to_owned(),
        series,
    };
    Ok(Some(Figure {
        file: format!("f1-{geometry}.svg"),
        caption: format!("F1. Time against split for the three placements, {name}; left is seen along the flight."),
        svg: lines.draw()?,
    }))
}

fn energies(results: &Results) -> Figure {
    let group = |geometry: &str, Convention { words, energy_j, .. }: Convention| {
        let of = |strategy| {
            let flight = Flight::new(&format!("{geometry}-right"), strategy);
            results.reached(&flight).and_then(energy_j).map(|joules| joules / 1e3)
        };
        let [Some(paper), Some(default), Some(shortest)] = STRATEGIES.map(of) else { return None };
        let note = format!("ratio {:.3}", shortest / paper);
        Some(BarGroup { name: [title(geometry), words.to_owned()], note, values: vec![paper, default, shortest] })
    };
    let pairs = GEOMETRIES.iter().flat_map(|geometry| CONVENTIONS.map(|convention| (geometry, convention)));
    let bars = Bars {
        title: "Energy of each strategy under each convention, obstacle right".to_owned(),
        y_label: "energy of all drones (kJ)".to_owned(),
        kinds: STRATEGIES.map(str::to_owned).to_vec(),
        groups: pairs.filter_map(|(geometry, convention)| group(geometry, convention)).collect(),
    };
    Figure {
        file: "f6-energy.svg".to_owned(),
        caption: "F6. Energy by when the counting starts and ends; above each group shortest path / the paper's rule."
            .to_owned(),
        svg: bars.draw(),
    }
}
