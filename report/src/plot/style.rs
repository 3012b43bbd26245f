//! What all plots have in common.

use crate::error::DrawError;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// Okabe and Ito's colours that show on white, told apart by colour-blind people too.
pub(super) const PALETTE: [RGBColor; 7] = [
    BLUE,
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(120, 94, 60),
    RGBColor(213, 94, 0),
];
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const RED: RGBColor = RGBColor(204, 30, 20);
pub(super) const INK: RGBColor = RGBColor(51, 51, 51);
pub(super) const GREY: RGBColor = RGBColor(140, 140, 140);
pub(super) const GRID: RGBColor = RGBColor(232, 232, 232);
/// Fonts in the order in which they are tried.
const FONT: &str = "Helvetica, Arial, sans-serif";
/// Units of a drawing to a pixel: the backend rounds to whole units, and a track of whole pixels is a staircase.
const FINE: u32 = 4;
/// Width of every plot.
pub(super) const WIDTH: u32 = px(1100);
/// Left of the plotting area: ordinate's labels.
pub(super) const LEFT: u32 = px(66);
/// Left of that, and right of the plotting area.
pub(super) const EDGE: u32 = px(14);
/// Below it: abscissa's labels.
pub(super) const BOTTOM: u32 = px(48);
/// Height of the title and of each line of the legend.
const TITLE: u32 = px(44);
const LINE: u32 = px(24);

/// Pixels in a drawing's units.
pub(super) const fn px(pixels: u32) -> u32 {
    pixels * FINE
}

/// Where a drawing goes.
pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// Axes with numbers on a canvas.
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// What the two axes show.
pub(super) struct Axes<'a> {
    /// What stands below, and from where to where it goes.
    pub x: (&'a str, Range<f64>),
    /// The same for what stands left; without a word there, an axis without numbers.
    pub y: (&'a str, Range<f64>),
    /// Height of the plotting area.
    pub height: u32,
}

/// A plot: heading, axes, and whatever `content` draws. The SVG.
pub(super) fn plot(
    heading: &Heading,
    axes: Axes<'_>,
    content: impl FnOnce(&Canvas, &mut Chart) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let size = (WIDTH, heading.height + axes.height + BOTTOM);
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
        mesh.x_labels(12).y_labels((axes.height / px(50)).max(4) as usize);
        if axes.y.0.is_empty() {
            mesh.y_labels(0).disable_y_mesh();
        }
        mesh.x_label_formatter(&number).y_label_formatter(&number).set_all_tick_mark_size(px(5));
        let (grid, axis) = (GRID.stroke_width(px(1)), INK.stroke_width(px(1)));
        mesh.bold_line_style(grid).light_line_style(TRANSPARENT).axis_style(axis).draw().map_err(DrawError::new)?;
        content(&canvas, &mut chart)?;
        canvas.present().map_err(DrawError::new)?;
    }
    // The view box keeps the drawing's units; shown, it has its size in pixels.
    let sized = |by: u32| format!("width=\"{}\" height=\"{}\"", size.0 / by, size.1 / by);
    Ok(svg.replacen(&sized(1), &sized(FINE), 1))
}

/// 50 and 2.5, not 50.0 and 2.4999999.
fn number(value: &f64) -> String {
    // Adding zero turns -0 into 0.
    ((value * 1e6).round() / 1e6 + 0.0).to_string()
}

/// A sign of the legend.
#[derive(Clone, Copy)]
pub(super) enum Sign {
    /// A line.
    Line(RGBColor),
    /// A shaded range about it.
    Range(RGBColor),
    /// A filled shape.
    Block(RGBColor),
    /// ◇.
    Start,
    /// ●.
    End,
    /// ✕.
    Lost,
    /// +.
    Goal,
}

/// Text of a size in pixels, in ink.
pub(super) fn text(size: u32) -> TextStyle<'static> {
    TextStyle::from((FONT, px(size)).into_font()).color(&INK).pos(Pos::new(HPos::Left, VPos::Center))
}

/// Title and legend above the plotting area, so that they hide no data.
pub(super) struct Heading {
    title: String,
    entries: Vec<(i32, i32, Sign, String)>,
    /// Height of it all.
    pub height: u32,
}

impl Heading {
    pub fn new(title: &str, signs: Vec<(Sign, String)>) -> Self {
        let first = LEFT + EDGE;
        let (mut x, mut y) = (first, TITLE + px(10));
        let mut entries = Vec::new();
        for (sign, label) in signs {
            // Sign, label at seven pixels a letter, and some space.
            let width = px(30 + 7 * label.chars().count() as u32 + 22);
            if x + width > WIDTH - EDGE && x > first {
                (x, y) = (first, y + LINE);
            }
            entries.push((x as i32, y as i32, sign, label));
            x += width;
        }
        Self { title: title.to_owned(), entries, height: y + LINE }
    }

    fn draw(&self, canvas: &Canvas) -> Result<(), DrawError> {
        let at = ((LEFT + EDGE) as i32, px(26) as i32);
        canvas.draw(&Text::new(self.title.as_str(), at, text(18))).map_err(DrawError::new)?;
        for (x, y, sign, label) in &self.entries {
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
