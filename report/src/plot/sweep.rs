//! What came of a sweep: lines with their intervals over one key, a heat map over two.

use super::style::{Axes, Heading, PALETTE, Sign, plot, px};
use crate::error::DrawError;
use plotters::prelude::*;
use std::fmt::Write as _;

/// Height of the plotting area of lines.
const HEIGHT: u32 = px(420);

/// A mean and its interval at a place of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Value of the key.
    pub x: f64,
    /// Mean, or rate.
    pub mean: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend.
    pub label: String,
    /// By x; at least one.
    pub points: Vec<Point>,
}

/// Lines over a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Above.
    pub title: String,
    /// The key.
    pub x_label: String,
    /// The metric and its unit.
    pub y_label: String,
    /// At least one.
    pub series: Vec<Series>,
}

impl Lines {
    /// The SVG: each line in its interval.
    ///
    /// # Errors
    /// [`DrawError`] if the SVG backend fails.
    pub fn draw(&self) -> Result<String, DrawError> {
        let signs = self.coloured().map(|(colour, series)| (Sign::Line(colour), series.label.clone()));
        let axes = Axes { x: (&self.x_label, self.x_range()), y: (&self.y_label, self.y_range()), height: HEIGHT };
        plot(&Heading::new(&self.title, signs.collect()), axes, |_, chart| {
            for (colour, Series { points, .. }) in self.coloured() {
                let upper = points.iter().map(|point| (point.x, point.high));
                let lower = points.iter().rev().map(|point| (point.x, point.low));
                let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
                chart.draw_series([Polygon::new(outline, colour.mix(0.15))]).map_err(DrawError::new)?;
            }
            for (colour, Series { points, .. }) in self.coloured() {
                let line = points.iter().map(|point| (point.x, point.mean));
                chart.draw_series(LineSeries::new(line.clone(), colour.stroke_width(px(2)))).map_err(DrawError::new)?;
                chart.draw_series(line.map(|at| Circle::new(at, px(4), colour.filled()))).map_err(DrawError::new)?;
                // Of a point that stands alone the shaded interval has no width.
                let whisker = |p: &Point| PathElement::new([(p.x, p.low), (p.x, p.high)], colour.stroke_width(px(1)));
                chart.draw_series(points.iter().map(whisker)).map_err(DrawError::new)?;
            }
            Ok(())
        })
    }

    fn coloured(&self) -> impl Iterator<Item = (RGBColor, &Series)> {
        self.series.iter().enumerate().map(|(i, series)| (PALETTE[i % PALETTE.len()], series))
    }

    fn points(&self) -> impl Iterator<Item = &Point> {
        self.series.iter().flat_map(|series| &series.points)
    }

    fn x_range(&self) -> std::ops::Range<f64> {
        let (low, high) = bounds(self.points().map(|point| point.x));
        let edge = if high > low { (high - low) * 0.02 } else { 1.0 };
        low - edge..high + edge
    }

    /// From zero if the values are of that size, else around them.
    fn y_range(&self) -> std::ops::Range<f64> {
        let (low, high) = bounds(self.points().flat_map(|point| [point.low, point.high]));
        let edge = if high > low { (high - low) * 0.06 } else { high.abs().max(1.0) * 0.06 };
        let bottom = if low >= 0.0 && low < 0.6 * high { 0.0 } else { low - edge };
        bottom..high + edge
    }
}

/// A value for each pair of values of two keys.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Above.
    pub title: String,
    /// The key whose values are columns, and the values.
    pub x: (String, Vec<String>),
    /// The key whose values are rows, from the bottom, and the values.
    pub y: (String, Vec<String>),
    /// Mean and interval, row by row from the bottom; `None` without data.
    pub cells: Vec<Option<(f64, f64, f64)>>,
}

/// Cividis at eleven places: even for everybody's eyes, dark is little.
const SCALE: [[f64; 3]; 11] = [
    [0.0, 34.0, 78.0],
    [8.0, 51.0, 112.0],
    [53.0, 69.0, 108.0],
    [79.0, 87.0, 108.0],
    [102.0, 105.0, 112.0],
    [125.0, 124.0, 120.0],
    [148.0, 142.0, 119.0],
    [174.0, 163.0, 113.0],
    [200.0, 184.0, 102.0],
    [229.0, 207.0, 82.0],
    [254.0, 232.0, 56.0],
];
/// Least room for the rows' values.
const LEFT: usize = 110;
/// Of a letter, about.
const LETTER: usize = 7;
const TOP: usize = 60;
const BELOW: usize = 70;
const ROW: usize = 54;

impl HeatMap {
    /// The SVG: in each cell its mean, and below it half of its interval.
    #[must_use]
    pub fn draw(&self) -> String {
        let (columns, rows) = (self.x.1.len().max(1), self.y.1.len().max(1));
        let longest = |values: &[String]| values.iter().map(|value| value.chars().count()).max().unwrap_or(0);
        let column = (960 / columns).clamp(56, 120).max(LETTER * longest(&self.x.1) + 8);
        let left = LEFT.max(LETTER * longest(&self.y.1) + 30);
        let (width, height) = (left + column * columns + 20, TOP + ROW * rows + BELOW);
        let shown = width.max(40 + 9 * self.title.chars().count());
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{shown}\" height=\"{height}\" viewBox=\"0 0 {shown} \
             {height}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"#333\">\n\
             <rect width=\"{shown}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <text x=\"20\" y=\"32\" font-size=\"18\">{}</text>\n",
            escaped(&self.title)
        );
        let (low, high) = bounds(self.cells.iter().flatten().map(|cell| cell.0));
        for (i, cell) in self.cells.iter().enumerate().take(columns * rows) {
            let at = (left + i % columns * column, TOP + (rows - 1 - i / columns) * ROW);
            draw_cell(&mut svg, at, column, *cell, (low, high));
        }
        self.draw_axes(&mut svg, left, column);
        svg.push_str("</svg>\n");
        svg
    }

    fn draw_axes(&self, svg: &mut String, left: usize, column: usize) {
        let bottom = TOP + ROW * self.y.1.len();
        let mut label = |x: usize, y: usize, anchor: &str, text: &str| {
            // Writing to a string cannot fail.
            let _ = writeln!(svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{}</text>", escaped(text));
        };
        for (i, value) in self.x.1.iter().enumerate() {
            label(left + i * column + column / 2, bottom + 20, "middle", value);
        }
        for (i, value) in self.y.1.iter().enumerate() {
            label(left - 10, bottom - i * ROW - ROW / 2 + 5, "end", value);
        }
        label(left + column * self.x.1.len() / 2, bottom + 48, "middle", &format!("{} →", self.x.0));
        label(20, TOP - 8, "start", &format!("{} ↑", self.y.0));
    }
}

fn draw_cell(
    svg: &mut String,
    (x, y): (usize, usize),
    width: usize,
    cell: Option<(f64, f64, f64)>,
    (low, high): (f64, f64),
) {
    let share = |value: f64| if high > low { (value - low) / (high - low) } else { 1.0 };
    let [r, g, b] = cell.map_or([235.0; 3], |(mean, ..)| colour(share(mean)));
    let ink = if 0.3 * r + 0.59 * g + 0.11 * b > 125.0 { "#000" } else { "#fff" };
    let _ = writeln!(
        svg,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"rgb({r:.0},{g:.0},{b:.0})\"/>",
        width - 1,
        ROW - 1
    );
    let mut text = |below: usize, size: usize, text: String| {
        let (x, y) = (x + width / 2, y + below);
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"{size}\" fill=\"{ink}\">{text}</text>"
        );
    };
    match cell {
        None => text(ROW / 2 + 5, 13, "–".to_owned()),
        Some((mean, from, to)) => {
            text(ROW / 2 - 2, 14, brief(mean));
            text(ROW / 2 + 15, 11, format!("{} to {}", brief(from), brief(to)));
        }
    }
}

/// From dark, 0, to light, 1.
fn colour(share: f64) -> [f64; 3] {
    let place = share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f64;
    let below = (place.floor() as usize).min(SCALE.len() - 2);
    let (from, to, part) = (SCALE[below], SCALE[below + 1], place - below as f64);
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * part)
}

/// Three digits, more before the point.
fn brief(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { 2.0 - value.abs().log10().floor() };
    let text = format!("{value:.*}", digits.clamp(0.0, 4.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Least and greatest.
pub(super) fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_show_every_series_in_a_colour_of_its_own() {
        let series = |label: &str, y: f64| Series {
            label: label.to_owned(),
            points: (0..3).map(|i| Point { x: f64::from(i), mean: y, low: y - 1.0, high: y + 1.0 }).collect(),
        };
        let lines = Lines {
            title: "delay".to_owned(),
            x_label: "radio.delay_s".to_owned(),
            y_label: "mission time (s)".to_owned(),
            series: vec![series("shortest-path", 50.0), series("congestion-aware", 40.0)],
        };
        let svg = lines.draw().unwrap();
        for text in ["radio.delay_s", "mission time (s)", "shortest-path", "congestion-aware", "#0072B2", "#E69F00"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<circle").count(), 6);
        assert_eq!(lines.y_range().start, 39.0 - 12.0 * 0.06);
    }

    #[test]
    fn a_heat_map_has_its_rows_from_the_bottom_and_marks_what_is_missing() {
        let map = HeatMap {
            title: "a < b".to_owned(),
            x: ("radio.loss".to_owned(), vec!["0".to_owned(), "0.5".to_owned()]),
            y: ("radio.delay_s".to_owned(), vec!["0".to_owned(), "1".to_owned()]),
            cells: vec![Some((10.0, 9.0, 11.0)), Some((20.0, 19.0, 21.0)), None, Some((30.0, 29.0, 31.0))],
        };
        let svg = map.draw();
        let y_of = |text: &str| {
            let end = svg.find(&format!(">{text}</text>")).unwrap();
            let start = svg[..end].rfind(" y=\"").unwrap() + 4;
            svg[start..].split('"').next().unwrap().parse::<usize>().unwrap()
        };
        assert!(y_of("10") > y_of("30"), "the first row is the lowest");
        assert_eq!(y_of("10"), y_of("20"));
        assert!(svg.contains("a &lt; b") && svg.contains(">–</text>") && svg.contains("9 to 11"));
        assert!(svg.contains("rgb(0,34,78)") && svg.contains("rgb(254,232,56)"), "least and greatest");
    }

    #[test]
    fn one_value_alone_is_drawn_too() {
        let point = Point { x: 0.0, mean: 1.0, low: 1.0, high: 1.0 };
        let series = vec![Series { label: "a".to_owned(), points: vec![point] }];
        let lines = Lines { title: String::new(), x_label: String::new(), y_label: String::new(), series };
        assert!(lines.draw().unwrap().contains("<circle"));
    }
}
