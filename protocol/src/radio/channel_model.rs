//! The channel model: delay, loss, range and duplication of one frame at one receiver.

use super::burst::Burst;
use super::key::KeyedRng;
use serde::{Deserialize, Serialize};
use std::f64::consts::{LOG10_2, SQRT_2};

/// How a frame is delayed, lost and duplicated on its way to a receiver. The default is an ideal channel: no loss and no
/// delay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelModel {
    /// Delay from transmission to reception. A receiver hears a frame one tick after it was sent at the earliest.
    pub delay: Delay,
    /// Probability that a receiver does not hear a frame, 0 to 1; independent for each frame and receiver (Bernoulli).
    pub loss: f64,
    /// Burst losses; `None`: there are none.
    pub burst: Option<Burst>,
    /// How far a frame is heard; `None`: at any distance.
    pub range: Option<Range>,
    /// Probability that the receiver hears a frame a second time, given that it hears the frame at all, 0 to 1.
    pub duplicate: f64,
}

impl ChannelModel {
    /// Greatest distance at which a frame is heard, m; infinite unless the range is a hard limit.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.range.filter(|range| range.shadowing_db <= 0.0).map_or(f64::INFINITY, |range| range.half_m)
    }
}

/// The probability distribution of a delay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DelayModel {
    /// The delay always equals its mean.
    #[default]
    Fixed,
    /// Uniform within √3 standard deviations of the mean.
    Uniform,
    /// Normal, truncated to values at or above 0. Mean and standard deviation are those before the truncation.
    Normal,
    /// Gamma: never negative, with a long tail.
    Gamma,
}

/// The delay from transmission to reception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Delay {
    /// Distribution of the delay.
    pub model: DelayModel,
    /// Mean, s.
    pub mean_s: f64,
    /// Standard deviation, s.
    pub jitter_s: f64,
}

impl Delay {
    /// Draws a delay, s; never negative. `draws` is called only if the delay is random.
    pub(super) fn draw(&self, draws: impl FnOnce() -> KeyedRng) -> f64 {
        let Self { model, mean_s, jitter_s } = *self;
        match model {
            DelayModel::Fixed => mean_s,
            _ if jitter_s <= 0.0 => mean_s,
            DelayModel::Uniform => (mean_s + 3f64.sqrt() * jitter_s * (2.0 * draws().unit() - 1.0)).max(0.0),
            DelayModel::Normal => draws().normal_above_zero(mean_s, jitter_s),
            DelayModel::Gamma => {
                // Shape (m/σ)², scale σ²/m.
                let ratio = mean_s / jitter_s;
                if ratio > 0.0 { draws().gamma(ratio * ratio) * jitter_s / ratio } else { 0.0 }
            }
        }
    }
}

/// How far a frame is heard: log-distance path loss with log-normal shadowing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Distance at which half of all frames are heard, m. Without shadowing, all frames are heard up to this distance and
    /// none beyond it.
    pub half_m: f64,
    /// Standard deviation of the shadowing, dB. It is drawn anew for each frame. 0: the range is a hard limit.
    pub shadowing_db: f64,
    /// Exponent of the path loss, dimensionless; 2 in free space.
    pub exponent: f64,
}

impl Range {
    /// Share of frames that are heard at the distance d = √`square_m2`, 0 to 1: Q(10 n log10(d/R) / σ). Here n is
    /// `exponent`, R is `half_m` and σ is `shadowing_db`.
    #[must_use]
    pub fn heard(&self, square_m2: f64) -> f64 {
        let square = self.half_m * self.half_m;
        if self.shadowing_db <= 0.0 {
            return if square_m2 > square { 0.0 } else { 1.0 };
        }
        let missing_db = 5.0 * self.exponent * libm::log10(square_m2 / square);
        0.5 * libm::erfc(missing_db / (self.shadowing_db * SQRT_2))
    }

    /// Whether a frame is heard at the distance √`square_m2`: whether a random number, uniform in [0, 1), is below [`Self::heard`]. Most
    /// receivers are so far away or so near that this needs neither logarithm nor error function. `draw` is called only if the range
    /// is no hard limit.
    pub(super) fn hears(&self, square_m2: f64, draw: impl FnOnce() -> f64) -> bool {
        if self.shadowing_db <= 0.0 {
            return self.heard(square_m2) > 0.0;
        }
        let draw = draw();
        let log2 = log2_bounds(square_m2 / (self.half_m * self.half_m));
        let deviations = |log2: f64| 5.0 * LOG10_2 * self.exponent * log2 / self.shadowing_db;
        match log2.map(|(least, greatest)| (deviations(least), deviations(greatest))) {
            Some((least, _)) if least >= SURE && draw >= UNSURE => false,
            Some((_, greatest)) if greatest <= -SURE && draw < 1.0 - UNSURE => true,
            _ => draw < self.heard(square_m2),
        }
    }
}

/// From this many standard deviations on, at most [`UNSURE`] of all frames differ from the rest: Q(3.72) = 0.9961·10⁻⁴.
const SURE: f64 = 3.72;
/// See [`SURE`].
const UNSURE: f64 = 1e-4;

/// A lower and an upper bound of log2 of a positive normal number. Between two powers of two, the logarithm lies above the chord by at
/// most 0.0861.
fn log2_bounds(number: f64) -> Option<(f64, f64)> {
    if !(number.is_normal() && number > 0.0) {
        return None;
    }
    let bits = number.to_bits();
    let fraction = f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52)) - 1.0;
    let chord = (bits >> 52) as f64 - 1023.0 + fraction;
    Some((chord, chord + 0.0861))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: ProptestConfig::default().cases.max(5000), failure_persistence: None, ..ProptestConfig::default()
        })]

        #[test]
        fn a_frame_is_heard_if_the_number_is_below_the_share(
            half_m in 1.0..1e5f64, shadowing_db in 0.01..30.0f64, exponent in 0.5..8.0f64, deviations in -6.0..6.0f64,
            draw in 0.0..1.0f64,
        ) {
            let range = Range { half_m, shadowing_db, exponent };
            let square_m2 = (half_m * libm::pow(10.0, deviations * shadowing_db / (10.0 * exponent))).powi(2);
            let heard = range.heard(square_m2);
            for draw in [draw, heard * (1.0 - 1e-9), heard * (1.0 + 1e-9)] {
                prop_assert_eq!(range.hears(square_m2, || draw), draw < heard);
            }
        }
    }

    #[test]
    fn odd_distances_are_answered_as_the_share_says() {
        for shadowing_db in [0.0, 4.0] {
            let range = Range { half_m: 300.0, shadowing_db, exponent: 3.0 };
            for square_m2 in [0.0, f64::MIN_POSITIVE / 4.0, f64::MAX, f64::INFINITY, f64::NAN] {
                for draw in [0.0, 0.5, 0.999_999] {
                    assert_eq!(range.hears(square_m2, || draw), draw < range.heard(square_m2), "{square_m2} {draw}");
                }
            }
        }
    }
}
