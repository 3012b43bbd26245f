//! What the world tells the drones in a tick: senses and the air, in one sample.
//!
//! Laid out as a [`DownlinkHeader`], then a [`SensesHeader`] for each drone, then the flat slices those point into, then the
//! shapes of the obstacles somebody senses, then every frame sent in the tick before, and where each was sent.

use crate::Vec2;
use crate::drop_reason::DropReason;
use crate::frame::AirFrame;
use crate::ids::{DroneId, ObstacleId};
use crate::link_faults::LinkFaults;
use crate::nearby::{FrameCell, FrameIndex, Locality, NearbyFrames};
use crate::shape::ConvexShape;
use crate::time::{SimTime, Tick};
use crate::wire::BrokenSensors;
use bytemuck::{Pod, Zeroable};
use thiserror::Error;

/// The sample's head.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DownlinkHeader {
    /// The tick that these senses open.
    pub tick: Tick,
    /// Its time.
    pub now: SimTime,
    /// Number of [`SensesHeader`]s: one for each drone, dead or alive.
    pub drones: u32,
    /// Number of [`SensedObstacle`]s.
    pub obstacles: u32,
    /// Number of [`SensedNeighbour`]s.
    pub neighbours: u32,
    /// Number of [`SensedShape`]s.
    pub shapes: u32,
    /// Number of [`AirFrame`]s.
    pub frames: u32,
    /// Number of [`FrameCell`]s; 0 if the frames are not sorted.
    pub cells: u32,
    /// By what they are sorted.
    pub locality: Locality,
    /// Number of places in the order of frames.
    pub ordered: u32,
    /// Always 0.
    pub reserved: u32,
}

/// One drone's senses: its own state, and where its entries stand in the flat slices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensesHeader {
    /// Own position, world frame, m.
    pub position_m: [f64; 2],
    /// Own velocity, m/s.
    pub velocity_mps: [f64; 2],
    /// First of its obstacles.
    pub obstacle_first: u32,
    /// Number of its obstacles.
    pub obstacle_count: u32,
    /// First of its neighbours.
    pub neighbour_first: u32,
    /// Number of its neighbours.
    pub neighbour_count: u32,
    /// 1 if it flies, 0 if it is dead.
    pub alive: u32,
    /// Incarnation of its process.
    pub incarnation: u32,
    /// Its radio.
    pub link_faults: LinkFaults,
    /// Added to its reaction time, s.
    pub extra_reaction_s: f64,
    /// Which of its sensors report nothing: [`BrokenSensors`].
    pub broken: u32,
    /// Always 0.
    pub reserved: u32,
}

impl SensesHeader {
    /// Why its radio cannot hear a frame at all, if it cannot.
    #[must_use]
    pub fn drop_reason(&self, frame: &AirFrame) -> Option<DropReason> {
        self.link_faults.drop_reason(frame.link_faults)
    }
}

/// An obstacle with a point in a drone's detection range.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensedObstacle {
    /// Nearest point of its surface, world frame, m.
    pub nearest_m: [f64; 2],
    /// Distance to it, m; negative inside.
    pub distance_m: f64,
    /// Its place among the [`SensedShape`]s.
    pub shape: u32,
    /// Always 0.
    pub reserved: u32,
}

/// A neighbour in ranging distance.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensedNeighbour {
    /// Its position less one's own, m.
    pub position_m: [f64; 2],
    /// Its velocity less one's own, m/s.
    pub velocity_mps: [f64; 2],
    /// Who it is.
    pub drone: DroneId,
    /// Always 0.
    pub reserved: u32,
}

/// The outline of a sensed obstacle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SensedShape {
    /// The outline, world frame.
    pub shape: ConvexShape,
    /// The world's number for the obstacle.
    pub id: ObstacleId,
    /// Always 0.
    pub reserved: u32,
}

/// A downlink as the world builds it, tick after tick in the same memory.
#[derive(Clone, Debug, Default)]
pub struct Downlink {
    /// Tick, time; the counts are set by [`Downlink::seal`].
    pub head: DownlinkHeader,
    /// One for each drone.
    pub drones: Vec<SensesHeader>,
    /// Flat, in drone order.
    pub obstacles: Vec<SensedObstacle>,
    /// Flat, in drone order.
    pub neighbours: Vec<SensedNeighbour>,
    /// Those that somebody senses.
    pub shapes: Vec<SensedShape>,
    /// Every frame sent in the tick before, by source and sequence.
    pub frames: Vec<AirFrame>,
    /// Where they were sent.
    pub index: FrameIndex,
}

/// Why a sample is not a downlink.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the downlink of {bytes} bytes does not hold what its head announces")]
pub struct DownlinkError {
    /// Size of the sample.
    pub bytes: usize,
}

impl Downlink {
    /// Sets the head's counts.
    pub fn seal(&mut self, tick: Tick, now: SimTime) {
        self.head = DownlinkHeader {
            tick,
            now,
            drones: self.drones.len() as u32,
            obstacles: self.obstacles.len() as u32,
            neighbours: self.neighbours.len() as u32,
            shapes: self.shapes.len() as u32,
            frames: self.frames.len() as u32,
            cells: self.index.cells.len() as u32,
            locality: self.index.locality,
            ordered: self.index.order.len() as u32,
            reserved: 0,
        };
    }

    /// Borrowed, for readers in the same process.
    #[must_use]
    pub fn view(&self) -> DownlinkView<'_> {
        DownlinkView {
            head: &self.head,
            drones: &self.drones,
            obstacles: &self.obstacles,
            neighbours: &self.neighbours,
            shapes: &self.shapes,
            frames: &self.frames,
            nearby: self.index.view(),
        }
    }

    /// Bytes that [`Downlink::write_to`] needs.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        self.parts().iter().map(|part| part.len()).sum()
    }

    /// Writes the sample; `out` must be at least [`Downlink::byte_len`] long.
    pub fn write_to(&self, out: &mut [u8]) {
        let mut at = 0;
        for part in self.parts() {
            out[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
    }

    fn parts(&self) -> [&[u8]; 8] {
        [
            bytemuck::bytes_of(&self.head),
            bytemuck::cast_slice(&self.drones),
            bytemuck::cast_slice(&self.obstacles),
            bytemuck::cast_slice(&self.neighbours),
            bytemuck::cast_slice(&self.shapes),
            bytemuck::cast_slice(&self.frames),
            bytemuck::cast_slice(&self.index.cells),
            bytemuck::cast_slice(&self.index.order),
        ]
    }
}

/// A downlink as a drone reads it, in place.
#[derive(Clone, Copy, Debug)]
pub struct DownlinkView<'a> {
    /// Tick, time and counts.
    pub head: &'a DownlinkHeader,
    /// One for each drone.
    pub drones: &'a [SensesHeader],
    /// Flat.
    pub obstacles: &'a [SensedObstacle],
    /// Flat.
    pub neighbours: &'a [SensedNeighbour],
    /// Those that somebody senses.
    pub shapes: &'a [SensedShape],
    /// Every frame sent in the tick before, by source and sequence.
    pub frames: &'a [AirFrame],
    /// Where they were sent.
    pub nearby: NearbyFrames<'a>,
}

impl<'a> DownlinkView<'a> {
    /// Reads a sample in place. `bytes` must be 8-aligned.
    ///
    /// # Errors
    /// [`DownlinkError`] if the sample is too short for its head, or not aligned.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, DownlinkError> {
        let error = DownlinkError { bytes: bytes.len() };
        let (head, mut rest) = bytes.split_at_checked(size_of::<DownlinkHeader>()).ok_or(error)?;
        let head: &DownlinkHeader = bytemuck::try_from_bytes(head).map_err(|_| error)?;
        Ok(Self {
            drones: take(&mut rest, head.drones, error)?,
            obstacles: take(&mut rest, head.obstacles, error)?,
            neighbours: take(&mut rest, head.neighbours, error)?,
            shapes: take(&mut rest, head.shapes, error)?,
            frames: take(&mut rest, head.frames, error)?,
            nearby: NearbyFrames {
                locality: head.locality,
                cells: take::<FrameCell>(&mut rest, head.cells, error)?,
                order: take(&mut rest, head.ordered, error)?,
            },
            head,
        })
    }

    /// What one drone senses; `None` for a drone that is not in the swarm.
    #[must_use]
    pub fn senses(&self, drone: DroneId) -> Option<Senses<'a>> {
        let head = self.drones.get(drone.index())?;
        Some(Senses {
            now: self.head.now,
            tick: self.head.tick,
            position: Vec2::from(head.position_m),
            velocity: Vec2::from(head.velocity_mps),
            extra_reaction_s: head.extra_reaction_s,
            broken: BrokenSensors::from_wire(head.broken),
            obstacles: range(self.obstacles, head.obstacle_first, head.obstacle_count),
            neighbours: range(self.neighbours, head.neighbour_first, head.neighbour_count),
            shapes: self.shapes,
        })
    }
}

/// What one drone senses in one tick.
#[derive(Clone, Copy, Debug)]
pub struct Senses<'a> {
    /// Time of the tick.
    pub now: SimTime,
    /// The tick.
    pub tick: Tick,
    /// Own position, m.
    pub position: Vec2,
    /// Own velocity, m/s.
    pub velocity: Vec2,
    /// Added to its reaction time, s.
    pub extra_reaction_s: f64,
    /// Which of its sensors report nothing.
    pub broken: BrokenSensors,
    /// Obstacles with a point in detection range.
    pub obstacles: &'a [SensedObstacle],
    /// Neighbours in ranging distance.
    pub neighbours: &'a [SensedNeighbour],
    shapes: &'a [SensedShape],
}

impl<'a> Senses<'a> {
    /// Senses made by hand: for tests, and for simulating ahead.
    #[must_use]
    pub fn new(
        (tick, now): (Tick, SimTime),
        (position, velocity): (Vec2, Vec2),
        obstacles: &'a [SensedObstacle],
        neighbours: &'a [SensedNeighbour],
        shapes: &'a [SensedShape],
    ) -> Self {
        Self {
            now,
            tick,
            position,
            velocity,
            extra_reaction_s: 0.0,
            broken: BrokenSensors::default(),
            obstacles,
            neighbours,
            shapes,
        }
    }

    /// The same senses as they will be at another time and place: for looking ahead.
    #[must_use]
    pub fn at<'b>(
        &self,
        now: SimTime,
        (position, velocity): (Vec2, Vec2),
        obstacles: &'b [SensedObstacle],
        neighbours: &'b [SensedNeighbour],
    ) -> Senses<'b>
    where
        'a: 'b,
    {
        Senses { now, position, velocity, obstacles, neighbours, ..*self }
    }

    /// The outline of a sensed obstacle; `None` if the entry points nowhere.
    #[must_use]
    pub fn shape(&self, obstacle: &SensedObstacle) -> Option<&'a SensedShape> {
        self.shapes.get(obstacle.shape as usize)
    }
}

fn take<'a, T: Pod>(rest: &mut &'a [u8], count: u32, error: DownlinkError) -> Result<&'a [T], DownlinkError> {
    let (part, tail) = rest.split_at_checked(count as usize * size_of::<T>()).ok_or(error)?;
    *rest = tail;
    bytemuck::try_cast_slice(part).map_err(|_| error)
}

fn range<T>(all: &[T], first: u32, count: u32) -> &[T] {
    all.get(first as usize..first as usize + count as usize).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_read_in_place() {
        let mut down = Downlink::default();
        down.drones.push(SensesHeader { neighbour_count: 1, position_m: [1.0, 2.0], ..SensesHeader::default() });
        down.neighbours.push(SensedNeighbour { drone: DroneId(5), ..SensedNeighbour::default() });
        down.seal(3, SimTime(60));
        let mut words = vec![0u64; down.byte_len().div_ceil(8)];
        down.write_to(bytemuck::cast_slice_mut(&mut words));
        let view = DownlinkView::parse(bytemuck::cast_slice(&words)).unwrap();
        let senses = view.senses(DroneId(0)).unwrap();
        assert_eq!(senses.position, Vec2::new(1.0, 2.0));
        assert_eq!(senses.neighbours[0].drone, DroneId(5));
        assert_eq!((view.head.tick, view.head.now), (3, SimTime(60)));
        assert!(view.senses(DroneId(1)).is_none());
    }

    #[test]
    fn a_short_sample_is_refused() {
        let mut down = Downlink::default();
        down.drones.push(SensesHeader::default());
        down.seal(0, SimTime::ZERO);
        let mut words = vec![0u64; down.byte_len().div_ceil(8)];
        down.write_to(bytemuck::cast_slice_mut(&mut words));
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        assert!(DownlinkView::parse(&bytes[..bytes.len() - 8]).is_err());
        assert!(DownlinkView::parse(&[]).is_err());
    }
}
