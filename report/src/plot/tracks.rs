//! The tracks of the drones past the obstacles, seen from above, at true aspect ratio.

use super::samples::{Samples, Track};
use super::style::{
    Axes, Canvas, Chart, EDGE, GREY, Heading, LEFT, Sign, WIDTH, end, goal, lost, plot, px, rgb, start,
};
use crate::error::DrawError;
use crate::facts::{MissionEnd, RunFacts};
use crate::formation::around_dead;
use crate::geometry::outline;
use crate::group_order::GroupOrder;
use plotters::prelude::*;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Course, Vec2};

/// Least height of the plotting area.
const HEIGHT_MIN: u32 = px(260);
/// Greatest height of the plotting area.
const HEIGHT_MAX: u32 = px(1400);
/// Space around what is drawn, as a share of its larger extent.
const MARGIN: f64 = 0.04;
/// Colour of obstacles.
const OBSTACLE: RGBColor = RGBColor(190, 190, 190);

/// Draws the tracks. Returns the SVG.
pub(super) fn draw(samples: &Samples, order: &GroupOrder, facts: &RunFacts, title: &str) -> Result<String, DrawError> {
    let colours = colours(samples, order);
    let heading = Heading::new(title, signs(samples, facts, &colours));
    let (low, high, height) = frame(samples, facts, f64::from(WIDTH - LEFT - 2 * EDGE));
    let axes = Axes {
        x: (if facts.course == Course::East { "x (m), flight direction" } else { "x (m)" }, low.x..high.x),
        y: (if facts.course == Course::East { "y (m), left" } else { "y (m)" }, low.y..high.y),
        height: height.round() as u32,
    };
    plot(&heading, axes, |canvas, chart| {
        let course = course_line(facts, low, high);
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

/// The ends of the line along which the formation's front slot flies, within these corners, m.
fn course_line(facts: &RunFacts, low: Vec2, high: Vec2) -> [(f64, f64); 2] {
    let (from_m, to_m) = facts.course.extent((low, high));
    [from_m, to_m].map(|along_m| {
        let end = facts.course.to_world(Vec2::new(along_m, facts.course_y_m));
        (end.x, end.y)
    })
}

/// The colour of each of [`Samples::groups`].
pub(super) fn colours(samples: &Samples, order: &GroupOrder) -> Vec<RGBColor> {
    let mut order = order.clone();
    samples.groups.iter().map(|group| rgb(order.colour(group))).collect()
}

/// The legend.
fn signs(samples: &Samples, facts: &RunFacts, colours: &[RGBColor]) -> Vec<(Sign, String)> {
    let mut signs: Vec<(Sign, String)> =
        samples.groups.iter().zip(colours).map(|(group, &colour)| (Sign::Line(colour), group.clone())).collect();
    let lost = samples.tracks.values().any(|track| samples.is_lost(track));
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

/// The part of the world that a drawing of this width shows: its least and its greatest corner, m, and the height of the
/// drawing. A metre is equally long on both axes.
pub(super) fn frame(samples: &Samples, facts: &RunFacts, width: f64) -> (Vec2, Vec2, f64) {
    let tracks = samples.tracks.values().flat_map(|track| track.points.iter().map(|point| point.at_m));
    let corners = facts.obstacles.iter().map(ConvexShape::bounds).flat_map(|(low, high)| [low, high]);
    let empty = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
    let points = tracks.chain(corners).chain(goal_slots(samples, facts));
    let (low, high) = points.fold(empty, |(low, high), point| (low.inf(&point), high.sup(&point)));
    let middle = (low + high) / 2.0;
    let mut half = (high - low) / 2.0;
    half += Vec2::repeat(half.amax().max(1.0) * MARGIN * 2.0);
    let height = (width * half.y / half.x).clamp(HEIGHT_MIN.into(), HEIGHT_MAX.into());
    let metres_per_unit = (half.x / width).max(half.y / height);
    let half = Vec2::new(width, height) * metres_per_unit;
    (middle - half, middle + half, height)
}

/// The slots of the living drones at the goal, m.
fn goal_slots(samples: &Samples, facts: &RunFacts) -> Vec<Vec2> {
    let MissionEnd::Goal { front_m } = facts.end else { return Vec::new() };
    let (dead, living): (Vec<&Track>, Vec<&Track>) = samples.tracks.values().partition(|track| samples.is_lost(track));
    let dead: Vec<Vec2> = dead.into_iter().filter_map(|track| track.points.last()).map(|point| point.at_m).collect();
    around_dead(facts, living.len(), &dead).into_iter().map(|slot| slot + Vec2::from(front_m)).collect()
}

fn draw_tracks(chart: &mut Chart, canvas: &Canvas, samples: &Samples, colours: &[RGBColor]) -> Result<(), DrawError> {
    for track in samples.tracks.values() {
        for (group, places) in track.parts() {
            let line = places.map(|at| (at.x, at.y));
            chart.draw_series(LineSeries::new(line, colours[group].stroke_width(px(2)))).map_err(DrawError::new)?;
        }
    }
    for track in samples.tracks.values() {
        let ends = track.points.first().zip(track.points.last());
        let Some((a, b)) = ends else { continue };
        let (first, last) = (chart.backend_coord(&(a.at_m.x, a.at_m.y)), chart.backend_coord(&(b.at_m.x, b.at_m.y)));
        canvas.draw(&start(first, colours[a.group])).map_err(DrawError::new)?;
        if samples.is_lost(track) {
            canvas.draw(&lost(last, colours[b.group])).map_err(DrawError::new)?;
        } else {
            canvas.draw(&end(last, colours[b.group])).map_err(DrawError::new)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::samples::TrackPoint;
    use crate::testing::facts;

    #[test]
    fn a_metre_is_equally_long_on_both_axes() {
        for points in [[(0.0, 0.0), (500.0, 20.0)], [(0.0, 0.0), (20.0, 900.0)], [(0.0, 0.0), (300.0, 200.0)]] {
            let points = points.map(|(x, y)| TrackPoint { at_m: Vec2::new(x, y), group: 0 }).to_vec();
            let mut samples = Samples::default();
            samples.tracks.insert(0, Track { points: points.clone(), ..Track::default() });
            let (low, high, height) = frame(&samples, &facts(1), 4000.0);
            assert!((4000.0 / (high.x - low.x) - height / (high.y - low.y)).abs() < 1e-9);
            assert!(
                points
                    .iter()
                    .map(|point| point.at_m)
                    .all(|p| p.x > low.x && p.y > low.y && p.x < high.x && p.y < high.y)
            );
        }
    }
}
