//! Which side of each partition a drone is on, and whether its radio works: what cuts the air by script.

use crate::drop_reason::DropReason;
use bytemuck::{Pod, Zeroable};

/// Partitions that can be told apart.
pub const MAX_PARTITIONS: usize = 8;
/// Sides that a partition may have.
pub const MAX_SIDES: usize = 15;

/// Bits of one partition.
const WIDTH: usize = 4;

/// A drone's side in each partition that is in force: four bits a partition, its side plus 1, or 0 if it is on none.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PartitionMask(pub u32);

impl PartitionMask {
    /// Puts the drone on a side of a partition, where it was on none. Numbers from 0, below [`MAX_PARTITIONS`] and
    /// [`MAX_SIDES`]; others are no side.
    pub fn join(&mut self, partition: usize, side: usize) {
        if partition < MAX_PARTITIONS && side < MAX_SIDES {
            self.0 |= (side as u32 + 1) << (partition * WIDTH);
        }
    }

    /// Whether a partition has both on sides, and on different ones.
    #[must_use]
    pub fn separates(self, other: Self) -> bool {
        (0..MAX_PARTITIONS).any(|partition| {
            let side = |sides: Self| sides.0 >> (partition * WIDTH) & ((1 << WIDTH) - 1);
            let (here, there) = (side(self), side(other));
            here != 0 && there != 0 && here != there
        })
    }
}

/// A drone's radio as faults leave it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct LinkFaults {
    /// Its side in each partition.
    pub partitions: PartitionMask,
    /// 1 if nobody hears it.
    pub mute: u16,
    /// 1 if it hears nobody.
    pub deaf: u16,
}

impl LinkFaults {
    /// Why a drone with this radio cannot hear a frame that was sent with `sender`'s, if it cannot.
    #[must_use]
    pub fn drop_reason(self, sender: Self) -> Option<DropReason> {
        if self.deaf != 0 || sender.mute != 0 {
            return Some(DropReason::Deaf);
        }
        self.partitions.separates(sender.partitions).then_some(DropReason::Partition)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(places: &[(usize, usize)]) -> PartitionMask {
        let mut sides = PartitionMask::default();
        places.iter().for_each(|&(partition, side)| sides.join(partition, side));
        sides
    }

    #[test]
    fn only_known_and_different_sides_are_apart() {
        assert!(on(&[(0, 0)]).separates(on(&[(0, 1)])));
        assert!(!on(&[(0, 1)]).separates(on(&[(0, 1)])));
        assert!(!on(&[(0, 0)]).separates(on(&[])), "on no side it hears all");
        assert!(!on(&[(0, 0)]).separates(on(&[(1, 1)])), "two partitions do not mix");
        assert!(on(&[(0, 0), (7, 14)]).separates(on(&[(0, 0), (7, 13)])));
    }

    #[test]
    fn numbers_out_of_range_are_no_side() {
        assert_eq!(on(&[(8, 0), (0, 15)]), PartitionMask::default());
    }
}
