//! Rounding of what is drawn.

/// The value rounded to thousandths: a picture needs no more, and the JSON text stays short.
pub(crate) fn rounded(value: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (value * 1e3).round() / 1e3 + 0.0
}
