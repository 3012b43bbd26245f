//! Text of limited length in a field of fixed size.

use bytemuck::{Pod, Zeroable};
use std::fmt;

/// Size of the field, bytes. The last byte is always 0.
pub const TEXT_FIELD: usize = 32;

/// Up to 31 bytes of UTF-8 text, followed by zeros. The bytes may come from another process: everything after the first zero, and
/// text that is not UTF-8, counts as absent.
#[repr(transparent)]
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct ShortText([u8; TEXT_FIELD]);

impl ShortText {
    /// The longest text, bytes.
    pub const MAX: usize = TEXT_FIELD - 1;

    /// The text, unless it is longer than [`ShortText::MAX`] bytes or has a zero byte.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        let mut field = [0; TEXT_FIELD];
        let fits = text.len() <= Self::MAX && !text.as_bytes().contains(&0);
        fits.then(|| {
            field[..text.len()].copy_from_slice(text.as_bytes());
            Self(field)
        })
    }

    /// The text without its control characters, cut to at most [`ShortText::MAX`] bytes.
    #[must_use]
    pub fn cut(text: &str) -> Self {
        let (mut field, mut len) = ([0; TEXT_FIELD], 0);
        for letter in text.chars().filter(|letter| !letter.is_control()) {
            if len + letter.len_utf8() > Self::MAX {
                break;
            }
            len += letter.encode_utf8(&mut field[len..]).len();
        }
        Self(field)
    }

    /// The text; empty if the field does not hold UTF-8.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let len = self.0.iter().position(|&byte| byte == 0).unwrap_or(TEXT_FIELD);
        std::str::from_utf8(&self.0[..len]).unwrap_or_default()
    }

    /// Whether this is the field that [`ShortText::new`] makes of its text, without control characters. A field from another process
    /// can be anything.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        !self.as_str().contains(char::is_control) && Self::new(self.as_str()) == Some(*self)
    }
}

impl fmt::Display for ShortText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for ShortText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_text_that_is_too_long_is_refused_or_cut_at_a_letter() {
        assert_eq!(ShortText::new(&"a".repeat(31)).unwrap().as_str(), "a".repeat(31));
        assert_eq!((ShortText::new(&"a".repeat(32)), ShortText::new("a\0b")), (None, None));
        assert_eq!(ShortText::cut(&"ä".repeat(31)).as_str(), "ä".repeat(15));
        assert_eq!(ShortText::cut("one\ntwo").as_str(), "onetwo");
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(bytes in any::<[u8; TEXT_FIELD]>()) {
            let text: ShortText = bytemuck::cast(bytes);
            prop_assert!(text.as_str().len() <= TEXT_FIELD);
            if text.is_clean() {
                prop_assert_eq!(ShortText::cut(text.as_str()), text);
            }
        }
    }
}
