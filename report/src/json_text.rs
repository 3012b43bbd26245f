//! Values as JSON, as the files of a run hold them.

use serde::Serialize;

/// A value as JSON that ends with a line feed.
pub(crate) fn json(value: &impl Serialize) -> std::io::Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    Ok(bytes)
}
