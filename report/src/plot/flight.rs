//! The flight as an animated SVG, for a page that shows pictures and runs no script.

use super::samples::{Samples, Track};
use super::style::px;
use super::sweep::escaped;
use super::tracks::{colours, frame, outline};
use crate::facts::RunFacts;
use plotters::style::RGBColor;
use skein_protocol::Vec2;
use std::fmt::Write;

/// Width of the drawing, px.
const WIDTH: f64 = 1100.0;
/// Space for the title above, px.
const TITLE: f64 = 40.0;
/// Of the samples, every so many-th is a key frame.
const EVERY: usize = 5;
/// Simulated seconds shown in one.
const SPEED: f64 = 8.0;
/// More drones would make a file that nobody wants to load.
const MOST: usize = 64;
/// A drone: a dart that points along the flight, px.
const DART: &str = "M9 0L-7 6L-3 0L-7 -6Z";

/// The SVG; `None` for a swarm that is too large.
pub(super) fn draw(samples: &Samples, facts: &RunFacts) -> Option<String> {
    if samples.tracks.is_empty() || samples.tracks.len() > MOST {
        return None;
    }
    let fine = f64::from(px(1));
    let (low, high, height) = frame(samples, facts, WIDTH * fine);
    let height = height / fine;
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
        let colour = hex(colours.get(track.group.as_str()).copied().unwrap_or(super::style::INK));
        let way: Vec<[f64; 2]> = frames(track, longest).into_iter().map(place).collect();
        let _ = writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-opacity=\".3\" stroke-width=\"2\" points=\"{0}\"/>\n\
             <path d=\"{DART}\" fill=\"{colour}\"><animateTransform attributeName=\"transform\" type=\"translate\" \
             dur=\"{seconds:.2}s\" repeatCount=\"indefinite\" values=\"{1}\"/></path>",
            points(way.iter().copied()),
            way.iter().map(|[x, y]| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join(";"),
        );
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// Key frames: as many for each drone, so that all are shown at the same time; a dead one stays where it was.
fn frames(track: &Track, longest: usize) -> Vec<Vec2> {
    let last = track.points.len().saturating_sub(1);
    let places = (0..longest).step_by(EVERY).chain([longest.saturating_sub(1)]);
    places.filter_map(|place| track.points.get(place.min(last)).copied()).collect()
}

fn points(points: impl Iterator<Item = [f64; 2]>) -> String {
    points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

fn hex(colour: RGBColor) -> String {
    format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    #[test]
    fn every_drone_has_as_many_key_frames() {
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
