//! Radio faults that the scenario prescribes: partitions of the swarm, mute radios and deaf radios.

use crate::drop_reason::DropReason;
use bytemuck::{Pod, Zeroable};

/// Maximum number of partitions in a scenario.
pub const MAX_PARTITIONS: usize = 8;
/// Maximum number of sides of one partition.
pub const MAX_SIDES: usize = 15;

/// Number of bits per partition in the mask.
const WIDTH: usize = 4;

/// The side on which a drone is in each partition. Each partition has four bits, partition 0 the lowest: 0 if the drone is on
/// none of its sides, else the number of the side plus 1.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PartitionMask(pub u32);

impl PartitionMask {
    /// Puts the drone on a side of a partition. The drone must not be on a side of this partition yet. Both numbers start at
    /// 0; the call has no effect unless they are below [`MAX_PARTITIONS`] and [`MAX_SIDES`].
    pub fn join(&mut self, partition: usize, side: usize) {
        if partition < MAX_PARTITIONS && side < MAX_SIDES {
            self.0 |= (side as u32 + 1) << (partition * WIDTH);
        }
    }

    /// Whether at least one partition has the two drones on different sides. A drone on no side of a partition is not separated
    /// by it.
    #[must_use]
    pub fn separates(self, other: Self) -> bool {
        // Without this, a swarm that was never parted would compare all sides for each frame.
        if self.0 == 0 || other.0 == 0 {
            return false;
        }
        (0..MAX_PARTITIONS).any(|partition| {
            let side = |mask: Self| mask.0 >> (partition * WIDTH) & ((1 << WIDTH) - 1);
            let (here, there) = (side(self), side(other));
            here != 0 && there != 0 && here != there
        })
    }
}

/// The faults of a drone's radio. The default is a radio without faults.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct LinkFaults {
    /// The drone's side in each partition.
    pub partitions: PartitionMask,
    /// 1 if no drone can hear this drone, else 0.
    pub mute: u16,
    /// 1 if this drone can hear no other drone, else 0.
    pub deaf: u16,
}

impl LinkFaults {
    /// Why a drone with this radio cannot hear a drone with the radio `sender`; `None` if these faults do not prevent it.
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

    fn mask(places: &[(usize, usize)]) -> PartitionMask {
        let mut mask = PartitionMask::default();
        places.iter().for_each(|&(partition, side)| mask.join(partition, side));
        mask
    }

    #[test]
    fn only_different_sides_of_one_partition_are_separated() {
        assert!(mask(&[(0, 0)]).separates(mask(&[(0, 1)])));
        assert!(!mask(&[(0, 1)]).separates(mask(&[(0, 1)])));
        assert!(!mask(&[(0, 0)]).separates(mask(&[])), "a drone on no side hears all drones");
        assert!(!mask(&[(0, 0)]).separates(mask(&[(1, 1)])), "sides of different partitions are not compared");
        assert!(mask(&[(0, 0), (7, 14)]).separates(mask(&[(0, 0), (7, 13)])));
    }

    #[test]
    fn numbers_out_of_range_have_no_effect() {
        assert_eq!(mask(&[(8, 0), (0, 15)]), PartitionMask::default());
    }
}
