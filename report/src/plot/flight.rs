//! The flight as an animated SVG, for pages that show pictures but run no script.

use super::samples::{Samples, Track};
use super::style::{INK, hex, px};
use super::tracks::{colours, frame};
use crate::facts::RunFacts;
use crate::geometry::outline;
use crate::markup::escaped;
use crate::tuning::ANIMATION_DRONES_MAX;
use skein_protocol::Vec2;
use std::fmt::Write;

/// Width of the drawing, px.
const WIDTH: f64 = 1100.0;
/// Height of the title, px.
const TITLE: f64 = 40.0;
/// Number of samples per key frame.
const SAMPLES_PER_KEY: usize = 5;
/// Simulated time per time of the animation.
const SPEED: f64 = 8.0;
/// The symbol of a drone, which points along the flight direction, px.
const ARROW: &str = "M9 0L-7 6L-3 0L-7 -6Z";

/// Draws the animation. `None` without drones, and for a swarm that is too large.
pub(super) fn draw(samples: &Samples, facts: &RunFacts) -> Option<String> {
    if samples.tracks.is_empty() || samples.tracks.len() > ANIMATION_DRONES_MAX {
        return None;
    }
    let units_per_pixel = f64::from(px(1));
    let (low, high, height) = frame(samples, facts, WIDTH * units_per_pixel);
    let height = height / units_per_pixel;
    let scale = WIDTH / (high.x - low.x);
    let place = |at: Vec2| [(at.x - low.x) * scale, TITLE + (high.y - at.y) * scale];
    let size = format!("{WIDTH:.0} {:.0}", height + TITLE);
    let (wide, tall) = size.split_once(' ')?;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {size}\" width=\"{wide}\" height=\"{tall}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"12\" y=\"26\" font-family=\"Helvetica,Arial,sans-serif\" font-size=\"17\" fill=\"#333\">{}</text>\n",
        escaped(&format!("{}: {} drones, {:.0} × real time", facts.scenario, facts.drones, SPEED))
    );
    // Writing to a string cannot fail.
    for shape in &facts.obstacles {
        let corners = outline(shape).into_iter().map(|(x, y)| place(Vec2::new(x, y)));
        let _ = writeln!(svg, "<polygon fill=\"#bebebe\" points=\"{}\"/>", points(corners));
    }
    let colours = colours(samples);
    let longest = samples.tracks.values().map(|track| track.points.len()).max().unwrap_or(0);
    let seconds = samples.end_s / SPEED;
    for track in samples.tracks.values() {
        let colour = hex(colours.get(track.group.as_str()).copied().unwrap_or(INK));
        let keys: Vec<[f64; 2]> = key_frames(track, longest).into_iter().map(place).collect();
        let _ = writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-opacity=\".3\" stroke-width=\"2\" points=\"{0}\"/>\n\
             <path d=\"{ARROW}\" fill=\"{colour}\"><animateTransform attributeName=\"transform\" type=\"translate\" \
             dur=\"{seconds:.2}s\" repeatCount=\"indefinite\" values=\"{1}\"/></path>",
            points(keys.iter().copied()),
            keys.iter().map(|[x, y]| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join(";"),
        );
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// The key frames of a drone, m. Each drone has the same number of them, so that all are shown at the same time. A dead
/// drone stays at its last position.
fn key_frames(track: &Track, longest: usize) -> Vec<Vec2> {
    let last = track.points.len().saturating_sub(1);
    let places = (0..longest).step_by(SAMPLES_PER_KEY).chain([longest.saturating_sub(1)]);
    places.filter_map(|place| track.points.get(place.min(last)).copied()).collect()
}

/// Points in the notation of SVG.
fn points(points: impl Iterator<Item = [f64; 2]>) -> String {
    points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    #[test]
    fn every_drone_has_the_same_number_of_key_frames() {
        let mut samples = Samples { end_s: 80.0, ..Samples::default() };
        for (drone, count) in [(0, 101), (1, 40)] {
            let points = (0..count).map(|i| Vec2::new(f64::from(i), drone as f64 * 30.0)).collect();
            samples.tracks.insert(drone, Track { points, ..Track::default() });
        }
        let svg = draw(&samples, &facts(2)).unwrap();
        let keys: Vec<usize> =
            svg.split(" values=\"").skip(1).map(|rest| rest.split('"').next().unwrap().matches(';').count()).collect();
        assert_eq!(keys, [21, 21]);
        assert!(svg.contains("dur=\"10.00s\"") && svg.contains("2 drones"), "{svg}");
    }
}
