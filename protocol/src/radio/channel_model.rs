//! What the air does to one frame at one receiver: its delay, its loss, its range, its copies.

use super::burst::Burst;
use super::key::KeyedRng;
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// What the air does to a frame. The default is ideal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelModel {
    /// Time on the air; a frame takes at least one tick.
    pub delay: Delay,
    /// Probability that a receiver does not hear a frame, 0 to 1, independent for each (Bernoulli).
    pub loss: f64,
    /// Losses that come together; `None`: there are none.
    pub burst: Option<Burst>,
    /// How far a frame is heard; `None`: everywhere.
    pub range: Option<Range>,
    /// Probability that a frame that is heard is heard a second time, 0 to 1.
    pub duplicate: f64,
}

impl ChannelModel {
    /// No frame is heard from farther away, m; infinite unless the range is a hard limit.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.range.filter(|range| range.shadowing_db <= 0.0).map_or(f64::INFINITY, |range| range.half_m)
    }
}

/// How a delay is distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DelayModel {
    /// Always its mean.
    #[default]
    Fixed,
    /// All values within √3 deviations of the mean alike.
    Uniform,
    /// Normal, of the part that is not negative: mean and deviation are those before that cut.
    Normal,
    /// Gamma: never negative, a long tail.
    Gamma,
}

/// Time on the air.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Delay {
    /// Its distribution.
    pub model: DelayModel,
    /// Its mean, s.
    pub mean_s: f64,
    /// Its standard deviation, s.
    pub jitter_s: f64,
}

impl Delay {
    /// A delay, s; never negative. Nothing is drawn where nothing varies.
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
    /// Distance at which half of all frames are heard, m; without shadowing none is beyond it, and all are within.
    pub half_m: f64,
    /// Standard deviation of the shadowing, dB, drawn anew for each frame; 0: a hard limit.
    pub shadowing_db: f64,
    /// Exponent of the path loss: 2 in free space, dimensionless.
    pub exponent: f64,
}

impl Range {
    /// The share of frames heard over the square root of `square_m2`: Q(10 n log10(d/R) / σ).
    #[must_use]
    pub fn heard(&self, square_m2: f64) -> f64 {
        let square = self.half_m * self.half_m;
        if self.shadowing_db <= 0.0 {
            return if square_m2 > square { 0.0 } else { 1.0 };
        }
        let missing_db = 5.0 * self.exponent * libm::log10(square_m2 / square);
        0.5 * libm::erfc(missing_db / (self.shadowing_db * SQRT_2))
    }
}
