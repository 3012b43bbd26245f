//! The drones' ways past the obstacles, seen from above, at true aspect ratio.

use super::samples::{Samples, Track};
use super::style::{
    Axes, Canvas, Chart, EDGE, GREY, Heading, INK, LEFT, PALETTE, Sign, WIDTH, end, goal, lost, plot, px, start,
};
use crate::error::DrawError;
use crate::facts::{MissionEnd, RunFacts};
use plotters::prelude::*;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Least and greatest height of the plotting area.
const HEIGHT: (u32, u32) = (px(260), px(1400));
/// Space around what is drawn, as a share of its larger extent.
const MARGIN: f64 = 0.04;
/// Segments of a full circle.
const SEGMENTS: f64 = 72.0;
const OBSTACLE: RGBColor = RGBColor(190, 190, 190);

/// The SVG.
pub(super) fn draw(samples: &Samples, facts: &RunFacts, title: &str) -> Result<String, DrawError> {
    let colours = colours(samples);
    let heading = Heading::new(title, signs(samples, facts, &colours));
    let (low, high, height) = frame(samples, facts, f64::from(WIDTH - LEFT - 2 * EDGE));
    let axes = Axes {
        x: ("x (m), flight direction", low.x..high.x),
        y: ("y (m), left", low.y..high.y),
        height: height.round() as u32,
    };
    plot(&heading, axes, |canvas, chart| {
        let course = [(low.x, facts.course_y_m), (high.x, facts.course_y_m)];
        let (dash, gap) = (px(6), px(6));
        chart
            .draw_series(DashedLineSeries::new(course, dash, gap, GREY.stroke_width(px(1))))
            .map_err(DrawError::new)?;
        for shape in &facts.obstacles {
            chart.draw_series([Polygon::new(outline(shape), OBSTACLE.filled())]).map_err(DrawError::new)?;
        }
        draw_tracks(chart, canvas, samples, &colours)?;
        for slot in goal_slots(samples, facts) {
            canvas.draw(&goal(chart.backend_coord(&(slot.x, slot.y)))).map_err(DrawError::new)?;
        }
        Ok(())
    })
}

/// A colour for each group in which drones ended.
pub(super) fn colours(samples: &Samples) -> BTreeMap<&str, RGBColor> {
    let mut colours: BTreeMap<&str, RGBColor> =
        samples.tracks.values().map(|track| (track.group.as_str(), INK)).collect();
    colours.values_mut().zip(PALETTE.iter().cycle()).for_each(|(colour, &fresh)| *colour = fresh);
    colours
}

fn signs(samples: &Samples, facts: &RunFacts, colours: &BTreeMap<&str, RGBColor>) -> Vec<(Sign, String)> {
    let mut signs: Vec<(Sign, String)> =
        colours.iter().map(|(group, &colour)| (Sign::Line(colour), (*group).to_owned())).collect();
    let lost = samples.tracks.values().any(|track| samples.lost(track));
    let goal = matches!(facts.end, MissionEnd::Goal { .. });
    let marks = [
        (true, Sign::Start, "start"),
        (true, Sign::End, "end"),
        (lost, Sign::Lost, "dead"),
        (goal, Sign::Goal, "goal"),
        (!facts.obstacles.is_empty(), Sign::Block(OBSTACLE), "obstacle"),
    ];
    signs.extend(marks.into_iter().filter(|mark| mark.0).map(|(_, sign, label)| (sign, label.to_owned())));
    signs
}

/// Corners of what is shown, m, and the plotting area's height, so that a metre is as long either way.
pub(super) fn frame(samples: &Samples, facts: &RunFacts, width: f64) -> (Vec2, Vec2, f64) {
    let ways = samples.tracks.values().flat_map(|track| track.points.iter().copied());
    let corners = facts.obstacles.iter().map(ConvexShape::bounds).flat_map(|(low, high)| [low, high]);
    let nothing = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
    let points = ways.chain(corners).chain(goal_slots(samples, facts));
    let (low, high) = points.fold(nothing, |(low, high), point| (low.inf(&point), high.sup(&point)));
    let middle = (low + high) / 2.0;
    let mut half = (high - low) / 2.0;
    half += Vec2::repeat(half.amax().max(1.0) * MARGIN * 2.0);
    let height = (width * half.y / half.x).clamp(HEIGHT.0.into(), HEIGHT.1.into());
    let metres_a_pixel = (half.x / width).max(half.y / height);
    let half = Vec2::new(width, height) * metres_a_pixel;
    (middle - half, middle + half, height)
}

fn goal_slots(samples: &Samples, facts: &RunFacts) -> Vec<Vec2> {
    let MissionEnd::Goal { front_m } = facts.end else { return Vec::new() };
    let living = samples.tracks.values().filter(|track| !samples.lost(track)).count();
    facts.shape.slots(living, facts.spacing_m).into_iter().map(|slot| slot + Vec2::from(front_m)).collect()
}

fn draw_tracks(
    chart: &mut Chart,
    canvas: &Canvas,
    samples: &Samples,
    colours: &BTreeMap<&str, RGBColor>,
) -> Result<(), DrawError> {
    let colour = |track: &Track| colours.get(track.group.as_str()).copied().unwrap_or(INK);
    for track in samples.tracks.values() {
        let line = track.points.iter().map(|point| (point.x, point.y));
        chart.draw_series(LineSeries::new(line, colour(track).stroke_width(px(2)))).map_err(DrawError::new)?;
    }
    for track in samples.tracks.values() {
        let ends = track.points.first().zip(track.points.last());
        let Some((first, last)) =
            ends.map(|(a, b)| (chart.backend_coord(&(a.x, a.y)), chart.backend_coord(&(b.x, b.y))))
        else {
            continue;
        };
        canvas.draw(&start(first, colour(track))).map_err(DrawError::new)?;
        if samples.lost(track) {
            canvas.draw(&lost(last, colour(track))).map_err(DrawError::new)?;
        } else {
            canvas.draw(&end(last, colour(track))).map_err(DrawError::new)?;
        }
    }
    Ok(())
}

/// The outline with its rounding: about each vertex an arc from one edge's normal to the next one's.
pub(crate) fn outline(shape: &ConvexShape) -> Vec<(f64, f64)> {
    let vertices: Vec<Vec2> = shape.vertices().collect();
    let n = vertices.len();
    let normal = |from: Vec2, to: Vec2| {
        let edge = to - from;
        (-edge.x).atan2(edge.y)
    };
    let mut outline = Vec::new();
    for (i, &vertex) in vertices.iter().enumerate() {
        let first = normal(vertices[(i + n - 1) % n], vertex);
        let turn = if n == 1 { TAU } else { (normal(vertex, vertices[(i + 1) % n]) - first).rem_euclid(TAU) };
        let steps = if shape.radius_m > 0.0 { (turn / TAU * SEGMENTS).ceil().max(1.0) as u32 } else { 0 };
        for step in 0..=steps {
            let angle = first + turn * f64::from(step) / f64::from(steps.max(1));
            let point = vertex + Vec2::new(angle.cos(), angle.sin()) * shape.radius_m;
            outline.push((point.x, point.y));
        }
    }
    outline
}

impl Samples {
    /// Whether a drone was gone before the end.
    fn lost(&self, track: &Track) -> bool {
        track.last_s < self.end_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;
    use crate::vicinity::clearance;

    #[test]
    fn outlines_lie_on_the_surface() {
        let at = Vec2::new;
        for shape in [
            ConvexShape::circle(at(3.0, 4.0), 2.0).unwrap(),
            ConvexShape::new(&[at(0.0, 0.0), at(4.0, 1.0)], 1.0).unwrap(),
            ConvexShape::rectangle(at(1.0, 1.0), at(2.0, 3.0), 0.4).unwrap(),
            ConvexShape::new(&[at(0.0, 0.0), at(4.0, 0.0), at(1.0, 5.0)], 0.5).unwrap(),
        ] {
            let outline = outline(&shape);
            for &(x, y) in &outline {
                assert!(clearance(&shape, at(x, y)).abs() < 1e-9, "({x}, {y}) of {shape:?}");
            }
            let (low, high) = shape.bounds();
            let widest = outline.iter().fold(0.0f64, |widest, &(x, _)| widest.max(x - low.x));
            assert!((widest - (high - low).x).abs() < 0.01, "{shape:?}");
        }
    }

    #[test]
    fn a_metre_is_as_long_either_way() {
        for points in [[(0.0, 0.0), (500.0, 20.0)], [(0.0, 0.0), (20.0, 900.0)], [(0.0, 0.0), (300.0, 200.0)]] {
            let points = points.map(|(x, y)| Vec2::new(x, y)).to_vec();
            let mut samples = Samples::default();
            samples.tracks.insert(0, Track { points: points.clone(), ..Track::default() });
            let (low, high, height) = frame(&samples, &facts(1), 4000.0);
            assert!((4000.0 / (high.x - low.x) - height / (high.y - low.y)).abs() < 1e-9);
            assert!(points.iter().all(|p| p.x > low.x && p.y > low.y && p.x < high.x && p.y < high.y));
        }
    }
}
