//! A signed quantity over two keys: a heat map with two colours that meet at zero, and a line where the sign changes.

use super::colour_scale::{bounds, ink_on, interpolated};
use crate::markup::escaped;
use std::fmt::Write as _;

/// A value for each pair of values of two keys. Zero means neither gain nor loss.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Title, with the unit of the values.
    pub title: String,
    /// The key of the columns, and its values.
    pub x: (String, Vec<String>),
    /// The key of the rows, and its values from the bottom.
    pub y: (String, Vec<String>),
    /// The values, row by row from the bottom; `None` without data.
    pub cells: Vec<Option<f64>>,
}

/// The colours from loss (blue) over zero (white) to gain (orange), which colour-blind people can distinguish.
const SCALE: [[f64; 3]; 7] = [
    [5.0, 70.0, 130.0],
    [70.0, 140.0, 195.0],
    [180.0, 210.0, 232.0],
    [250.0, 250.0, 250.0],
    [250.0, 215.0, 165.0],
    [235.0, 155.0, 50.0],
    [170.0, 85.0, 0.0],
];
/// Least absolute value at the ends of the scale, which are equally far from zero.
const EXTENT_MIN: f64 = 1.0;
/// Space left of the cells, px.
const LEFT: usize = 80;
/// Space above the cells, px.
const TOP: usize = 70;
/// Space below the cells, px.
const BELOW: usize = 60;
/// Space right of the cells, px.
const RIGHT: usize = 110;
/// Height of a row, px.
const ROW: usize = 44;

impl Surface {
    /// Draws the heat map. Returns the SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let (columns, rows) = (self.columns(), self.y.1.len().max(1));
        let column = self.column();
        let (width, height) = ((LEFT + column * columns + RIGHT).max(760), TOP + ROW * rows + BELOW);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
             {height}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"#333\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <text x=\"20\" y=\"30\" font-size=\"18\">{}</text>\n",
            escaped(&self.title)
        );
        let extent = self.extent();
        for (i, value) in self.cells.iter().enumerate().take(columns * rows) {
            self.draw_cell(&mut svg, i, *value, extent);
        }
        self.draw_zero(&mut svg);
        self.draw_axes(&mut svg);
        self.draw_scale(&mut svg, extent);
        svg.push_str("</svg>\n");
        svg
    }

    fn columns(&self) -> usize {
        self.x.1.len().max(1)
    }

    /// Width of a column, px.
    fn column(&self) -> usize {
        (900 / self.columns()).clamp(44, 120)
    }

    /// Upper left corner of a cell, px.
    fn corner(&self, cell: usize) -> (usize, usize) {
        let rows = self.cells.len() / self.columns();
        (LEFT + cell % self.columns() * self.column(), TOP + (rows - 1 - cell / self.columns()) * ROW)
    }

    /// Absolute value at the ends of the scale.
    fn extent(&self) -> f64 {
        let (low, high) = bounds(self.cells.iter().flatten().copied());
        low.abs().max(high.abs()).clamp(EXTENT_MIN, f64::MAX)
    }

    fn draw_cell(&self, svg: &mut String, cell: usize, value: Option<f64>, extent: f64) {
        let ((x, y), width) = (self.corner(cell), self.column());
        let fill = value.map_or([225.0; 3], |value| colour(value / extent));
        let ([r, g, b], ink) = (fill, ink_on(fill));
        let text = value.map_or_else(|| "–".to_owned(), signed);
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{ROW}\" fill=\"rgb({r:.0},{g:.0},{b:.0})\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"{ink}\">{text}</text>",
            x + width / 2,
            y + ROW / 2 + 5
        );
    }

    /// Draws a line along every edge between a cell with a loss and a cell without one.
    fn draw_zero(&self, svg: &mut String) {
        let (columns, column) = (self.columns(), self.column());
        let loses = |cell: usize| self.cells.get(cell).copied().flatten().map(|value| tidy(value) < 0.0);
        let differ = |a: usize, b: usize| loses(a).zip(loses(b)).is_some_and(|(a, b)| a != b);
        let mut path = String::new();
        for cell in 0..self.cells.len() {
            let (x, y) = self.corner(cell);
            if cell % columns + 1 < columns && differ(cell, cell + 1) {
                let _ = write!(path, "M{} {y}v{ROW}", x + column);
            }
            if differ(cell, cell + columns) {
                let _ = write!(path, "M{x} {y}h{column}");
            }
        }
        if !path.is_empty() {
            let style = "fill=\"none\" stroke=\"#000\" stroke-width=\"3\" stroke-linecap=\"square\"";
            let _ = writeln!(svg, "<path class=\"zero\" d=\"{path}\" {style}/>");
        }
    }

    fn draw_axes(&self, svg: &mut String) {
        let (column, bottom) = (self.column(), TOP + ROW * self.y.1.len());
        let mut label = |x: usize, y: usize, anchor: &str, text: &str| {
            let _ = writeln!(svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{}</text>", escaped(text));
        };
        for (i, value) in self.x.1.iter().enumerate() {
            label(LEFT + i * column + column / 2, bottom + 18, "middle", value);
        }
        for (i, value) in self.y.1.iter().enumerate() {
            label(LEFT - 10, bottom - i * ROW - ROW / 2 + 5, "end", value);
        }
        label(LEFT + column * self.x.1.len() / 2, bottom + 42, "middle", &format!("{} →", self.x.0));
        label(20, TOP - 12, "start", &format!("{} ↑", self.y.0));
    }

    /// Draws the colours and their values right of the cells.
    fn draw_scale(&self, svg: &mut String, extent: f64) {
        let x = LEFT + self.column() * self.columns() + 24;
        let step = (ROW * self.y.1.len()) as f64 / SCALE.len() as f64;
        for (i, [r, g, b]) in SCALE.iter().rev().enumerate() {
            let y = TOP as f64 + i as f64 * step;
            let share = 1.0 - i as f64 / (SCALE.len() - 1) as f64 * 2.0;
            let _ = writeln!(
                svg,
                "<rect x=\"{x}\" y=\"{y:.1}\" width=\"18\" height=\"{step:.1}\" fill=\"rgb({r:.0},{g:.0},{b:.0})\"/>\
                 <text x=\"{}\" y=\"{:.1}\">{}</text>",
                x + 26,
                y + step / 2.0 + 5.0,
                signed(share * extent)
            );
        }
    }
}

/// The value, or zero if it rounds to zero with one decimal.
fn tidy(value: f64) -> f64 {
    if value.abs() < 0.05 { 0.0 } else { value }
}

/// The value as text with its sign; zero has none.
fn signed(value: f64) -> String {
    if tidy(value) == 0.0 { "0".to_owned() } else { format!("{value:+.1}") }
}

/// The colour of a value from −1 to 1.
fn colour(share: f64) -> [f64; 3] {
    interpolated(&SCALE, (share.clamp(-1.0, 1.0) + 1.0) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(cells: Vec<Option<f64>>) -> Surface {
        let labels = |prefix: &str| (0..2).map(|i| format!("{prefix}{i}")).collect();
        Surface { title: "a < b".to_owned(), x: ("x".to_owned(), labels("c")), y: ("y".to_owned(), labels("r")), cells }
    }

    #[test]
    fn zero_is_white_and_in_the_middle_of_the_scale() {
        let svg = surface(vec![Some(-8.0), Some(0.0), Some(4.0), None]).draw();
        assert!(svg.contains("rgb(5,70,130)") && svg.contains("rgb(250,250,250)"), "{svg}");
        assert!(svg.contains(">-8.0<") && svg.contains(">+4.0<") && svg.contains(">–<") && svg.contains("a &lt; b"));
        // The cell of 4 has half of the greatest gain, 8.
        let [r, g, b] = colour(0.5);
        assert!(svg.contains(&format!("rgb({r:.0},{g:.0},{b:.0})")));
    }

    #[test]
    fn the_zero_line_separates_losses_and_ignores_missing_cells() {
        let zero = |cells| {
            let svg = surface(cells).draw();
            svg.split("class=\"zero\" d=\"").nth(1).map(|rest| rest.split('"').next().unwrap().to_owned())
        };
        // The lower left cell has a loss: there is a line right of it and one above it.
        let corner = format!("M{} {}v{ROW}M{LEFT} {}h120", LEFT + 120, TOP + ROW, TOP + ROW);
        assert_eq!(zero(vec![Some(-1.0), Some(0.0), Some(2.0), Some(0.01)]), Some(corner));
        assert_eq!(zero(vec![Some(-1.0), None, None, Some(3.0)]), None);
        assert_eq!(zero(vec![Some(0.0), Some(-0.01), Some(2.0), Some(3.0)]), None);
    }
}
