//! How far the swarm is from its target shape, moment by moment: the paper's disturbance, and the bending energy of E6.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::formation::{centred, error, slots};
use skein_protocol::Vec2;
use skein_protocol::thin_plate::ThinPlate;
use std::fmt::Write as _;
use std::path::Path;

/// Name of the file in a run's folder.
pub(crate) const FILE: &str = "formation.csv";
const HEADER: &str = "t_s,disturbance_m,largest_m,bending";
/// Between two samples, s.
const EVERY_S: f64 = 0.1;
/// The same above [`FEW`] drones, where the best assignment takes longer.
const RARELY_S: f64 = 1.0;
const FEW: usize = 64;
/// Above so many drones assignment and spline take seconds a sample: nothing is measured.
const DRONES_MAX: usize = 200;

/// The swarm against its target shape at a moment, after the best translation and assignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeDeviation {
    /// When, s.
    pub t_s: f64,
    /// Root of the mean square distance of drones to their slots, m.
    pub disturbance_m: f64,
    /// Greatest distance, m.
    pub largest_m: f64,
    /// ∬(f_xx² + 2 f_xy² + f_yy²) dx dy of the thin-plate spline f that takes each slot to its drone (λ = 0: exactly);
    /// dimensionless, 0 for any affine image of the shape.
    pub bending: f64,
}

/// Samples a mission.
#[derive(Default)]
pub(crate) struct DeviationSampler {
    /// For this number of drones: the slots about their mean, and splines over them.
    plate: Option<(Vec<Vec2>, ThinPlate)>,
    bin: Option<i64>,
    /// So far.
    pub samples: Vec<ShapeDeviation>,
}

impl DeviationSampler {
    /// Takes the living drones' positions of a tick; not every tick becomes a sample.
    pub fn take(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2]) {
        if positions.len() < 2 || positions.len() > DRONES_MAX {
            return;
        }
        let every_s = if positions.len() > FEW { RARELY_S } else { EVERY_S };
        let now = (t_s / every_s + 1e-6).floor() as i64;
        if self.bin.replace(now) != Some(now) {
            let sample = self.measure(facts, t_s, positions);
            self.samples.extend(sample);
        }
    }

    fn measure(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2]) -> Option<ShapeDeviation> {
        if self.plate.as_ref().is_none_or(|(slots, _)| slots.len() != positions.len()) {
            let slots = slots(facts, positions.len())?;
            let plate = ThinPlate::new(&slots, 0.0)?;
            self.plate = Some((slots, plate));
        }
        let (slots, plate) = self.plate.as_ref()?;
        let found = error(facts, positions)?;
        let positions = centred(positions.to_vec());
        let mut images = vec![Vec2::zeros(); slots.len()];
        positions.iter().zip(&found.slot_of).for_each(|(position, &slot)| images[slot] = *position);
        let bending = plate.fit(&images)?.energy(&images).bending;
        Some(ShapeDeviation { t_s, disturbance_m: found.rmse_m, largest_m: found.largest_m, bending })
    }
}

/// Writes formation.csv: a line a sample.
pub(crate) fn write(folder: &Path, samples: &[ShapeDeviation]) -> Result<(), ReportError> {
    let mut csv = format!("{HEADER}\n");
    for ShapeDeviation { t_s, disturbance_m, largest_m, bending } in samples {
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{t_s},{disturbance_m:.6},{largest_m:.6},{bending:.6}");
    }
    let path = folder.join(FILE);
    std::fs::write(&path, csv).map_err(ReportError::io(&path))
}

/// Reads the formation.csv that a report left in this folder.
///
/// # Errors
/// [`ReportError::Io`], [`ReportError::Content`] if it is none.
pub fn read(folder: &Path) -> Result<Vec<ShapeDeviation>, ReportError> {
    let path = folder.join(FILE);
    let text = std::fs::read_to_string(&path).map_err(ReportError::io(&path))?;
    let content = |found: String| ReportError::Content { path: path.clone(), expected: HEADER, found };
    let mut lines = text.lines();
    match lines.next() {
        Some(HEADER) => {}
        other => return Err(content(format!("line 1 is {other:?}"))),
    }
    let parse = |line: &str| {
        let fields: Option<Vec<f64>> = line.split(',').map(|field| field.parse().ok()).collect();
        let [t_s, disturbance_m, largest_m, bending] = fields?.try_into().ok()?;
        Some(ShapeDeviation { t_s, disturbance_m, largest_m, bending })
    };
    let row = |(number, line)| parse(line).ok_or_else(|| content(format!("line {} is \"{line}\"", number + 2)));
    lines.enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    fn flown(count: usize, image: impl Fn(Vec2) -> Vec2) -> Vec<Vec2> {
        facts(8).shape.slots(count, 35.0).into_iter().map(image).collect()
    }

    fn measured(positions: &[Vec2]) -> ShapeDeviation {
        let mut deviations = DeviationSampler::default();
        deviations.take(&facts(8), 1.0, positions);
        deviations.samples[0]
    }

    #[test]
    fn the_moved_shape_is_undisturbed_and_a_stretched_one_does_not_bend() {
        let moved = measured(&flown(8, |slot| slot + Vec2::new(300.0, -20.0)));
        assert!(moved.disturbance_m < 1e-9 && moved.bending < 1e-9, "{moved:?}");
        let stretched = measured(&flown(8, |slot| Vec2::new(slot.x, 1.2 * slot.y)));
        assert!(stretched.disturbance_m > 1.0 && stretched.bending < 1e-9, "{stretched:?}");
    }

    #[test]
    fn a_swarm_torn_apart_in_the_middle_is_disturbed_and_bends() {
        let torn = measured(&flown(8, |slot| slot + Vec2::new(0.0, if slot.y < -1.0 { -100.0 } else { 0.0 })));
        // Three of eight drones went 100 m: mean square 100² · 3/8 · 5/8 about the mean.
        assert!((torn.disturbance_m - 100.0 * (15.0f64 / 64.0).sqrt()).abs() < 1e-6, "{torn:?}");
        assert!(torn.largest_m > 62.0 && torn.bending > 1.0, "{torn:?}");
    }

    #[test]
    fn samples_are_as_far_apart_as_the_swarm_is_large_and_survive_the_file() {
        for (count, expected) in [(8, 10), (65, 2), (201, 0), (1, 0)] {
            let mut deviations = DeviationSampler::default();
            (0..50).for_each(|tick| {
                deviations.take(&facts(count as u32), 0.51 + f64::from(tick) * 0.02, &flown(count, |slot| slot * 1.5));
            });
            assert!(deviations.samples.len().abs_diff(expected) <= 1, "{count}: {}", deviations.samples.len());
            let folder = tempfile::tempdir().unwrap();
            write(folder.path(), &deviations.samples).unwrap();
            let read = read(folder.path()).unwrap();
            let times = |samples: &[ShapeDeviation]| samples.iter().map(|sample| sample.t_s).collect::<Vec<_>>();
            assert_eq!(times(&read), times(&deviations.samples));
        }
    }
}
