//! Sends a plain value as the words that differ from the value sent before.

use crate::error::HostsError;
use crate::reader::Reader;
use bytemuck::{NoUninit, Pod};

/// Appends the number of the words of `new` that differ from `old`, then each of them with its place. Both ends begin with the same
/// value.
pub(crate) fn write<T: NoUninit>(old: &T, new: &T, out: &mut Vec<u8>) {
    let at = out.len();
    out.extend([0; 4]);
    let words = |value| bytemuck::cast_slice::<u8, u32>(bytemuck::bytes_of::<T>(value));
    let mut count = 0_u32;
    for (place, (_, new)) in words(old).iter().zip(words(new)).enumerate().filter(|(_, (old, new))| old != new) {
        out.extend((place as u32).to_le_bytes());
        out.extend(new.to_le_bytes());
        count += 1;
    }
    out[at..at + 4].copy_from_slice(&count.to_le_bytes());
}

/// Changes `value` to what the other end wrote.
///
/// # Errors
/// [`HostsError::Message`] if the bytes end too early, or a place is none of the value.
pub(crate) fn read<T: Pod>(value: &mut T, reader: &mut Reader<'_>) -> Result<(), HostsError> {
    let words = bytemuck::cast_slice_mut::<u8, u32>(bytemuck::bytes_of_mut(value));
    for _ in 0..reader.value::<u32>()? {
        let [place, word] = reader.value::<[u32; 2]>()?;
        *words.get_mut(place as usize).ok_or(HostsError::Message("a word has no place in its value"))? = word;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::slot::LinkStats;

    #[test]
    fn the_other_end_has_the_same_value() {
        let (mut sent, mut got) = (LinkStats::default(), LinkStats::default());
        for delay in [3, 3, 700, 4] {
            let old = sent;
            sent.delay(delay);
            let mut bytes = Vec::new();
            write(&old, &sent, &mut bytes);
            assert!(bytes.len() < 64, "{}", bytes.len());
            read(&mut got, &mut Reader(&bytes)).unwrap();
            assert_eq!(got, sent);
        }
    }

    #[test]
    fn a_word_outside_of_the_value_is_refused() {
        let bytes: Vec<u8> = [1_u32, u32::MAX, 7].iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut value = LinkStats::default();
        assert!(read(&mut value, &mut Reader(&bytes)).is_err());
        assert!(read(&mut value, &mut Reader(&bytes[..8])).is_err());
        assert_eq!(value, LinkStats::default());
    }
}
