//! A message of a pilot's own, as another pilot reads it.

/// A message of a pilot's own, as it was received. It is read in place, without a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Note<'a> {
    /// The drone that said it.
    pub from: u32,
    /// The topic under which it was said.
    pub topic: &'a str,
    /// What was said.
    pub bytes: &'a [u8],
}
