//! The common style of all plots: colours, sizes, axes, title and legend.

use crate::error::DrawError;
use crate::palette::GROUP_COLOURS;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// The colours of series and groups.
pub(super) const PALETTE: [RGBColor; GROUP_COLOURS.len()] = {
    let mut palette = [RGBColor(0, 0, 0); GROUP_COLOURS.len()];
    let mut i = 0;
    while i < palette.len() {
        let (r, g, b) = GROUP_COLOURS[i];
        palette[i] = RGBColor(r, g, b);
        i += 1;
    }
    palette
};
pub(super) const BLUE: RGBColor = PALETTE[0];
pub(super) const RED: RGBColor = RGBColor(204, 30, 20);
pub(super) const INK: RGBColor = RGBColor(51, 51, 51);
pub(super) const GREY: RGBColor = RGBColor(140, 140, 140);
pub(super) const GRID: RGBColor = RGBColor(232, 232, 232);
/// Font family, in order of preference.
const FONT: &str = "Helvetica, Arial, sans-serif";
/// Units of a drawing per pixel. The backend rounds to whole units, and tracks rounded to whole pixels would have steps.
const UNITS_PER_PIXEL: u32 = 4;
/// Width of a plot that shows a place, or many labels.
pub(super) const WIDTH: u32 = px(1100);
/// Width of a plot of a quantity over time: two of them fit beside each other.
const NARROW: u32 = px(740);
/// Width of the labels left of the plotting area.
pub(super) const LEFT: u32 = px(66);
/// Margin left of the labels and right of the plotting area.
pub(super) const EDGE: u32 = px(14);
/// Height of the labels below the plotting area.
pub(super) const BOTTOM: u32 = px(48);
/// Height of the title.
const TITLE: u32 = px(44);
/// Height of the second line of the title.
const SUBTITLE: u32 = px(20);
/// Height of a line of the legend.
const LINE: u32 = px(24);

/// A number of pixels in units of the drawing.
pub(super) const fn px(pixels: u32) -> u32 {
    pixels * UNITS_PER_PIXEL
}

/// The whole drawing.
pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// The plotting area with its axes.
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The two axes of a plot.
pub(super) struct Axes<'a> {
    /// Label and range of the abscissa.
    pub x: (&'a str, Range<f64>),
    /// Label and range of the ordinate. With an empty label, the axis has no numbers.
    pub y: (&'a str, Range<f64>),
    /// Height of the plotting area.
    pub height: u32,
}

/// Draws a plot with its heading, its axes, and what `content` adds. Returns the SVG.
pub(super) fn plot(
    heading: &Heading,
    axes: Axes<'_>,
    content: impl FnOnce(&Canvas, &mut Chart) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let size = (heading.width, heading.height + axes.height + BOTTOM);
    let mut svg = String::new();
    {
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE).map_err(DrawError::new)?;
        heading.draw(&canvas)?;
        let mut chart = ChartBuilder::on(&canvas)
            .margin_top(heading.height)
            .margin_left(EDGE)
            .margin_right(EDGE)
            .x_label_area_size(BOTTOM)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(axes.x.1, axes.y.1)
            .map_err(DrawError::new)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(axes.x.0).y_desc(axes.y.0).label_style(text(13)).axis_desc_style(text(14));
        mesh.x_labels((heading.width / px(90)) as usize).y_labels((axes.height / px(50)).max(4) as usize);
        if axes.y.0.is_empty() {
            mesh.y_labels(0).disable_y_mesh();
        }
        mesh.x_label_formatter(&number).y_label_formatter(&number).set_all_tick_mark_size(px(5));
        let (grid, axis) = (GRID.stroke_width(px(1)), INK.stroke_width(px(1)));
        mesh.bold_line_style(grid).light_line_style(TRANSPARENT).axis_style(axis).draw().map_err(DrawError::new)?;
        content(&canvas, &mut chart)?;
        canvas.present().map_err(DrawError::new)?;
    }
    Ok(pixels(svg, size))
}

/// The drawing with its width and its height in pixels. The view box keeps the units of the drawing.
pub(super) fn pixels(svg: String, size: (u32, u32)) -> String {
    let sized = |by: u32| format!("width=\"{}\" height=\"{}\"", size.0 / by, size.1 / by);
    svg.replacen(&sized(1), &sized(UNITS_PER_PIXEL), 1)
}

/// A label of an axis: the number without trailing zeros and rounding errors.
pub(super) fn number(value: &f64) -> String {
    // Adding zero turns -0 into 0.
    ((value * 1e6).round() / 1e6 + 0.0).to_string()
}

/// A colour of the palette.
pub(super) const fn rgb((r, g, b): (u8, u8, u8)) -> RGBColor {
    RGBColor(r, g, b)
}

/// The colour in the notation of SVG.
pub(super) fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A symbol of the legend.
#[derive(Clone, Copy)]
pub(super) enum Sign {
    /// A line.
    Line(RGBColor),
    /// A shaded range.
    Range(RGBColor),
    /// A filled shape.
    Block(RGBColor),
    /// ◇, a start.
    Start,
    /// ●, an end.
    End,
    /// ✕, a death.
    Lost,
    /// +, a slot at the goal.
    Goal,
}

/// Style of text of this size, pixels.
pub(super) fn text(size: u32) -> TextStyle<'static> {
    TextStyle::from((FONT, px(size)).into_font()).color(&INK).pos(Pos::new(HPos::Left, VPos::Center))
}

/// Title and legend. They are above the plotting area, so that they hide no data.
pub(super) struct Heading {
    title: String,
    /// A second line in smaller letters; may be empty.
    subtitle: String,
    entries: Vec<Entry>,
    width: u32,
    height: u32,
}

/// An entry of the legend at its place.
struct Entry {
    x: i32,
    y: i32,
    sign: Sign,
    label: String,
}

impl Heading {
    /// A heading with this title and legend. Entries that do not fit into a line start a new one.
    pub(super) fn new(title: &str, signs: Vec<(Sign, String)>) -> Self {
        Self::of_width(WIDTH, title, "", signs)
    }

    /// The heading of a plot that needs half the width of a page. What follows the first colon of the title is a second line.
    pub(super) fn narrow(title: &str, signs: Vec<(Sign, String)>) -> Self {
        let (title, subtitle) = title.split_once(": ").unwrap_or((title, ""));
        Self::of_width(NARROW, title, subtitle, signs)
    }

    fn of_width(width: u32, title: &str, subtitle: &str, signs: Vec<(Sign, String)>) -> Self {
        let first = LEFT + EDGE;
        let below = if subtitle.is_empty() { 0 } else { SUBTITLE };
        let (mut x, mut y) = (first, TITLE + below + px(10));
        let mut entries = Vec::new();
        for (sign, label) in signs {
            // Symbol, label with seven pixels per letter, and a gap.
            let entry = px(30 + 7 * label.chars().count() as u32 + 22);
            if x + entry > width - EDGE && x > first {
                (x, y) = (first, y + LINE);
            }
            entries.push(Entry { x: x as i32, y: y as i32, sign, label });
            x += entry;
        }
        let (title, subtitle) = (title.to_owned(), subtitle.to_owned());
        Self { title, subtitle, entries, width, height: y + LINE }
    }

    fn draw(&self, canvas: &Canvas) -> Result<(), DrawError> {
        let at = ((LEFT + EDGE) as i32, px(26) as i32);
        canvas.draw(&Text::new(self.title.as_str(), at, text(18))).map_err(DrawError::new)?;
        if !self.subtitle.is_empty() {
            let below = (at.0, at.1 + SUBTITLE as i32);
            canvas.draw(&Text::new(self.subtitle.as_str(), below, text(13))).map_err(DrawError::new)?;
        }
        for Entry { x, y, sign, label } in &self.entries {
            draw_sign(canvas, *sign, (*x, *y))?;
            canvas.draw(&Text::new(label.as_str(), (x + px(30) as i32, *y), text(14))).map_err(DrawError::new)?;
        }
        Ok(())
    }
}

fn draw_sign(canvas: &Canvas, sign: Sign, (x, y): (i32, i32)) -> Result<(), DrawError> {
    let (width, half) = (px(24) as i32, px(7) as i32);
    let middle = (x + width / 2, y);
    let block = [(x, y - half), (x + width, y + half)];
    match sign {
        Sign::Line(colour) => canvas.draw(&PathElement::new([(x, y), (x + width, y)], colour.stroke_width(px(3)))),
        Sign::Range(colour) => canvas.draw(&Rectangle::new(block, colour.mix(0.2).filled())),
        Sign::Block(colour) => canvas.draw(&Rectangle::new(block, colour.filled())),
        Sign::Start => canvas.draw(&start(middle, INK)),
        Sign::End => canvas.draw(&end(middle, INK)),
        Sign::Lost => canvas.draw(&lost(middle, INK)),
        Sign::Goal => canvas.draw(&goal(middle)),
    }
    .map_err(DrawError::new)
}

/// The diamond that marks a start.
pub(super) fn start((x, y): (i32, i32), colour: RGBColor) -> PathElement<(i32, i32)> {
    let half = px(6) as i32;
    let corners = [(x, y - half), (x + half, y), (x, y + half), (x - half, y), (x, y - half)];
    PathElement::new(corners, colour.stroke_width(px(2)))
}

/// The disc that marks an end.
pub(super) fn end(at: (i32, i32), colour: RGBColor) -> Circle<(i32, i32), u32> {
    Circle::new(at, px(5), colour.filled())
}

/// The cross that marks a death.
pub(super) fn lost(at: (i32, i32), colour: RGBColor) -> Cross<(i32, i32), u32> {
    Cross::new(at, px(6), colour.stroke_width(px(3)))
}

/// The plus that marks a slot at the goal.
pub(super) fn goal((x, y): (i32, i32)) -> PathElement<(i32, i32)> {
    let half = px(9) as i32;
    let lines = [(x, y - half), (x, y + half), (x, y), (x - half, y), (x + half, y)];
    PathElement::new(lines, GREY.stroke_width(px(1)))
}
