//! Statistics of histograms with bins of equal width.

use crate::record::Percentiles;

/// Mean, quantiles and maximum of a histogram of times, s; all `None` if the histogram is empty.
///
/// Bin number `i` counts the values of `i` bin widths; a bin is `width_s` wide (s). The last bin also counts all greater values,
/// so each value in it is taken as the maximum. `max` is the maximum, in bin widths. Quantiles are by the nearest-rank method.
#[must_use]
pub fn percentiles(bins: &[u64], max: u64, width_s: f64) -> Percentiles {
    let count: u64 = bins.iter().sum();
    if count == 0 {
        return Percentiles::default();
    }
    let steps = |bin: usize| if bin + 1 == bins.len() { max as f64 } else { bin as f64 };
    let mean = bins.iter().enumerate().map(|(bin, &n)| steps(bin) * n as f64).sum::<f64>() / count as f64;
    let quantile = |fraction: f64| {
        let rank = (fraction * count as f64).ceil() as u64;
        let mut seen = 0;
        let reached = bins.iter().position(|&n| {
            seen += n;
            seen >= rank
        });
        steps(reached.unwrap_or(bins.len() - 1)) * width_s
    };
    Percentiles {
        mean: Some(mean * width_s),
        p50: Some(quantile(0.5)),
        p99: Some(quantile(0.99)),
        max: Some(max as f64 * width_s),
    }
}
