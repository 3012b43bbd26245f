//! What a tick costs a part, as a formula with measured factors.

use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use skein_runtime::PartTick;
use std::time::Duration;

/// Means over the measured ticks of one part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PartMeans {
    /// Drones of the whole swarm.
    pub swarm: f64,
    /// Its drones.
    pub drones: f64,
    /// Bodies of other parts that it knew of.
    pub halo_bodies: f64,
    /// Frames that it went through for its drones.
    pub frames: f64,
    /// Time for the drones' steps and for its world, µs.
    pub work_us: f64,
    /// Time to choose and to sort in what is sent to and by other parts, µs.
    pub exchange_us: f64,
    /// Bodies that it told other parts of.
    pub sent_bodies: f64,
    /// Frames that it passed on to other parts.
    pub sent_frames: f64,
    /// Bytes of these bodies.
    pub sent_body_bytes: f64,
    /// Bytes of these frames.
    pub sent_frame_bytes: f64,
    /// All bytes that it sent to other parts.
    pub sent_bytes: f64,
    /// Bytes of its share of the digest.
    pub digest_bytes: f64,
}

/// Sums that become means.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PartSums {
    ticks: f64,
    sum: PartMeans,
}

impl PartSums {
    /// Adds a tick.
    pub(super) fn add(&mut self, tick: &PartTick) {
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        self.ticks += 1.0;
        self.sum.drones += f64::from(tick.drones);
        self.sum.halo_bodies += f64::from(tick.halo_bodies);
        self.sum.frames += f64::from(tick.frames);
        self.sum.work_us += us(tick.steps + tick.world);
        self.sum.exchange_us += us(tick.exchange);
        self.sum.sent_bytes += tick.sent_bytes as f64;
        self.sum.sent_bodies += f64::from(tick.sent_bodies);
        self.sum.sent_frames += f64::from(tick.sent_frames);
        self.sum.sent_body_bytes += tick.sent_body_bytes as f64;
        self.sum.sent_frame_bytes += tick.sent_frame_bytes as f64;
        self.sum.digest_bytes += tick.digest_bytes as f64;
    }

    /// The means, for a part of a swarm of `swarm` drones.
    pub(super) fn means(&self, swarm: u32) -> PartMeans {
        let mean = |sum: f64| sum / self.ticks.max(1.0);
        PartMeans {
            swarm: f64::from(swarm),
            drones: mean(self.sum.drones),
            halo_bodies: mean(self.sum.halo_bodies),
            frames: mean(self.sum.frames),
            work_us: mean(self.sum.work_us),
            exchange_us: mean(self.sum.exchange_us),
            sent_bytes: mean(self.sum.sent_bytes),
            sent_bodies: mean(self.sum.sent_bodies),
            sent_frames: mean(self.sum.sent_frames),
            sent_body_bytes: mean(self.sum.sent_body_bytes),
            sent_frame_bytes: mean(self.sum.sent_frame_bytes),
            digest_bytes: mean(self.sum.digest_bytes),
        }
    }
}

/// What a tick costs a part: so much per drone, per frame, and for each pair of one of its drones and any drone of the swarm. In
/// addition, the exchange costs so much per drone and per byte sent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CostModel {
    /// Per agent-step, its world's share included, µs.
    pub drone_us: f64,
    /// Per frame that the part goes through, µs.
    pub frame_us: f64,
    /// Per agent-step and drone of the swarm, µs: what a drone hears and keeps of each other drone.
    pub pair_us: f64,
    /// Per drone, to choose what others are told of it and to sort it in, µs.
    pub exchange_drone_us: f64,
    /// Per byte that is sent to other parts, to choose it and to sort it in, µs.
    pub exchange_byte_us: f64,
}

impl CostModel {
    /// The factors that fit these parts best: least squares of the relative errors.
    pub(super) fn fit(parts: &[PartMeans]) -> Self {
        let [drone_us, frame_us, pair_us] = fit(parts.iter().map(|part| (work_terms(part), part.work_us)));
        let exchange = parts.iter().map(|part| ([part.drones, part.sent_bytes], part.exchange_us));
        let [exchange_drone_us, exchange_byte_us] = fit(exchange);
        Self { drone_us, frame_us, pair_us, exchange_drone_us, exchange_byte_us }
    }

    /// What it says that a part computes in a tick, µs.
    #[must_use]
    pub fn part_us(&self, part: &PartMeans) -> f64 {
        let [drones, frames, pairs] = work_terms(part);
        let work_us = self.drone_us * drones + self.frame_us * frames + self.pair_us * pairs;
        work_us + self.exchange_drone_us * part.drones + self.exchange_byte_us * part.sent_bytes
    }
}

/// What the work of a part grows with.
fn work_terms(part: &PartMeans) -> [f64; 3] {
    [part.drones, part.frames, part.drones * part.swarm]
}

/// The factors, none below 0, whose weighted sum is closest to the values, each error relative to its value. All sets of factors
/// above 0 are tried.
fn fit<const N: usize>(samples: impl Iterator<Item = ([f64; N], f64)>) -> [f64; N] {
    let (mut squares, mut sums) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
    for (terms, value) in samples.filter(|(_, value)| *value > 0.0) {
        let row = SVector::from(terms) / value;
        squares += row * row.transpose();
        sums += row;
    }
    let mut best = ([0.0; N], 0.0);
    for set in 1..1_u32 << N {
        let Some(factors) = fit_of(set, &squares, &sums).filter(|factors| factors.min() >= 0.0) else { continue };
        let error = factors.dot(&(squares * factors)) - 2.0 * factors.dot(&sums);
        if error < best.1 {
            best = (factors.into(), error);
        }
    }
    best.0
}

/// The factors of the terms in `set`, one bit each; the others are 0. `None` if the samples do not determine them.
fn fit_of<const N: usize>(set: u32, squares: &SMatrix<f64, N, N>, sums: &SVector<f64, N>) -> Option<SVector<f64, N>> {
    let chosen = |i: usize| set >> i & 1 == 1;
    let matrix = SMatrix::<f64, N, N>::from_fn(|i, j| match (chosen(i), chosen(j), i == j) {
        // Scaled, so that terms of any size can be told from none.
        (true, true, _) => squares[(i, j)] / (squares[(i, i)] * squares[(j, j)]).sqrt(),
        (_, _, same) => f64::from(u8::from(same)),
    });
    let scale = SVector::<f64, N>::from_fn(|i, _| if chosen(i) { squares[(i, i)].sqrt() } else { 1.0 });
    let wanted = SVector::<f64, N>::from_fn(|i, _| if chosen(i) { sums[i] / scale[i] } else { 0.0 });
    let found = matrix.cholesky()?.solve(&wanted).component_div(&scale);
    found.iter().all(|factor| factor.is_finite()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(swarm: f64, drones: f64, frames: f64, sent_bytes: f64) -> PartMeans {
        let work_us = 2.0 * drones + 0.5 * frames + 0.03 * drones * swarm;
        let exchange_us = 0.1 * drones + 0.01 * sent_bytes;
        PartMeans { swarm, drones, frames, sent_bytes, work_us, exchange_us, ..PartMeans::default() }
    }

    #[test]
    fn the_factors_of_a_formula_are_found() {
        let parts = [
            part(64.0, 64.0, 13.0, 100.0),
            part(64.0, 16.0, 200.0, 4000.0),
            part(1000.0, 1000.0, 210.0, 900.0),
            part(1000.0, 250.0, 150.0, 100.0),
        ];
        let model = CostModel::fit(&parts);
        let found = [model.drone_us, model.frame_us, model.pair_us, model.exchange_drone_us, model.exchange_byte_us];
        for (found, wanted) in found.into_iter().zip([2.0, 0.5, 0.03, 0.1, 0.01]) {
            assert!((found - wanted).abs() < 1e-6, "{model:?}");
        }
        assert!((model.part_us(&parts[0]) - parts[0].work_us - parts[0].exchange_us).abs() < 1e-6);
    }

    #[test]
    fn no_factor_is_negative() {
        let samples = [([10.0, 1.0], 10.0), ([10.0, 5.0], 8.0), ([20.0, 9.0], 17.0)];
        let found = fit(samples.into_iter());
        assert!(found[0] > 0.0 && found[1] == 0.0, "{found:?}");
        assert_eq!(fit([([2.0, 0.0], 4.0)].into_iter()), [2.0, 0.0]);
        assert_eq!(fit::<2>(std::iter::empty()), [0.0, 0.0]);
    }
}
