//! The data of the plots: a trace, reduced to what a plot can show.

use super::curves::Band;
use super::series::Series;
use crate::close::Sweep;
use crate::deviation::{DeviationSampler, ShapeDeviation};
use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::formation;
use crate::interruption::Interrupted;
use crate::trace::{self, TraceRow};
use crate::tuning::{PLOT_PERIOD_S, PLOT_POINTS_MAX, PLOT_SLOT_ERROR_DRONES_MAX};
use skein_protocol::Vec2;
use std::collections::BTreeMap;

/// The data of the plots.
pub(super) struct Samples {
    /// Time, s, and least separation since the previous sample, m, so that no short dip is lost.
    pub separation: Series<(f64, f64)>,
    /// Speeds of the drones, m/s.
    pub speed: Series<Band>,
    /// Distances of all pairs of drones, m.
    pub distance: Series<Band>,
    /// Deviation of the swarm from its target shape.
    pub deviations: Series<ShapeDeviation>,
    /// Energies used by the drones, J.
    pub energy: Series<Band>,
    /// Time, s, and largest slot error, m.
    pub formation: Series<(f64, f64)>,
    /// The figures that pilots report, by name.
    pub own: Vec<(String, Series<OwnBand>)>,
    /// The groups of the tracks.
    pub groups: Vec<String>,
    /// Tracks by drone.
    pub tracks: BTreeMap<usize, Track>,
    /// Time of the last tick, s.
    pub end_s: f64,
    /// Whether the trace was thinned: what happened between two of its ticks is not known.
    pub is_thinned: bool,
    /// Samples from one point of a track to the next.
    pub(super) stride: usize,
    /// Samples so far.
    pub(super) taken: usize,
}

/// The track of a drone.
#[derive(Default)]
pub(super) struct Track {
    /// Its places. The first and the last one are exact.
    pub points: Vec<TrackPoint>,
    /// Time of its last position, s.
    pub last_s: f64,
    /// Its last place.
    pub last: TrackPoint,
}

/// A place of a track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TrackPoint {
    /// Position, m.
    pub at_m: Vec2,
    /// The drone's group there, as an index of [`Samples::groups`].
    pub group: usize,
}

impl Track {
    /// The parts of the track in which the drone is in one group: the group, and the places up to the first one in the next
    /// group.
    pub(super) fn parts(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = Vec2> + Clone)> {
        let mut from = 0;
        self.points.chunk_by(|a, b| a.group == b.group).map(move |part| {
            let until = (from + part.len() + 1).min(self.points.len());
            let places = self.points[from..until].iter().map(|point| point.at_m);
            from += part.len();
            (part[0].group, places)
        })
    }
}

/// A figure that pilots report, over a short time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnBand {
    pub t_s: f64,
    /// Number of values and their sum.
    count: f64,
    sum: f64,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
}

impl OwnBand {
    /// Of a single value.
    pub(super) fn new(t_s: f64, value: f64) -> Self {
        Self { t_s, count: 1.0, sum: value, low: value, high: value }
    }

    /// Mean over drones and time.
    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count
    }

    fn join(&mut self, other: Self) {
        (self.count, self.sum) = (self.count + other.count, self.sum + other.sum);
        (self.low, self.high) = (self.low.min(other.low), self.high.max(other.high));
    }
}

impl Default for Samples {
    fn default() -> Self {
        let first = |_: &mut Band, _| {};
        Self {
            separation: Series::new(|(_, least), (_, other)| *least = least.min(other)),
            speed: Series::new(first),
            distance: Series::new(first),
            deviations: Series::new(|_, _| {}),
            energy: Series::new(first),
            formation: Series::new(|(_, most), (_, other)| *most = most.max(other)),
            own: Vec::new(),
            groups: Vec::new(),
            tracks: BTreeMap::new(),
            end_s: 0.0,
            is_thinned: false,
            stride: 1,
            taken: 0,
        }
    }
}

impl Samples {
    /// Reads trace.csv. Calls `deviated` with each deviation from the target shape.
    ///
    /// # Errors
    /// The error of `deviated`; [`ReportError::Io`], [`ReportError::Interrupted`], or [`ReportError::Content`] for an
    /// invalid line.
    pub(crate) fn read(
        folder: &RunFolder,
        facts: &RunFacts,
        interrupted: &Interrupted<'_>,
        mut deviated: impl FnMut(&ShapeDeviation) -> Result<(), ReportError>,
    ) -> Result<Self, ReportError> {
        let (mut samples, mut sweep, mut period) = (Self::default(), Sweep::default(), None);
        let mut sampler = DeviationSampler::default();
        let names = trace::read(folder, interrupted, |rows| {
            samples.is_thinned |= samples.end_s > 0.0 && rows[0].t_s - samples.end_s > 1.5 * facts.dt_s;
            let positions: Vec<Vec2> = rows.iter().map(|row| row.position_m).collect();
            if let Some(deviation) = sampler.take(facts, rows[0].t_s, &positions) {
                deviated(&deviation)?;
                samples.deviations.push(deviation);
            }
            let now = (rows[0].t_s / PLOT_PERIOD_S + 1e-6).floor() as i64;
            samples.take(facts, rows, &positions, period.replace(now) != Some(now), &mut sweep);
            Ok(())
        })?;
        for ((known, _), name) in samples.own.iter_mut().zip(names) {
            *known = name;
        }
        for track in samples.tracks.values_mut() {
            track.points.push(track.last);
        }
        samples.thin();
        Ok(samples)
    }

    /// Takes the rows of a tick.
    fn take(&mut self, facts: &RunFacts, rows: &[TraceRow], positions: &[Vec2], sampled: bool, sweep: &mut Sweep) {
        let t_s = rows[0].t_s;
        self.end_s = t_s;
        match (sweep.least_distance(positions), self.separation.last_mut()) {
            (Some(least), Some(last)) if !sampled => last.1 = last.1.min(least),
            (Some(least), _) => self.separation.push((t_s, least)),
            (None, _) => {}
        }
        let drawn = sampled && self.taken.is_multiple_of(self.stride);
        self.taken += usize::from(sampled);
        for row in rows {
            let known = self.groups.iter().position(|group| *group == row.group);
            let group = known.unwrap_or_else(|| {
                self.groups.push(row.group.clone());
                self.groups.len() - 1
            });
            let track = self.tracks.entry(row.drone).or_default();
            (track.last_s, track.last) = (t_s, TrackPoint { at_m: row.position_m, group });
            if drawn || track.points.is_empty() {
                track.points.push(track.last);
            }
        }
        self.take_own(rows, sampled);
        if sampled {
            band(t_s, rows.iter().map(|row| row.velocity_mps.norm()))
                .into_iter()
                .for_each(|band| self.speed.push(band));
            let pair = |i: usize| positions[..i].iter().map(move |other| (i, other));
            let distances = (0..positions.len()).flat_map(pair).map(|(i, other)| (positions[i] - other).norm());
            band(t_s, distances).into_iter().for_each(|band| self.distance.push(band));
            band(t_s, rows.iter().map(|row| row.energy_j)).into_iter().for_each(|band| self.energy.push(band));
            if let Some(error) =
                formation::error(facts, positions, &[]).filter(|_| rows.len() <= PLOT_SLOT_ERROR_DRONES_MAX)
            {
                self.formation.push((t_s, error.largest_m));
            }
        }
        if self.points() > 2 * PLOT_POINTS_MAX {
            self.halve_tracks();
        }
    }

    /// Takes the figures that pilots report. Between two samples all values count.
    fn take_own(&mut self, rows: &[TraceRow], sampled: bool) {
        let columns = rows[0].metrics.len();
        self.own.resize_with(columns, || (String::new(), Series::new(OwnBand::join)));
        for (column, (_, series)) in self.own.iter_mut().enumerate() {
            let values = rows.iter().filter_map(|row| row.metrics.get(column).copied().flatten());
            let joined = values.map(|value| OwnBand::new(rows[0].t_s, value)).reduce(|mut all, one| {
                all.join(one);
                all
            });
            match (joined, series.last_mut()) {
                (Some(band), Some(last)) if !sampled && band.t_s - last.t_s < PLOT_PERIOD_S => last.join(band),
                (Some(band), _) => series.push(band),
                (None, _) => {}
            }
        }
    }

    /// Number of points of all tracks.
    fn points(&self) -> usize {
        self.tracks.values().map(|track| track.points.len()).sum()
    }

    /// Removes every second point of each track, so that tracks take no more memory in a long flight.
    fn halve_tracks(&mut self) {
        self.stride *= 2;
        for track in self.tracks.values_mut() {
            let mut place = 0;
            track.points.retain(|_| {
                place += 1;
                place % 2 == 1
            });
        }
    }

    /// Whether a drone died before the end.
    pub(super) fn is_lost(&self, track: &Track) -> bool {
        track.last_s < self.end_s
    }

    /// Removes points evenly until no more than [`PLOT_POINTS_MAX`] are left.
    fn thin(&mut self) {
        let step = self.points().div_ceil(PLOT_POINTS_MAX).max(1);
        for track in self.tracks.values_mut() {
            let last = track.points.len() - 1;
            let mut place = 0;
            track.points.retain(|_| {
                place += 1;
                (place - 1) % step == 0 || place - 1 == last
            });
        }
    }
}

/// Mean and standard deviation, by the method of Welford; `None` without values.
fn band(t_s: f64, values: impl Iterator<Item = f64>) -> Option<Band> {
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        count += 1.0;
        let off = value - mean;
        mean += off / count;
        squares += off * (value - mean);
    }
    (count > 0.0).then(|| Band { t_s, mean, deviation: f64::sqrt(squares / count) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    #[test]
    fn a_dip_between_samples_is_kept_and_tracks_end_at_their_last_positions() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let header = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j\n";
        let line = |tick: u32, drone, x: f64, v: f64, group| {
            format!("{},{drone},{x},0,{v},0,50,0,{group},,0\n", f64::from(tick) * 0.02)
        };
        let mut csv = header.to_owned();
        for tick in 1..=13 {
            csv += &line(tick, 0, 0.0, 3.0, if tick < 9 { "N" } else { "N1" });
            if tick < 9 {
                csv += &line(tick, 4, if tick == 7 { 30.0 } else { 40.0 }, 5.0, "N");
            }
        }
        folder.files().write("trace.csv", csv.as_bytes()).unwrap();
        let samples = Samples::read(&folder, &facts(8), &Interrupted::never(), |_| Ok(())).unwrap();
        let least: Vec<f64> = samples.separation.samples().iter().map(|&(_, m)| m).collect();
        assert_eq!(least, [40.0, 30.0]);
        let (speed, distance) = (samples.speed.samples(), samples.distance.samples());
        assert_eq!((speed.len(), speed[0].mean, speed[0].deviation), (3, 4.0, 1.0));
        assert_eq!((distance.len(), distance[0].mean), (2, 40.0));
        let group = |track: &Track| samples.groups[track.last.group].as_str();
        let tracks: Vec<_> = samples.tracks.iter().map(|(&id, t)| (id, group(t), t.last_s)).collect();
        assert_eq!(tracks, [(0, "N1", 0.26), (4, "N", 0.16)]);
        let parts: Vec<_> = samples.tracks[&0].parts().map(|(group, places)| (group, places.count())).collect();
        assert_eq!(parts, [(0, 3), (1, 2)], "each part reaches to the next one");
    }
}
