//! How far the swarm is from its target shape over time: the paper's formation disturbance (R5), and the bending energy
//! of its equation E6.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::FORMATION;
use crate::folder::RunFolder;
use crate::formation::{centred, error, slots};
use crate::tuning::{
    DEVIATION_DRONES_MAX, DEVIATION_LARGE_SWARM_PERIOD_S, DEVIATION_PERIOD_S, DEVIATION_SMALL_SWARM_MAX,
};
use skein_protocol::Vec2;
use skein_protocol::thin_plate::ThinPlate;
use std::io::{self, Write};

const HEADER: &str = "t_s,disturbance_m,largest_m,bending";

/// Deviation of the swarm from its target shape at one time, after the best translation and assignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeDeviation {
    /// Time, s.
    pub t_s: f64,
    /// Root of the mean squared distance of the drones to their slots, m.
    pub disturbance_m: f64,
    /// Greatest distance of a drone to its slot, m.
    pub largest_m: f64,
    /// Bending energy ∬(f_xx² + 2 f_xy² + f_yy²) dx dy of the thin-plate spline f that maps each slot exactly to its drone
    /// (λ = 0); dimensionless, 0 for any affine image of the shape.
    pub bending: f64,
}

/// Samples the deviation over a mission.
#[derive(Default)]
pub(crate) struct DeviationSampler {
    /// The slots relative to their mean, and the splines over them, for the current number of drones.
    plate: Option<(Vec<Vec2>, ThinPlate)>,
    /// Number of the period of the last sample.
    period: Option<i64>,
}

impl DeviationSampler {
    /// Takes the positions of the living drones in a tick, and makes a sample of them if one is due.
    pub(crate) fn take(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2]) -> Option<ShapeDeviation> {
        if positions.len() < 2 || positions.len() > DEVIATION_DRONES_MAX {
            return None;
        }
        let every_s = if positions.len() > DEVIATION_SMALL_SWARM_MAX {
            DEVIATION_LARGE_SWARM_PERIOD_S
        } else {
            DEVIATION_PERIOD_S
        };
        let now = (t_s / every_s + 1e-6).floor() as i64;
        if self.period.replace(now) == Some(now) { None } else { self.measure(facts, t_s, positions) }
    }

    fn measure(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2]) -> Option<ShapeDeviation> {
        if self.plate.as_ref().is_none_or(|(slots, _)| slots.len() != positions.len()) {
            let slots = slots(facts, positions.len(), &[])?;
            let plate = ThinPlate::new(&slots, 0.0)?;
            self.plate = Some((slots, plate));
        }
        let (slots, plate) = self.plate.as_ref()?;
        let found = error(facts, positions, &[])?;
        let positions = centred(positions.to_vec());
        let mut images = vec![Vec2::zeros(); slots.len()];
        for (position, &slot) in positions.iter().zip(&found.slot_of) {
            images[slot] = *position;
        }
        let bending = plate.fit(&images)?.energy(&images).bending;
        Some(ShapeDeviation { t_s, disturbance_m: found.rmse_m, largest_m: found.largest_m, bending })
    }
}

/// Writes formation.csv, one line per sample.
pub(crate) struct DeviationWriter<W>(W);

impl<W: Write> DeviationWriter<W> {
    pub(crate) fn new(mut out: W) -> io::Result<Self> {
        writeln!(out, "{HEADER}").map(|()| Self(out))
    }

    pub(crate) fn take(&mut self, deviation: &ShapeDeviation) -> io::Result<()> {
        let ShapeDeviation { t_s, disturbance_m, largest_m, bending } = deviation;
        writeln!(self.0, "{t_s},{disturbance_m:.6},{largest_m:.6},{bending:.6}")
    }

    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Reads formation.csv of a run's folder, which [`crate::plot::write`] writes.
///
/// # Errors
/// [`ReportError::Io`], or [`ReportError::Content`] if a line is not as expected.
pub fn read(folder: &RunFolder) -> Result<Vec<ShapeDeviation>, ReportError> {
    let path = folder.path().join(FORMATION);
    let text = io::read_to_string(folder.files().read(FORMATION)?).map_err(ReportError::io(&path))?;
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
        deviations.take(&facts(8), 1.0, positions).unwrap()
    }

    #[test]
    fn a_translated_shape_is_undisturbed_and_a_stretched_shape_does_not_bend() {
        let moved = measured(&flown(8, |slot| slot + Vec2::new(300.0, -20.0)));
        assert!(moved.disturbance_m < 1e-9 && moved.bending < 1e-9, "{moved:?}");
        let stretched = measured(&flown(8, |slot| Vec2::new(slot.x, 1.2 * slot.y)));
        assert!(stretched.disturbance_m > 1.0 && stretched.bending < 1e-9, "{stretched:?}");
    }

    #[test]
    fn a_swarm_that_is_torn_apart_is_disturbed_and_bends() {
        let torn = measured(&flown(8, |slot| slot + Vec2::new(0.0, if slot.y < -1.0 { -100.0 } else { 0.0 })));
        // Three of eight drones moved by 100 m: the variance is 100² · 3/8 · 5/8.
        assert!((torn.disturbance_m - 100.0 * (15.0f64 / 64.0).sqrt()).abs() < 1e-6, "{torn:?}");
        assert!(torn.largest_m > 62.0 && torn.bending > 1.0, "{torn:?}");
    }

    #[test]
    fn large_swarms_are_sampled_less_often_and_samples_survive_the_file() {
        for (count, expected) in [(8, 10), (65, 2), (201, 0), (1, 0)] {
            let mut deviations = DeviationSampler::default();
            let take = |tick| {
                deviations.take(&facts(count as u32), 0.51 + f64::from(tick) * 0.02, &flown(count, |slot| slot * 1.5))
            };
            let samples: Vec<ShapeDeviation> = (0..50).filter_map(take).collect();
            assert!(samples.len().abs_diff(expected) <= 1, "{count}: {}", samples.len());
            let root = tempfile::tempdir().unwrap();
            let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
            let mut writer = DeviationWriter::new(folder.files().create(FORMATION).unwrap()).unwrap();
            samples.iter().try_for_each(|sample| writer.take(sample)).unwrap();
            let read = read(&folder).unwrap();
            let times = |samples: &[ShapeDeviation]| samples.iter().map(|sample| sample.t_s).collect::<Vec<_>>();
            assert_eq!(times(&read), times(&samples));
        }
    }
}
