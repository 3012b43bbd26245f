//! Colour scales of heat maps.

/// The colour at a place of a scale, from 0 (its first colour) to 1 (its last), as red, green and blue from 0 to 255.
pub(super) fn interpolated(scale: &[[f64; 3]], place: f64) -> [f64; 3] {
    let place = place.clamp(0.0, 1.0) * (scale.len() - 1) as f64;
    let below = (place.floor() as usize).min(scale.len() - 2);
    let (from, to, part) = (scale[below], scale[below + 1], place - below as f64);
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * part)
}

/// Black or white, whichever is readable on this colour, as a colour of SVG.
pub(super) fn ink_on([r, g, b]: [f64; 3]) -> &'static str {
    if 0.3 * r + 0.59 * g + 0.11 * b > 125.0 { "#000" } else { "#fff" }
}

/// The least and the greatest of some values; (∞, −∞) without values.
pub(super) fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}
