//! Reads what came over the network, piece by piece.

use crate::error::HostsError;
use bytemuck::AnyBitPattern;

/// The bytes that are not yet read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

impl<'a> Reader<'a> {
    /// The next `len` bytes.
    pub(crate) fn bytes(&mut self, len: usize) -> Result<&'a [u8], HostsError> {
        let (part, rest) = self.0.split_at_checked(len).ok_or(HostsError::Message("it ends too early"))?;
        self.0 = rest;
        Ok(part)
    }

    /// The next value, whatever the alignment of the bytes.
    pub(crate) fn value<T: AnyBitPattern>(&mut self) -> Result<T, HostsError> {
        Ok(bytemuck::pod_read_unaligned(self.bytes(size_of::<T>())?))
    }

    /// A number of bytes or of parts that this process can have.
    pub(crate) fn count(&mut self) -> Result<usize, HostsError> {
        usize::try_from(self.value::<u64>()?).map_err(|_| HostsError::Message("it has a length that is too great"))
    }
}
