//! Which version of Skein a program is built with.

use std::fmt;

/// Raised with every change of the control segment's layout, of `Slot` or of `LinkStats`.
const LAYOUT: u16 = 8;

/// What the programs of one run must have in common: the version of Skein that they are built with, and the versions of what they
/// share. A patch release changes none of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// First number of the crates' version.
    pub major: u16,
    /// Second number of the crates' version.
    pub minor: u16,
    /// Version of the messages' layouts, [`skein_protocol::payload::VERSION`].
    pub wire: u16,
    /// Version of the control segment's layout.
    pub layout: u16,
}

impl Version {
    /// The version of this program.
    pub const OWN: Self = Self {
        major: number(env!("CARGO_PKG_VERSION_MAJOR")),
        minor: number(env!("CARGO_PKG_VERSION_MINOR")),
        wire: skein_protocol::payload::VERSION,
        layout: LAYOUT,
    };

    /// The version in one word, which is not 0.
    pub(crate) fn word(self) -> u64 {
        [self.major, self.minor, self.wire, self.layout].iter().fold(0, |word, &part| word << 16 | u64::from(part))
    }

    /// The version that a word stands for.
    pub(crate) fn of_word(word: u64) -> Self {
        let part = |place: u32| (word >> (16 * place)) as u16;
        Self { major: part(3), minor: part(2), wire: part(1), layout: part(0) }
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { major, minor, wire, layout } = self;
        write!(f, "Skein {major}.{minor} (messages of version {wire}, control segment of version {layout})")
    }
}

const fn number(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version number of Cargo is too large"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_stands_for_its_version() {
        let version = Version { major: 1, minor: 20, wire: 300, layout: 4 };
        assert_eq!(Version::of_word(version.word()), version);
        assert_eq!(version.word(), 0x0001_0014_012c_0004);
        assert!(Version::OWN.word() > 0 && Version::OWN.layout > 0);
    }
}
