//! The flight as an animated SVG, for pages that show pictures but run no script.

use super::recording::Recording;
use super::samples::{Samples, Track, TrackPoint};
use super::shown_sign::FrameTimes;
use super::style::{hex, px, rgb};
use super::tracks::{colours, frame};
use crate::facts::RunFacts;
use crate::geometry::outline;
use crate::markup::escaped;
use crate::tuning::{ANIMATION_DRONES_MAX, ANIMATION_LABELS_MAX};
use skein_protocol::{Course, Vec2};
use std::fmt::Write;

/// Width of the drawing, px.
const WIDTH: f64 = 1100.0;
/// Height of the title, px.
const TITLE: f64 = 40.0;
/// Greatest length of the scale bar, px.
const BAR: f64 = 160.0;
/// Number of samples per key frame.
const SAMPLES_PER_KEY: usize = 5;
/// Simulated time per time of the animation.
const SPEED: f64 = 8.0;
/// The corners of a drone's symbol, the tip first, in the frame of the course, px.
const ARROW: [[f64; 2]; 4] = [[9.0, 0.0], [-7.0, 6.0], [-3.0, 0.0], [-7.0, -6.0]];

/// Draws the animation: the drones, and the marks and lines of their pilots. `None` without drones, and for a swarm that is too
/// large. A viewer that does not animate shows the middle of the flight.
pub(super) fn draw(samples: &Samples, recording: &Recording, facts: &RunFacts) -> Option<String> {
    if samples.tracks.is_empty() || samples.tracks.len() > ANIMATION_DRONES_MAX {
        return None;
    }
    let units_per_pixel = f64::from(px(1));
    let (low, high, height) = frame(samples, facts, WIDTH * units_per_pixel);
    let height = height / units_per_pixel;
    let scale = WIDTH / (high.x - low.x);
    let place = |at: Vec2| [(at.x - low.x) * scale, TITLE + (high.y - at.y) * scale];
    let colours: Vec<String> = colours(samples, recording.groups()).into_iter().map(hex).collect();
    let mut svg = head(facts, height + TITLE);
    legend(&mut svg, &samples.groups, &colours);
    // Writing to a string cannot fail.
    for shape in &facts.obstacles {
        let corners = outline(shape).into_iter().map(|(x, y)| place(Vec2::new(x, y)));
        let _ = writeln!(svg, "<polygon fill=\"#bebebe\" points=\"{}\"/>", points(corners));
    }
    scale_bar(&mut svg, scale, height + TITLE);
    let longest = samples.tracks.values().map(|track| track.points.len()).max().unwrap_or(0);
    for track in samples.tracks.values() {
        for (group, places) in track.parts() {
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{}\" stroke-opacity=\".35\" stroke-width=\"2\" points=\"{}\"/>",
                colours[group],
                points(thinned(places).map(place))
            );
        }
    }
    signs(&mut svg, recording, samples.end_s, place);
    let arrow = arrow(facts.course);
    for track in samples.tracks.values() {
        drone(&mut svg, &key_frames(track, longest), (place, &arrow), &colours, samples.end_s / SPEED);
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// The marks and lines of pilots, in the colours of the groups of their drones.
fn signs(svg: &mut String, recording: &Recording, end_s: f64, place: impl Fn(Vec2) -> [f64; 2]) {
    let (shown, mut order) = (recording.shown(), recording.groups().clone());
    let times = FrameTimes { end_s, period_s: shown.period_s(), seconds: end_s / SPEED };
    let labelled = shown.most() <= ANIMATION_LABELS_MAX;
    for sign in shown.signs() {
        sign.draw(svg, times, labelled, &place, |group| hex(rgb(order.colour(group))));
    }
}

/// The beginning of the drawing: its size, its background and its title.
fn head(facts: &RunFacts, height: f64) -> String {
    let title = escaped(&format!("{}: {} drones, {SPEED:.0} × real time", facts.scenario, facts.drones));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH:.0} {height:.0}\" width=\"{WIDTH:.0}\" height=\"{height:.0}\" \
         font-family=\"Helvetica,Arial,sans-serif\" fill=\"#333\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"12\" y=\"26\" font-size=\"17\">{title}</text>\n"
    )
}

/// The names of the groups in their colours, right of the title.
fn legend(svg: &mut String, groups: &[String], colours: &[String]) {
    let width = |group: &String| 34.0 + 9.0 * group.chars().count() as f64;
    let mut x = WIDTH - groups.iter().map(width).sum::<f64>().min(WIDTH / 2.0);
    for (group, colour) in groups.iter().zip(colours) {
        if x + width(group) > WIDTH {
            return;
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.0}\" y=\"14\" width=\"14\" height=\"14\" rx=\"3\" fill=\"{colour}\"/>\
             <text x=\"{:.0}\" y=\"26\" font-size=\"14\">{}</text>",
            x + 19.0,
            escaped(group)
        );
        x += width(group);
    }
}

/// A bar of a round length, lower left. `scale`: pixels per metre.
fn scale_bar(svg: &mut String, scale: f64, height: f64) {
    let longest_m = BAR / scale;
    let power = 10f64.powf(longest_m.log10().floor());
    let length_m = [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|&m| m <= longest_m).unwrap_or(power);
    let (x, y, end) = (16.0, height - 14.0, 16.0 + length_m * scale);
    let _ = writeln!(
        svg,
        "<path d=\"M{x} {0:.0}V{y:.0}H{end:.1}V{0:.0}\" fill=\"none\" stroke=\"#333\"/>\
         <text x=\"{1:.1}\" y=\"{2:.0}\" font-size=\"13\" text-anchor=\"middle\">{length_m} m</text>",
        y - 5.0,
        f64::midpoint(x, end),
        y - 6.0
    );
}

/// The outline of a drone's symbol, which points along the course.
fn arrow(course: Course) -> String {
    let corners = ARROW.map(|corner| course.to_world(corner.into())).map(|at| format!("{} {}", at.x, 0.0 - at.y));
    format!("M{}Z", corners.join("L"))
}

/// A drone's symbol at its key frames. `place`: of a point of the world in the drawing. `arrow`: the symbol's outline.
fn drone(
    svg: &mut String,
    keys: &[TrackPoint],
    (place, arrow): (impl Fn(Vec2) -> [f64; 2], &str),
    colours: &[String],
    seconds: f64,
) {
    let Some(still) = keys.get(keys.len() / 2) else { return };
    let at = |point: &TrackPoint| {
        let [x, y] = place(point.at_m);
        format!("{x:.1} {y:.1}")
    };
    let places: Vec<String> = keys.iter().map(at).collect();
    let repeated = format!("dur=\"{seconds:.2}s\" repeatCount=\"indefinite\"");
    let _ = write!(
        svg,
        "<path d=\"{arrow}\" fill=\"{}\" transform=\"translate({})\"><animateTransform attributeName=\"transform\" \
         type=\"translate\" {repeated} values=\"{}\"/>",
        colours[still.group],
        at(still),
        places.join(";")
    );
    if keys.iter().any(|key| key.group != still.group) {
        let (mut fills, mut times) = (Vec::new(), Vec::new());
        let mut from = 0;
        for part in keys.chunk_by(|a, b| a.group == b.group) {
            fills.push(colours[part[0].group].as_str());
            times.push(format!("{:.4}", from as f64 / (keys.len() - 1).max(1) as f64));
            from += part.len();
        }
        let _ = write!(
            svg,
            "<animate attributeName=\"fill\" calcMode=\"discrete\" {repeated} keyTimes=\"{}\" values=\"{}\"/>",
            times.join(";"),
            fills.join(";")
        );
    }
    svg.push_str("</path>\n");
}

/// Every fifth place, and the last one.
fn thinned(places: impl Iterator<Item = Vec2> + Clone) -> impl Iterator<Item = Vec2> {
    let last = places.clone().count().saturating_sub(1);
    let kept = move |&(place, _): &(usize, Vec2)| place % SAMPLES_PER_KEY == 0 || place == last;
    places.enumerate().filter(kept).map(|(_, at)| at)
}

/// The key frames of a drone. Each drone has the same number of them, so that all are shown at the same time. A dead drone
/// stays at its last position.
fn key_frames(track: &Track, longest: usize) -> Vec<TrackPoint> {
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
        let groups = vec!["N".to_owned(), "N1".to_owned()];
        let mut samples = Samples { end_s: 80.0, groups, ..Samples::default() };
        for (drone, count) in [(0, 101), (1, 40)] {
            let at_m = |i: u32| Vec2::new(f64::from(i), drone as f64 * 30.0);
            let points = (0..count).map(|i| TrackPoint { at_m: at_m(i), group: usize::from(i > 60) }).collect();
            samples.tracks.insert(drone, Track { points, ..Track::default() });
        }
        let svg = draw(&samples, &Recording::default(), &facts(2)).unwrap();
        let keys: Vec<usize> = svg
            .split("translate\" dur")
            .skip(1)
            .map(|rest| rest.split_once("values=\"").unwrap().1)
            .map(|rest| rest.split('"').next().unwrap().matches(';').count())
            .collect();
        assert_eq!(keys, [21, 21]);
        assert_eq!(svg.matches("attributeName=\"fill\"").count(), 1, "one drone changes its group: {svg}");
        assert!(svg.contains(">N1</text>") && svg.contains(">10 m</text>"), "{svg}");
        assert!(svg.contains("transform=\"translate("), "viewers that do not animate show no drones");
        assert!(svg.contains("dur=\"10.00s\"") && svg.contains("2 drones"), "{svg}");
    }
}
