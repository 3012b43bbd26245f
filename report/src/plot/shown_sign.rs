//! A mark or a line of a pilot in the animated flight.

use crate::markup::escaped;
use skein_protocol::Vec2;
use std::fmt::Write;

/// The symbol of a mark, px.
const DIAMOND: &str = "M0-5L5 0L0 5L-5 0Z";
/// Greatest distance from the drawing's corner, px: numbers of viewers have few digits.
const FARTHEST: f64 = 1e5;

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SignKind {
    Mark,
    Line,
}

/// A mark or a line in one frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SignPoint {
    /// Number of the frame.
    pub frame: u64,
    /// The group of the drone that shows it.
    pub group: String,
    /// Its ends, m. They are equal for a mark.
    pub ends_m: [Vec2; 2],
}

/// The frames of an animation: the times at which what they show begins and ends, as shares of its length.
#[derive(Clone, Copy)]
pub(super) struct FrameTimes {
    /// Length of the flight, s.
    pub end_s: f64,
    /// Length of a frame, s.
    pub period_s: f64,
    /// Length of the animation, s.
    pub seconds: f64,
}

impl FrameTimes {
    fn begin(&self, frame: u64) -> f64 {
        (frame as f64 * self.period_s / self.end_s).min(1.0)
    }

    /// The frame in the middle of the flight. A viewer that does not animate shows it.
    fn still(&self) -> u64 {
        (self.end_s / 2.0 / self.period_s).floor() as u64
    }

    fn repeated(&self) -> String {
        format!("dur=\"{:.2}s\" repeatCount=\"indefinite\"", self.seconds)
    }
}

/// A mark or a line over the frames in which it is shown.
pub(super) struct ShownSign {
    kind: SignKind,
    label: String,
    /// In the order of the frames; not empty.
    points: Vec<SignPoint>,
}

impl ShownSign {
    pub(super) fn new(kind: SignKind, label: String, points: Vec<SignPoint>) -> Self {
        Self { kind, label, points }
    }

    #[cfg(test)]
    pub(super) fn points(&self) -> &[SignPoint] {
        &self.points
    }

    /// Draws it. `place`: from metres to pixels. `colour`: of a group.
    pub(super) fn draw(
        &self,
        svg: &mut String,
        times: FrameTimes,
        labelled: bool,
        place: impl Fn(Vec2) -> [f64; 2],
        mut colour: impl FnMut(&str) -> String,
    ) {
        let still = self.points.iter().position(|point| point.frame == times.still());
        let visibility = if still.is_some() { "visible" } else { "hidden" };
        let shown = &self.points[still.unwrap_or(0)];
        // Writing to a string cannot fail.
        let _ = write!(svg, "<g visibility=\"{visibility}\" stroke=\"{}\">", colour(&shown.group));
        discrete(svg, times, "visibility", self.presence());
        let by_group = self.points.chunk_by(|a, b| a.group == b.group);
        discrete(svg, times, "stroke", by_group.map(|part| (part[0].frame, colour(&part[0].group))).collect());
        let near = |at: Vec2| place(at).map(|px| px.clamp(-FARTHEST, FARTHEST));
        match self.kind {
            SignKind::Mark => {
                let at: Vec<String> = self.points.iter().map(|point| pair(near(point.ends_m[0]))).collect();
                let label = self.label(labelled, "x=\"8\" y=\"4\"");
                let drawn = format!("<path fill=\"none\" stroke-width=\"1.6\" d=\"{DIAMOND}\"/>{label}");
                self.moved(svg, times, &at, still.unwrap_or(0), &drawn);
            }
            SignKind::Line => {
                let line = |point: &SignPoint| {
                    let [from, to] = point.ends_m.map(near);
                    format!("M{}L{}", pair(from), pair(to))
                };
                let lines: Vec<String> = self.points.iter().map(line).collect();
                let _ = write!(svg, "<path fill=\"none\" stroke-width=\"1.6\" d=\"{}\">", lines[still.unwrap_or(0)]);
                if let Some([key_times, values]) = self.over_time(times, &lines) {
                    let repeated = times.repeated();
                    let _ = write!(
                        svg,
                        "<animate attributeName=\"d\" {repeated} keyTimes=\"{key_times}\" values=\"{values}\"/>"
                    );
                }
                svg.push_str("</path>");
                let label = self.label(labelled, "x=\"4\" y=\"-3\"");
                if !label.is_empty() {
                    let middle = |point: &SignPoint| pair(near((point.ends_m[0] + point.ends_m[1]) / 2.0));
                    let at: Vec<String> = self.points.iter().map(middle).collect();
                    self.moved(svg, times, &at, still.unwrap_or(0), &label);
                }
            }
        }
        svg.push_str("</g>\n");
    }

    fn label(&self, labelled: bool, place: &str) -> String {
        if !labelled || self.label.is_empty() {
            return String::new();
        }
        format!("<text {place} font-size=\"11\" stroke=\"none\" fill=\"#667\">{}</text>", escaped(&self.label))
    }

    /// Draws something that moves from place to place.
    fn moved(&self, svg: &mut String, times: FrameTimes, at: &[String], still: usize, drawn: &str) {
        let _ = write!(svg, "<g transform=\"translate({})\">", at[still]);
        if let Some([key_times, values]) = self.over_time(times, at) {
            let repeated = times.repeated();
            let _ = write!(
                svg,
                "<animateTransform attributeName=\"transform\" type=\"translate\" {repeated} keyTimes=\"{key_times}\" \
                 values=\"{values}\"/>"
            );
        }
        let _ = write!(svg, "{drawn}</g>");
    }

    /// Times and values of what changes from the end of one frame to the end of the next; `None` if nothing changes.
    fn over_time(&self, times: FrameTimes, values: &[String]) -> Option<[String; 2]> {
        let (first, last) = (values.first()?, values.last()?);
        if values.iter().all(|value| value == first) {
            return None;
        }
        let mut keys: Vec<(f64, &String)> = vec![(0.0, first)];
        let ends = self.points.iter().map(|point| times.begin(point.frame + 1));
        keys.extend(ends.zip(values));
        keys.push((1.0, last));
        let key_times: Vec<String> = keys.iter().map(|key| share(key.0)).collect();
        let values: Vec<&str> = keys.iter().map(|key| key.1.as_str()).collect();
        Some([key_times.join(";"), values.join(";")])
    }

    /// From which frames on it is shown, and not shown.
    fn presence(&self) -> Vec<(u64, String)> {
        let mut changes = Vec::new();
        for part in self.points.chunk_by(|a, b| a.frame + 1 == b.frame) {
            changes.push((part[0].frame, "visible".to_owned()));
            changes.push((part[part.len() - 1].frame + 1, "hidden".to_owned()));
        }
        if self.points[0].frame > 0 {
            changes.insert(0, (0, "hidden".to_owned()));
        }
        changes
    }
}

/// An attribute that has one value from a frame on. Writes nothing if it never changes.
fn discrete(svg: &mut String, times: FrameTimes, attribute: &str, mut changes: Vec<(u64, String)>) {
    changes.retain(|&(frame, _)| frame == 0 || times.begin(frame) < 1.0 - 1e-6);
    if let Some(first) = changes.first_mut() {
        first.0 = 0;
    }
    if changes.len() < 2 {
        return;
    }
    let key_times: Vec<String> = changes.iter().map(|&(frame, _)| share(times.begin(frame))).collect();
    let values: Vec<&str> = changes.iter().map(|(_, value)| value.as_str()).collect();
    let _ = write!(
        svg,
        "<animate attributeName=\"{attribute}\" calcMode=\"discrete\" {} keyTimes=\"{}\" values=\"{}\"/>",
        times.repeated(),
        key_times.join(";"),
        values.join(";")
    );
}

fn pair([x, y]: [f64; 2]) -> String {
    format!("{x:.1} {y:.1}")
}

fn share(of_the_whole: f64) -> String {
    format!("{of_the_whole:.5}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(sign: &ShownSign, labelled: bool) -> String {
        let times = FrameTimes { end_s: 4.0, period_s: 0.5, seconds: 0.5 };
        let mut svg = String::new();
        sign.draw(&mut svg, times, labelled, |at| [at.x, 100.0 - at.y], |group| format!("#{group}"));
        svg
    }

    fn sign(kind: SignKind, frames: &[(u64, &str, f64)]) -> ShownSign {
        let point = |&(frame, group, x): &(u64, &str, f64)| SignPoint {
            frame,
            group: group.to_owned(),
            ends_m: [Vec2::new(x, 1.0), Vec2::new(if kind == SignKind::Line { x + 5.0 } else { x }, 1.0)],
        };
        ShownSign::new(kind, "a<b".to_owned(), frames.iter().map(point).collect())
    }

    #[test]
    fn what_is_always_shown_at_one_place_is_not_animated() {
        let frames: Vec<(u64, &str, f64)> = (0..8).map(|frame| (frame, "a", 3.0)).collect();
        let svg = drawn(&sign(SignKind::Mark, &frames), true);
        assert!(svg.contains("translate(3.0 99.0)") && svg.contains("a&lt;b") && !svg.contains("animate"), "{svg}");
        assert!(!drawn(&sign(SignKind::Mark, &frames), false).contains("a&lt;b"));
    }

    #[test]
    fn a_mark_moves_changes_its_colour_and_is_gone_at_its_times() {
        let svg = drawn(&sign(SignKind::Mark, &[(1, "a", 3.0), (2, "b", 4.0), (6, "b", 1e300)]), false);
        assert!(svg.contains("<g visibility=\"hidden\" stroke=\"#a\">"), "{svg}");
        let visibility =
            "keyTimes=\"0.00000;0.12500;0.37500;0.75000;0.87500\" values=\"hidden;visible;hidden;visible;hidden\"";
        assert!(svg.contains(visibility), "{svg}");
        assert!(svg.contains("keyTimes=\"0.00000;0.25000\" values=\"#a;#b\""), "{svg}");
        let places = "keyTimes=\"0.00000;0.25000;0.37500;0.87500;1.00000\" \
                      values=\"3.0 99.0;3.0 99.0;4.0 99.0;100000.0 99.0;100000.0 99.0\"";
        assert!(svg.contains(places), "{svg}");
    }

    #[test]
    fn a_line_is_shown_in_the_middle_of_the_flight_by_viewers_that_do_not_animate() {
        let svg = drawn(
            &sign(SignKind::Line, &[(3, "a", 3.0), (4, "a", 4.0), (5, "a", 4.0), (6, "a", 4.0), (7, "a", 4.0)]),
            true,
        );
        assert!(svg.contains("<g visibility=\"visible\"") && svg.contains("d=\"M4.0 99.0L9.0 99.0\""), "{svg}");
        assert!(svg.contains("translate(6.5 99.0)"), "{svg}");
        assert!(svg.contains("values=\"hidden;visible\""), "what is shown to the end does not end: {svg}");
    }
}
