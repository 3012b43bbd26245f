//! The part of a downlink that the drones of one host read. The senses of all others are left out.

use crate::error::HostsError;
use crate::reader::Reader;
use skein_protocol::downlink::{DownlinkHeader, DownlinkView, SensedNeighbour, SensedObstacle, SensesHeader};
use std::ops::Range;

/// Appends the part of the drones with these numbers.
pub(crate) fn write(down: &DownlinkView<'_>, drones: Range<usize>, out: &mut Vec<u8>) {
    let own = down.drones.get(drones).unwrap_or_default();
    let (mut obstacles, mut neighbours) = (Vec::new(), Vec::new());
    let mut heads = own.to_vec();
    for head in &mut heads {
        head.obstacle_first = take(down.obstacles, (head.obstacle_first, &mut head.obstacle_count), &mut obstacles);
        head.neighbour_first =
            take(down.neighbours, (head.neighbour_first, &mut head.neighbour_count), &mut neighbours);
    }
    let head = DownlinkHeader { obstacles: obstacles.len() as u32, neighbours: neighbours.len() as u32, ..*down.head };
    out.extend(bytemuck::bytes_of(&head));
    out.extend(bytemuck::cast_slice::<SensesHeader, u8>(&heads));
    out.extend(bytemuck::cast_slice::<SensedObstacle, u8>(&obstacles));
    out.extend(bytemuck::cast_slice::<SensedNeighbour, u8>(&neighbours));
    out.extend(bytemuck::cast_slice::<_, u8>(down.shapes));
    out.extend(bytemuck::cast_slice::<_, u8>(down.frames));
    out.extend(bytemuck::cast_slice::<_, u8>(down.nearby.cells));
    out.extend(bytemuck::cast_slice::<_, u8>(down.nearby.order));
}

/// Copies a drone's entries behind those of the drones before it, and returns where they begin. A range that exceeds the sample
/// counts as empty, as for a drone that reads it.
fn take<T: Copy>(all: &[T], (first, count): (u32, &mut u32), part: &mut Vec<T>) -> u32 {
    let begin = part.len() as u32;
    let entries = all.get(first as usize..first as usize + *count as usize).unwrap_or_default();
    *count = entries.len() as u32;
    part.extend_from_slice(entries);
    begin
}

/// Makes a downlink of a whole swarm of `count` drones from the part of these drones. The others sense nothing in it.
///
/// # Errors
/// [`HostsError`] if the bytes are no part of such a downlink.
pub(crate) fn read(bytes: &[u8], drones: Range<usize>, count: usize) -> Result<Vec<u64>, HostsError> {
    let mut reader = Reader(bytes);
    let head: DownlinkHeader = reader.value()?;
    if head.drones as usize != count {
        return Err(HostsError::Message("a downlink has another number of drones"));
    }
    let own = reader.bytes(drones.len() * size_of::<SensesHeader>())?;
    let left_out = (count - drones.len()) * size_of::<SensesHeader>();
    let mut words = vec![0_u64; (bytes.len() + left_out).div_ceil(size_of::<u64>())];
    let out: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    let heads = size_of::<DownlinkHeader>();
    out[..heads].copy_from_slice(bytemuck::bytes_of(&head));
    let first = heads + drones.start * size_of::<SensesHeader>();
    out[first..first + own.len()].copy_from_slice(own);
    let rest = heads + count * size_of::<SensesHeader>();
    out[rest..rest + reader.0.len()].copy_from_slice(reader.0);
    // Without the padding of the last word, so that nothing that is missing is taken for zeros.
    DownlinkView::parse(&bytemuck::cast_slice(&words)[..bytes.len() + left_out])?;
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::downlink::Downlink;
    use skein_protocol::{DroneId, SimTime};

    fn downlink() -> Downlink {
        let mut down = Downlink::default();
        for drone in 0..4_u32 {
            let neighbour_first = down.neighbours.len() as u32;
            for other in (0..4).filter(|other| *other != drone) {
                down.neighbours.push(SensedNeighbour { drone: DroneId(other), ..SensedNeighbour::default() });
            }
            down.obstacles.push(SensedObstacle { distance_m: f64::from(drone), ..SensedObstacle::default() });
            down.drones.push(SensesHeader {
                position_m: [f64::from(drone), 0.0, 0.0],
                neighbour_first,
                neighbour_count: 3,
                obstacle_first: drone,
                obstacle_count: 1,
                ..SensesHeader::default()
            });
        }
        down.seal(9, SimTime(180));
        down
    }

    #[test]
    fn the_drones_of_the_part_sense_the_same() {
        let down = downlink();
        let mut bytes = Vec::new();
        write(&down.view(), 1..3, &mut bytes);
        assert!(bytes.len() < down.byte_len());
        let words = read(&bytes, 1..3, 4).unwrap();
        let (whole, part) = (down.view(), DownlinkView::parse(bytemuck::cast_slice(&words)).unwrap());
        assert_eq!((part.head.tick, part.head.now, part.drones.len()), (9, SimTime(180), 4));
        for drone in [1, 2].map(DroneId) {
            let (was, is) = (whole.senses(drone).unwrap(), part.senses(drone).unwrap());
            assert_eq!((was.position_m, was.neighbours, was.obstacles), (is.position_m, is.neighbours, is.obstacles));
        }
        assert!(part.senses(DroneId(0)).unwrap().neighbours.is_empty());
    }

    #[test]
    fn what_is_no_part_is_refused() {
        let mut bytes = Vec::new();
        write(&downlink().view(), 1..3, &mut bytes);
        assert!(read(&bytes, 1..3, 5).is_err());
        for len in 0..bytes.len() {
            assert!(read(&bytes[..len], 1..3, 4).is_err(), "{len}");
        }
    }
}
