//! Numbers for people: without the residue that floating-point arithmetic leaves.

/// Share of the greatest number beside it at which a number is residue.
const RESIDUE: f64 = 1e-9;
/// A number below this is residue in any unit that Skein or a pilot uses.
const LEAST: f64 = 1e-12;

/// The number without the last two of its seventeen digits, which arithmetic leaves, and without the sign of zero:
/// 0.30000000000000004 gives 0.3, and -0 gives 0. Numbers of up to fifteen digits stay as they are.
#[must_use]
pub fn tidy(value: f64) -> f64 {
    let rounded = format!("{value:.14e}").parse().ok();
    // The greatest numbers stay as they are: rounded, they would be infinite. Adding zero turns -0 into 0.
    rounded.filter(|rounded: &f64| rounded.is_finite()).unwrap_or(value) + 0.0
}

/// The number with four significant digits; digits before the point are all kept. What is tiny beside `scale`, the greatest number
/// that stands beside it, is 0.
#[must_use]
pub fn brief(value: f64, scale: f64) -> String {
    let size = value.abs();
    if size < LEAST || size < RESIDUE * scale.abs() {
        return "0".to_owned();
    }
    if !(1e-4..1e15).contains(&size) {
        let text = format!("{value:.3e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", without_zeros(digits));
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, if size < 1e-3 { 7 } else { 4 });
    without_zeros(&format!("{value:.*}", digits as usize)).to_owned()
}

/// The number as an axis needs it that shows a range of this width.
#[must_use]
pub fn on_axis(value: f64, width: f64) -> String {
    let digits = 4 - width.abs().log10().floor().clamp(-12.0, 4.0) as i32;
    without_zeros(&fixed(value, digits as usize)).to_owned()
}

/// The number with so many digits after the point, and without the sign of zero.
#[must_use]
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    text.strip_prefix('-').filter(|_| is_zero).map_or_else(|| text.clone(), str::to_owned)
}

fn without_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residue_is_dropped_and_numbers_are_kept() {
        assert_eq!(
            (tidy(0.1 + 0.2), tidy(-0.0).is_sign_negative(), tidy(1.0 / 3.0)),
            (0.3, false, 0.333_333_333_333_333)
        );
        for kept in [0.1, -2.5e-7, 123_456_789.012_345, 1e300, 9_007_199_254_740.5, 0.02 * 3.0] {
            assert!((tidy(kept) - kept).abs() <= kept.abs() * 1e-14, "{kept}");
        }
        assert_eq!((tidy(0.1), tidy(1e15), tidy(f64::MAX)), (0.1, 1e15, f64::MAX));
        assert!(tidy(f64::NAN).is_nan());
    }

    #[test]
    fn a_number_has_four_digits_and_what_is_tiny_beside_others_is_zero() {
        let alone = [
            (0.0, "0"),
            (-0.0, "0"),
            (50.734_2, "50.73"),
            (54_113.2, "54113"),
            (1.0, "1"),
            (-1.0, "-1"),
            (0.123_456, "0.1235"),
            (0.05, "0.05"),
            (0.1 + 0.2, "0.3"),
            (0.000_45, "0.00045"),
            (2e-6, "2e-6"),
            (-1.2346e-7, "-1.235e-7"),
            (3e20, "3e20"),
            (1e-17, "0"),
        ];
        for (value, text) in alone {
            assert_eq!(brief(value, value), text);
        }
        assert_eq!((brief(-4e-10, 1.0).as_str(), brief(4e-6, 1.0).as_str()), ("0", "4e-6"));
    }

    #[test]
    fn an_axis_has_the_digits_that_its_range_needs() {
        assert_eq!(on_axis(0.1 + 0.2, 1.0), "0.3");
        assert_eq!(on_axis(-1e-17, 1.0), "0");
        assert_eq!(on_axis(2.5e-7, 1e-6), "0.00000025");
        assert_eq!(on_axis(120_000.0, 5e5), "120000");
        assert_eq!((on_axis(3.0, 0.0), on_axis(2e-20, 1e-20)), ("3".to_owned(), "0".to_owned()));
    }

    #[test]
    fn zero_has_no_sign() {
        let texts =
            [(-0.004, 2), (-0.0, 0), (-0.006, 2), (1.0, 1), (-12.0, 0), (-0.4, 0)].map(|(value, n)| fixed(value, n));
        assert_eq!(texts, ["0.00", "0", "-0.01", "1.0", "-12", "0"]);
    }
}
