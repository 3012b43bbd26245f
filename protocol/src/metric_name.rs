//! The name of a figure that a pilot reports.

use crate::short_text::ShortText;
use bytemuck::{Pod, Zeroable};
use std::fmt;
use thiserror::Error;

/// The name of a figure that a pilot reports: 1 to 31 characters from `a-z A-Z 0-9 _ - . /`. It is a part of column and key names.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct MetricName(ShortText);

/// A text that cannot name a figure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the metric name {0:?} is not 1 to 31 characters from a-z A-Z 0-9 _ - . /")]
pub struct MetricNameError(String);

impl MetricName {
    /// The figure of this name.
    ///
    /// # Errors
    /// [`MetricNameError`] if the text cannot name a figure.
    pub fn new(name: &str) -> Result<Self, MetricNameError> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"_-./".contains(&byte);
        let text = ShortText::new(name).filter(|_| !name.is_empty() && name.bytes().all(allowed));
        text.map(Self).ok_or_else(|| MetricNameError(name.to_owned()))
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }
}

impl TryFrom<ShortText> for MetricName {
    type Error = MetricNameError;

    fn try_from(text: ShortText) -> Result<Self, MetricNameError> {
        let name = Self::new(text.as_str())?;
        if name.0 == text { Ok(name) } else { Err(MetricNameError(text.as_str().to_owned())) }
    }
}

impl From<MetricName> for ShortText {
    fn from(name: MetricName) -> Self {
        name.0
    }
}

impl fmt::Display for MetricName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Debug for MetricName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_refused_for_its_length_or_its_letters() {
        assert_eq!(MetricName::new("Phi_corr/2.a-b").unwrap().as_str(), "Phi_corr/2.a-b");
        for wrong in ["", "a,b", "a\"", "φ", &"a".repeat(32)] {
            assert!(MetricName::new(wrong).is_err(), "{wrong}");
        }
    }
}
