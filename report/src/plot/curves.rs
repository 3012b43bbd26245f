//! A quantity over time: its mean, its standard deviation as a shaded range, and a reference level.

use super::style::{Axes, Heading, Sign, plot, px};
use crate::error::DrawError;
use plotters::prelude::*;

/// Height of the plotting area.
const HEIGHT: u32 = px(300);

/// Mean and standard deviation of a quantity at one time.
#[derive(Clone, Debug)]
pub(super) struct Band {
    pub t_s: f64,
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

impl Band {
    /// The same in another unit.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        Self { mean: self.mean * factor, deviation: self.deviation * factor, ..*self }
    }
}

/// A constant reference level.
pub(super) struct Level {
    pub label: String,
    pub colour: RGBColor,
    pub value: f64,
}

/// A plot of a quantity over time.
pub(super) struct Figure {
    pub title: String,
    pub y_label: &'static str,
    pub line_label: &'static str,
    /// In order of time; at least one.
    pub band: Vec<Band>,
    pub level: Option<Level>,
}

impl Figure {
    /// Draws the plot. Returns the SVG.
    pub(crate) fn draw(&self, colour: RGBColor) -> Result<String, DrawError> {
        let ranged = self.band.iter().any(|band| band.deviation > 0.0);
        let heading = self.heading(colour, ranged);
        let (from, to) = (0.0, self.band.last().map_or(1.0, |band| band.t_s).max(1e-3));
        let axes = Axes { x: ("time (s)", from..to), y: (self.y_label, 0.0..self.top()), height: HEIGHT };
        plot(&heading, axes, |_, chart| {
            if ranged {
                chart.draw_series([Polygon::new(self.outline(), colour.mix(0.2))]).map_err(DrawError::new)?;
            }
            if let Some(level) = &self.level {
                let line = [(from, level.value), (to, level.value)];
                chart
                    .draw_series([PathElement::new(line, level.colour.stroke_width(px(2)))])
                    .map_err(DrawError::new)?;
            }
            let line = self.band.iter().map(|band| (band.t_s, band.mean));
            chart.draw_series(LineSeries::new(line, colour.stroke_width(px(2)))).map_err(DrawError::new)?;
            Ok(())
        })
    }

    fn heading(&self, colour: RGBColor, ranged: bool) -> Heading {
        let mut signs = vec![(Sign::Line(colour), self.line_label.to_owned())];
        signs.extend(ranged.then(|| (Sign::Range(colour), "± standard deviation".to_owned())));
        signs.extend(self.level.as_ref().map(|level| (Sign::Line(level.colour), level.label.clone())));
        Heading::narrow(&self.title, signs)
    }

    /// The shaded range as a polygon: along its upper edge, back along its lower edge.
    fn outline(&self) -> Vec<(f64, f64)> {
        let upper = self.band.iter().map(|band| (band.t_s, band.mean + band.deviation));
        let lower = self.band.iter().rev().map(|band| (band.t_s, (band.mean - band.deviation).max(0.0)));
        upper.chain(lower).collect()
    }

    /// Upper end of the ordinate.
    fn top(&self) -> f64 {
        let highest = self.band.iter().map(|band| band.mean + band.deviation).fold(0.0, f64::max);
        (self.level.as_ref().map_or(0.0, |level| level.value).max(highest) * 1.08).max(1e-3)
    }
}
