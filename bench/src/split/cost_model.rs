//! What a tick costs a part, as a formula with measured factors.

use serde::Serialize;
use skein_runtime::PartTick;
use std::time::Duration;

/// Means over the measured ticks of one part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PartMeans {
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

    /// The means.
    pub(super) fn means(&self) -> PartMeans {
        let mean = |sum: f64| sum / self.ticks.max(1.0);
        PartMeans {
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

/// What a tick costs a part: so much per drone and per frame, and so much per drone and per byte sent for the exchange.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CostModel {
    /// Per agent-step, its world's share included, µs.
    pub drone_us: f64,
    /// Per frame that the part goes through, µs.
    pub frame_us: f64,
    /// Per drone, to choose what others are told of it and to sort it in, µs.
    pub exchange_drone_us: f64,
    /// Per byte that is sent to other parts, to choose it and to sort it in, µs.
    pub exchange_byte_us: f64,
}

impl CostModel {
    /// The factors that fit these parts best: least squares of the relative errors.
    pub(super) fn fit(parts: &[PartMeans]) -> Self {
        let work = fit(parts.iter().map(|part| ([part.drones, part.frames], part.work_us)));
        let exchange = fit(parts.iter().map(|part| ([part.drones, part.sent_bytes], part.exchange_us)));
        Self { drone_us: work[0], frame_us: work[1], exchange_drone_us: exchange[0], exchange_byte_us: exchange[1] }
    }

    /// What it says that a part computes in a tick, µs.
    #[must_use]
    pub fn part_us(&self, part: &PartMeans) -> f64 {
        self.drone_us * part.drones
            + self.frame_us * part.frames
            + self.exchange_drone_us * part.drones
            + self.exchange_byte_us * part.sent_bytes
    }
}

/// The two factors, neither below 0, whose weighted sum is closest to the values, each error relative to its value.
fn fit(samples: impl Iterator<Item = ([f64; 2], f64)> + Clone) -> [f64; 2] {
    let scaled = samples.filter(|(_, y)| *y > 0.0).map(|([a, b], y)| [a / y, b / y]);
    let sum = |of: fn([f64; 2]) -> f64| scaled.clone().map(of).sum::<f64>();
    let (aa, ab, bb) = (sum(|[a, _]| a * a), sum(|[a, b]| a * b), sum(|[_, b]| b * b));
    let (a, b) = (sum(|[a, _]| a), sum(|[_, b]| b));
    let alone = |y: f64, yy: f64| if yy > 0.0 { y / yy } else { 0.0 };
    let determinant = aa * bb - ab * ab;
    if determinant <= 1e-9 * aa * bb {
        return [alone(a, aa), 0.0];
    }
    let both = [(a * bb - b * ab) / determinant, (b * aa - a * ab) / determinant];
    match both {
        [first, _] if first < 0.0 => [0.0, alone(b, bb)],
        [_, second] if second < 0.0 => [alone(a, aa), 0.0],
        _ => both,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(drones: f64, frames: f64, sent_bytes: f64) -> PartMeans {
        let (work_us, exchange_us) = (2.0 * drones + 0.5 * frames, 0.1 * drones + 0.01 * sent_bytes);
        PartMeans { drones, frames, sent_bytes, work_us, exchange_us, ..PartMeans::default() }
    }

    #[test]
    fn the_factors_of_a_formula_are_found() {
        let parts = [part(64.0, 13.0, 100.0), part(16.0, 200.0, 4000.0), part(1000.0, 210.0, 900.0)];
        let model = CostModel::fit(&parts);
        let found = [model.drone_us, model.frame_us, model.exchange_drone_us, model.exchange_byte_us];
        for (found, wanted) in found.into_iter().zip([2.0, 0.5, 0.1, 0.01]) {
            assert!((found - wanted).abs() < 1e-9, "{model:?}");
        }
        assert!((model.part_us(&parts[0]) - parts[0].work_us - parts[0].exchange_us).abs() < 1e-9);
    }

    #[test]
    fn no_factor_is_negative() {
        let samples = [([10.0, 1.0], 10.0), ([10.0, 5.0], 8.0), ([20.0, 9.0], 17.0)];
        let found = fit(samples.into_iter());
        assert!(found[0] > 0.0 && found[1] == 0.0, "{found:?}");
        assert_eq!(fit([([2.0, 0.0], 4.0)].into_iter()), [2.0, 0.0]);
    }
}
