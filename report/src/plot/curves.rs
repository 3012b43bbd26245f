//! One quantity over time: its mean, a shaded standard deviation, and a level it is measured against.

use super::style::{Axes, Heading, Sign, plot, px};
use crate::error::DrawError;
use plotters::prelude::*;

/// Height of the plotting area.
const HEIGHT: u32 = px(400);

/// A quantity at a moment.
#[derive(Clone, Debug)]
pub(super) struct Band {
    pub t_s: f64,
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// A level that does not change.
pub(super) struct Curve {
    pub label: String,
    pub colour: RGBColor,
    pub level: f64,
}

/// What is drawn; `band` is not empty.
pub(super) struct Figure {
    pub title: String,
    pub y_label: &'static str,
    pub line_label: &'static str,
    pub band: Vec<Band>,
    pub level: Option<Curve>,
}

impl Figure {
    /// The SVG.
    pub fn draw(&self, colour: RGBColor) -> Result<String, DrawError> {
        let spread = self.band.iter().any(|band| band.deviation > 0.0);
        let heading = self.heading(colour, spread);
        let (from, to) = (0.0, self.band.last().map_or(1.0, |band| band.t_s).max(1e-3));
        let axes = Axes { x: ("time (s)", from..to), y: (self.y_label, 0.0..self.top()), height: HEIGHT };
        plot(&heading, axes, |_, chart| {
            if spread {
                chart.draw_series([Polygon::new(self.outline(), colour.mix(0.2))]).map_err(DrawError::new)?;
            }
            if let Some(level) = &self.level {
                let line = [(from, level.level), (to, level.level)];
                chart
                    .draw_series([PathElement::new(line, level.colour.stroke_width(px(2)))])
                    .map_err(DrawError::new)?;
            }
            let line = self.band.iter().map(|band| (band.t_s, band.mean));
            chart.draw_series(LineSeries::new(line, colour.stroke_width(px(2)))).map_err(DrawError::new)?;
            Ok(())
        })
    }

    fn heading(&self, colour: RGBColor, spread: bool) -> Heading {
        let mut signs = vec![(Sign::Line(colour), self.line_label.to_owned())];
        signs.extend(spread.then(|| (Sign::Range(colour), "± standard deviation".to_owned())));
        signs.extend(self.level.as_ref().map(|level| (Sign::Line(level.colour), level.label.clone())));
        Heading::new(&self.title, signs)
    }

    /// Along the upper edge of the range, back along the lower.
    fn outline(&self) -> Vec<(f64, f64)> {
        let upper = self.band.iter().map(|band| (band.t_s, band.mean + band.deviation));
        let lower = self.band.iter().rev().map(|band| (band.t_s, (band.mean - band.deviation).max(0.0)));
        upper.chain(lower).collect()
    }

    fn top(&self) -> f64 {
        let highest = self.band.iter().map(|band| band.mean + band.deviation).fold(0.0, f64::max);
        (self.level.as_ref().map_or(0.0, |level| level.level).max(highest) * 1.08).max(1e-3)
    }
}
