//! Several quantities of one unit over time.

use super::style::{Axes, Heading, PALETTE, Sign, plot, px};
use crate::error::DrawError;
use plotters::prelude::*;

/// Height of the plotting area.
const HEIGHT: u32 = px(300);

/// A line with its label. The points are times, s, and values.
pub(super) struct Line {
    pub label: String,
    pub points: Vec<(f64, f64)>,
}

/// Draws the lines over time. Returns the SVG.
pub(super) fn draw(title: &str, y_label: &str, lines: &[Line]) -> Result<String, DrawError> {
    let colours = || PALETTE.iter().cycle();
    let signs = lines.iter().zip(colours()).map(|(line, &colour)| (Sign::Line(colour), line.label.clone()));
    let heading = Heading::narrow(title, signs.collect());
    let all = || lines.iter().flat_map(|line| line.points.iter());
    let end = all().map(|point| point.0).fold(1e-3, f64::max);
    let top = all().map(|point| point.1).fold(1e-3, f64::max) * 1.08;
    let axes = Axes { x: ("time (s)", 0.0..end), y: (y_label, 0.0..top), height: HEIGHT };
    plot(&heading, axes, |_, chart| {
        for (line, colour) in lines.iter().zip(colours()) {
            let points = line.points.iter().copied();
            chart.draw_series(LineSeries::new(points, colour.stroke_width(px(2)))).map_err(DrawError::new)?;
        }
        Ok(())
    })
}
