//! The marks and lines that pilots show over a flight, in frames of equal length.

use super::shown_sign::{ShownSign, SignKind, SignPoint};
use crate::scene::{Sample, Shown};
use crate::tuning::{ANIMATION_SIGN_PERIOD_S, ANIMATION_SIGNS_MAX};
use skein_protocol::Vec2;
use std::collections::BTreeMap;

/// What the drones show in each frame: for each drone what it showed last in the frame.
pub(super) struct ShownFrames {
    /// Length of a frame, s. It grows in a long flight with many marks, so that they take no more memory.
    period_s: f64,
    /// The frames in which anything is shown, by their number.
    frames: BTreeMap<u64, BTreeMap<u32, OfDrone>>,
    /// Number of marks and lines in all frames.
    count: usize,
}

/// What one drone shows, and the group in which it is then.
struct OfDrone {
    group: String,
    shown: Shown,
}

impl OfDrone {
    fn count(&self) -> usize {
        self.shown.marks.len() + self.shown.lines.len()
    }
}

impl Default for ShownFrames {
    fn default() -> Self {
        Self { period_s: ANIMATION_SIGN_PERIOD_S, frames: BTreeMap::new(), count: 0 }
    }
}

impl ShownFrames {
    /// Takes what is shown in a sample.
    pub(super) fn take(&mut self, sample: &Sample) {
        if sample.shown.is_empty() {
            return;
        }
        let mut drones: BTreeMap<u32, Shown> = BTreeMap::new();
        for mark in &sample.shown.marks {
            drones.entry(mark.drone).or_default().marks.push(mark.clone());
        }
        for line in &sample.shown.lines {
            drones.entry(line.drone).or_default().lines.push(line.clone());
        }
        // A sample shows what was shown before it.
        let number = ((sample.state.t_s / self.period_s - 1e-6).max(0.0)).floor() as u64;
        let frame = self.frames.entry(number).or_default();
        for (drone, shown) in drones {
            let group = sample.state.group.get(drone as usize).cloned().unwrap_or_default();
            let of_drone = OfDrone { group, shown };
            self.count += of_drone.count();
            let before = frame.insert(drone, of_drone);
            self.count -= before.as_ref().map_or(0, OfDrone::count);
        }
        while self.count > ANIMATION_SIGNS_MAX && self.frames.len() > 1 {
            self.join_pairs();
        }
    }

    /// Makes one frame of each two.
    fn join_pairs(&mut self) {
        self.period_s *= 2.0;
        for (number, frame) in std::mem::take(&mut self.frames) {
            self.frames.entry(number / 2).or_default().extend(frame);
        }
        self.count = self.frames.values().flat_map(BTreeMap::values).map(OfDrone::count).sum();
    }

    /// Length of a frame, s.
    pub(super) fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Greatest number of marks and lines in a frame.
    pub(super) fn most(&self) -> usize {
        self.frames.values().map(|frame| frame.values().map(OfDrone::count).sum()).max().unwrap_or(0)
    }

    /// The marks and lines, each over the frames in which it is shown. Within a drone, the first mark with a label is the same
    /// in all frames, and so is the second one.
    pub(super) fn signs(&self) -> Vec<ShownSign> {
        let mut signs: BTreeMap<(u32, SignKind, &str, usize), Vec<SignPoint>> = BTreeMap::new();
        for (&frame, drones) in &self.frames {
            for (&drone, OfDrone { group, shown }) in drones {
                let mut seen: BTreeMap<(SignKind, &str), usize> = BTreeMap::new();
                let marks = shown.marks.iter().map(|mark| (SignKind::Mark, &mark.label, [mark.at_m; 2]));
                let lines = shown.lines.iter().map(|line| (SignKind::Line, &line.label, [line.from_m, line.to_m]));
                for (kind, label, ends) in marks.chain(lines) {
                    let ordinal = seen.entry((kind, label)).or_default();
                    let ends_m = ends.map(|[x, y, _]| Vec2::new(x, y));
                    let point = SignPoint { frame, group: group.clone(), ends_m };
                    signs.entry((drone, kind, label, *ordinal)).or_default().push(point);
                    *ordinal += 1;
                }
            }
        }
        let sign = |((_, kind, label, _), points): ((_, _, &str, _), _)| ShownSign::new(kind, label.to_owned(), points);
        signs.into_iter().map(sign).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ShownLine, ShownMark, State};

    fn sample(t_s: f64, places: &[(u32, f64)]) -> Sample {
        let mark = |&(drone, x): &(u32, f64)| ShownMark { drone, label: "aim".to_owned(), at_m: [x, 1.0, 50.0] };
        let shown = Shown { marks: places.iter().map(mark).collect(), ..Shown::default() };
        Sample { state: State { t_s, group: vec!["N".to_owned(); 2], ..State::default() }, shown, ..Sample::default() }
    }

    #[test]
    fn a_mark_keeps_its_place_among_those_of_its_drone_and_the_last_in_a_frame_counts() {
        let mut frames = ShownFrames::default();
        frames.take(&sample(0.1, &[(0, 1.0), (0, 2.0), (1, 7.0)]));
        frames.take(&sample(0.5, &[(0, 3.0), (0, 4.0)]));
        frames.take(&sample(0.6, &[(0, 5.0)]));
        frames.take(&sample(0.7, &[]));
        let line = ShownLine { drone: 1, label: String::new(), from_m: [0.0; 3], to_m: [4.0, 5.0, 6.0] };
        let shown = Shown { lines: vec![line], ..Shown::default() };
        frames.take(&Sample { shown, ..sample(1.2, &[]) });
        let places: Vec<Vec<(u64, f64)>> = frames
            .signs()
            .iter()
            .map(|sign| sign.points().iter().map(|point| (point.frame, point.ends_m[1].x)).collect())
            .collect();
        assert_eq!(places, [vec![(0, 3.0), (1, 5.0)], vec![(0, 4.0)], vec![(0, 7.0)], vec![(2, 4.0)]]);
        assert_eq!(frames.most(), 3);
    }

    #[test]
    fn frames_of_a_long_flight_grow_so_that_they_take_no_more_memory() {
        let mut frames = ShownFrames::default();
        let marks: Vec<(u32, f64)> = (0..64).map(|x| (0, f64::from(x))).collect();
        for second in 1..=2000 {
            frames.take(&sample(f64::from(second), &marks));
        }
        assert!(frames.count <= ANIMATION_SIGNS_MAX && frames.count > ANIMATION_SIGNS_MAX / 4, "{}", frames.count);
        let last = frames.signs()[0].points().last().map(|point| point.frame).unwrap();
        assert_eq!(last, (2000.0 / frames.period_s() - 1e-6).floor() as u64);
    }
}
