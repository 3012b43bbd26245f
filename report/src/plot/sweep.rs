//! Plots of a sweep: lines with confidence intervals over one key, and a heat map over two keys.

use super::colour_scale::{bounds, ink_on, interpolated};
use super::style::{Axes, Heading, PALETTE, Sign, plot, px};
use crate::error::DrawError;
use crate::markup::escaped;
use plotters::prelude::*;
use std::fmt::Write as _;

/// Height of the plotting area of [`Lines`].
const HEIGHT: u32 = px(420);

/// A mean and its interval at a value of the key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Value of the key.
    pub x: f64,
    /// Mean or rate.
    pub mean: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// A line of [`Lines`].
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Label in the legend.
    pub label: String,
    /// The points in order of x; at least one.
    pub points: Vec<Point>,
}

/// Lines over the values of a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Title.
    pub title: String,
    /// Label of the abscissa: the key.
    pub x_label: String,
    /// Label of the ordinate: the metric and its unit.
    pub y_label: String,
    /// The lines; at least one.
    pub series: Vec<Series>,
}

impl Lines {
    /// Draws each line with its interval as a shaded range. Returns the SVG.
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
                // The shaded range of a single point has no width.
                let whisker = |p: &Point| PathElement::new([(p.x, p.low), (p.x, p.high)], colour.stroke_width(px(1)));
                chart.draw_series(points.iter().map(whisker)).map_err(DrawError::new)?;
            }
            Ok(())
        })
    }

    /// The series with their colours.
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

    /// Range of the ordinate. It starts at zero unless all values are far from zero compared to their range.
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
    /// Title.
    pub title: String,
    /// The key of the columns, and its values.
    pub x: (String, Vec<String>),
    /// The key of the rows, and its values from the bottom.
    pub y: (String, Vec<String>),
    /// The cells, row by row from the bottom; `None` without data.
    pub cells: Vec<Option<Cell>>,
}

/// A mean and its interval in a cell of a [`HeatMap`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Mean or rate.
    pub mean: f64,
    /// Both ends of the interval; `None` without one.
    pub interval: Option<[f64; 2]>,
}

/// The colour map Cividis at eleven places, from low values (dark) to high values (light). It is perceived as uniform, by
/// colour-blind people too.
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
/// Least space for the values of the rows, px.
const LEFT: usize = 110;
/// Approximate width of a letter, px.
const LETTER: usize = 7;
/// Space above the cells, px.
const TOP: usize = 60;
/// Space below the cells, px.
const BELOW: usize = 70;
/// Space for the colour bar right of the cells, px.
const BAR: usize = 110;
/// Height of a row, px.
const ROW: usize = 54;

impl HeatMap {
    /// Draws the mean and the interval of each cell. Returns the SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let (columns, rows) = (self.x.1.len().max(1), self.y.1.len().max(1));
        let longest = |values: &[String]| values.iter().map(|value| value.chars().count()).max().unwrap_or(0);
        let column = (960 / columns).clamp(56, 120).max(LETTER * longest(&self.x.1) + 8);
        let left = LEFT.max(LETTER * longest(&self.y.1) + 30);
        let (width, height) = (left + column * columns + BAR, TOP + ROW * rows + BELOW);
        let shown = width.max(40 + 9 * self.title.chars().count());
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{shown}\" height=\"{height}\" viewBox=\"0 0 {shown} \
             {height}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"#333\">\n\
             <rect width=\"{shown}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <text x=\"20\" y=\"32\" font-size=\"18\">{}</text>\n",
            escaped(&self.title)
        );
        let (low, high) = bounds(self.cells.iter().flatten().map(|cell| cell.mean));
        for (i, cell) in self.cells.iter().enumerate().take(columns * rows) {
            let at = (left + i % columns * column, TOP + (rows - 1 - i / columns) * ROW);
            draw_cell(&mut svg, at, column, *cell, (low, high));
        }
        self.draw_axes(&mut svg, left, column);
        if high > low {
            draw_bar(&mut svg, left + column * columns + 16, ROW * rows, (low, high));
        }
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

/// Draws the colour bar: the colours from `low` at the bottom to `high` at the top.
fn draw_bar(svg: &mut String, x: usize, height: usize, (low, high): (f64, f64)) {
    const STEPS: usize = 50;
    for step in 0..STEPS {
        let [r, g, b] = interpolated(&SCALE, step as f64 / (STEPS - 1) as f64);
        let (from, to) = (height * (STEPS - 1 - step) / STEPS, height * (STEPS - step) / STEPS);
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{}\" width=\"16\" height=\"{}\" fill=\"rgb({r:.0},{g:.0},{b:.0})\"/>",
            TOP + from,
            to - from
        );
    }
    for (share, value) in [(0.0, high), (0.5, f64::midpoint(low, high)), (1.0, low)] {
        let y = TOP as f64 + 5.0 + (height as f64 - 6.0) * share;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y:.0}\" font-size=\"12\">{}</text>", x + 22, brief(value));
    }
}

/// Draws a cell at (x, y). The colours range from `low` to `high`.
fn draw_cell(svg: &mut String, (x, y): (usize, usize), width: usize, cell: Option<Cell>, (low, high): (f64, f64)) {
    let share = |value: f64| if high > low { (value - low) / (high - low) } else { 1.0 };
    let fill = cell.map_or([235.0; 3], |cell| interpolated(&SCALE, share(cell.mean)));
    let ([r, g, b], ink) = (fill, ink_on(fill));
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
        Some(Cell { mean, interval: None }) => text(ROW / 2 + 5, 14, brief(mean)),
        Some(Cell { mean, interval: Some([low, high]) }) => {
            text(ROW / 2 - 2, 14, brief(mean));
            text(ROW / 2 + 15, 11, format!("{} to {}", brief(low), brief(high)));
        }
    }
}

/// The value as text with three significant digits, or more before the decimal point.
fn brief(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { 2.0 - value.abs().log10().floor() };
    let text = format!("{value:.*}", digits.clamp(0.0, 4.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_series_has_its_own_colour() {
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
    fn rows_of_a_heat_map_start_at_the_bottom_and_missing_cells_are_marked() {
        let cell = |mean: f64| Cell { mean, interval: Some([mean - 1.0, mean + 1.0]) };
        let map = HeatMap {
            title: "a < b".to_owned(),
            x: ("radio.loss".to_owned(), vec!["0".to_owned(), "0.5".to_owned()]),
            y: ("radio.delay_s".to_owned(), vec!["0".to_owned(), "1".to_owned()]),
            cells: vec![Some(cell(10.0)), Some(cell(20.0)), None, Some(cell(30.0))],
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
    fn a_single_value_is_drawn() {
        let point = Point { x: 0.0, mean: 1.0, low: 1.0, high: 1.0 };
        let series = vec![Series { label: "a".to_owned(), points: vec![point] }];
        let lines = Lines { title: String::new(), x_label: String::new(), y_label: String::new(), series };
        assert!(lines.draw().unwrap().contains("<circle"));
    }
}
