//! The caller's wish to stop while files are written.

use crate::error::ReportError;

/// Asked again and again while files are read and written: whether to stop. The files are then written by the next
/// `skein report`.
pub struct Interrupted<'a>(&'a (dyn Fn() -> bool + Sync));

impl<'a> Interrupted<'a> {
    /// Stops as soon as this returns true.
    #[must_use]
    pub fn when(stop: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(stop)
    }

    /// Never stops.
    #[must_use]
    pub fn never() -> Self {
        Self(&|| false)
    }

    /// # Errors
    /// [`ReportError::Interrupted`].
    pub(crate) fn check(&self) -> Result<(), ReportError> {
        if (self.0)() { Err(ReportError::Interrupted) } else { Ok(()) }
    }
}
