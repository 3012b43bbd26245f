//! The data that the world sends to all drones in a tick: what their sensors report, and the frames on the radio channel.
//!
//! All of it is in one sample, in this order:
//!
//! 1. a [`DownlinkHeader`];
//! 2. one [`SensesHeader`] per drone;
//! 3. the [`SensedObstacle`]s, then the [`SensedNeighbour`]s, of all drones; each [`SensesHeader`] gives a range of each;
//! 4. one [`SensedShape`] per obstacle that at least one drone senses;
//! 5. one [`AirFrame`] per frame that was sent in the previous tick;
//! 6. the index of the frames by the place of sending: its [`FrameCell`]s, then the order of the frames.

use crate::Vec2;
use crate::drop_reason::DropReason;
use crate::frame::AirFrame;
use crate::ids::{DroneId, ObstacleId};
use crate::link_faults::LinkFaults;
use crate::nearby::{FrameCell, FrameIndex, Locality, NearbyFrames};
use crate::shape::ConvexShape;
use crate::space::horizontal;
use crate::time::{SimTime, Tick};
use crate::wire::BrokenSensors;
use bytemuck::{Pod, Zeroable};
use thiserror::Error;

/// The header of the sample.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DownlinkHeader {
    /// The tick that begins with this sample.
    pub tick: Tick,
    /// Simulated time at which the tick begins.
    pub now: SimTime,
    /// Number of [`SensesHeader`]s: one per drone, dead or alive.
    pub drones: u32,
    /// Number of [`SensedObstacle`]s.
    pub obstacles: u32,
    /// Number of [`SensedNeighbour`]s.
    pub neighbours: u32,
    /// Number of [`SensedShape`]s.
    pub shapes: u32,
    /// Number of [`AirFrame`]s.
    pub frames: u32,
    /// Number of [`FrameCell`]s; 0 if the frames are not indexed by place.
    pub cells: u32,
    /// The topics whose frames are indexed by place, and the size of the cells.
    pub locality: Locality,
    /// Number of entries in the order of the frames ([`FrameIndex::order`]).
    pub ordered: u32,
    /// Always 0.
    pub reserved: u32,
}

/// One drone's sensor data: its own state, and the ranges of its entries among the obstacles and neighbours of all drones.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensesHeader {
    /// The drone's position as its sensors report it, world frame, m.
    pub position_m: [f64; 3],
    /// The drone's velocity as its sensors report it, world frame, m/s.
    pub velocity_mps: [f64; 3],
    /// Index of the drone's first [`SensedObstacle`].
    pub obstacle_first: u32,
    /// Number of the drone's [`SensedObstacle`]s.
    pub obstacle_count: u32,
    /// Index of the drone's first [`SensedNeighbour`].
    pub neighbour_first: u32,
    /// Number of the drone's [`SensedNeighbour`]s.
    pub neighbour_count: u32,
    /// 1 if the drone is alive, 0 if it is dead.
    pub alive: u32,
    /// Incarnation of the drone's process.
    pub incarnation: u32,
    /// Faults of the drone's radio.
    pub link_faults: LinkFaults,
    /// Time that faults add to the drone's reaction time, s.
    pub extra_reaction_s: f64,
    /// What the drone's clock is ahead of the time of the mission, ns.
    pub clock_error_ns: i64,
    /// The sensors that report nothing, as flags: [`BrokenSensors::to_wire`].
    pub broken: u32,
    /// Always 0.
    pub reserved: u32,
}

impl SensesHeader {
    /// Why faults of the two radios prevent this drone from hearing a frame; `None` if they do not. Loss and range are not
    /// considered here.
    #[must_use]
    pub fn drop_reason(&self, frame: &AirFrame) -> Option<DropReason> {
        self.link_faults.drop_reason(frame.link_faults)
    }
}

/// An obstacle that is at least partly in a drone's detection range.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensedObstacle {
    /// Point of the obstacle's surface that is nearest to the drone, world frame, m.
    pub nearest_m: [f64; 3],
    /// Distance from the drone to that point, m; negative if the drone is inside the obstacle.
    pub distance_m: f64,
    /// Index of the obstacle's outline among the [`SensedShape`]s.
    pub shape: u32,
    /// Always 0.
    pub reserved: u32,
}

impl SensedObstacle {
    /// The horizontal part of [`Self::nearest_m`], world frame, m.
    #[must_use]
    #[inline]
    pub fn nearest(&self) -> Vec2 {
        horizontal(self.nearest_m)
    }
}

/// Another drone within ranging distance.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SensedNeighbour {
    /// Its position relative to the sensing drone, axes of the world frame, m.
    pub position_m: [f64; 3],
    /// Its velocity relative to the sensing drone, axes of the world frame, m/s.
    pub velocity_mps: [f64; 3],
    /// The neighbour's id.
    pub drone: DroneId,
    /// Always 0.
    pub reserved: u32,
}

impl SensedNeighbour {
    /// The horizontal part of the relative position, axes of the world frame, m.
    #[must_use]
    #[inline]
    pub fn position(&self) -> Vec2 {
        horizontal(self.position_m)
    }

    /// The horizontal part of the relative velocity, axes of the world frame, m/s.
    #[must_use]
    #[inline]
    pub fn velocity(&self) -> Vec2 {
        horizontal(self.velocity_mps)
    }
}

/// The outline of a sensed obstacle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SensedShape {
    /// The outline, world frame, m.
    pub shape: ConvexShape,
    /// The obstacle's id.
    pub id: ObstacleId,
    /// Always 0.
    pub reserved: u32,
}

/// A downlink as the world builds it. The world reuses its memory from tick to tick.
#[derive(Clone, Debug, Default)]
pub struct Downlink {
    /// The header. [`Downlink::seal`] sets it.
    pub head: DownlinkHeader,
    /// One entry per drone, in the order of the ids.
    pub drones: Vec<SensesHeader>,
    /// The obstacles that each drone senses, in the order of the drones.
    pub obstacles: Vec<SensedObstacle>,
    /// The neighbours that each drone senses, in the order of the drones.
    pub neighbours: Vec<SensedNeighbour>,
    /// Outlines of the obstacles that at least one drone senses.
    pub shapes: Vec<SensedShape>,
    /// All frames that were sent in the previous tick, ordered by source and sequence number.
    pub frames: Vec<AirFrame>,
    /// Index of the frames by the place of sending.
    pub index: FrameIndex,
}

/// A sample is not a downlink: it is too short for the counts in its header, or not aligned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the downlink of {bytes} bytes does not hold what its head announces")]
pub struct DownlinkError {
    /// Size of the sample, bytes.
    pub bytes: usize,
}

impl Downlink {
    /// Sets the header: the tick, its time `now`, and the counts of all parts.
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

    /// A view of this downlink, for readers in the same process.
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

    /// Size of the sample that [`Downlink::write_to`] writes, bytes.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        self.parts().iter().map(|part| part.len()).sum()
    }

    /// Writes the sample to the beginning of `out`.
    ///
    /// # Panics
    /// If `out` is shorter than [`Downlink::byte_len`].
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

/// A downlink as a drone reads it: all parts are borrowed from the sample.
#[derive(Clone, Copy, Debug)]
pub struct DownlinkView<'a> {
    /// The header.
    pub head: &'a DownlinkHeader,
    /// One entry per drone, in the order of the ids.
    pub drones: &'a [SensesHeader],
    /// The obstacles that each drone senses, in the order of the drones.
    pub obstacles: &'a [SensedObstacle],
    /// The neighbours that each drone senses, in the order of the drones.
    pub neighbours: &'a [SensedNeighbour],
    /// Outlines of the obstacles that at least one drone senses.
    pub shapes: &'a [SensedShape],
    /// All frames that were sent in the previous tick, ordered by source and sequence number.
    pub frames: &'a [AirFrame],
    /// Index of the frames by the place of sending.
    pub nearby: NearbyFrames<'a>,
}

impl<'a> DownlinkView<'a> {
    /// Reads a sample without copying it. `bytes` must be 8-byte aligned. Bytes after the sample are ignored.
    ///
    /// # Errors
    /// [`DownlinkError`] if the sample is shorter than the counts in its header require, or not aligned.
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

    /// What one drone senses; `None` if the sample has no such drone. A range that exceeds the sample counts as empty.
    #[must_use]
    pub fn senses(&self, drone: DroneId) -> Option<Senses<'a>> {
        let head = self.drones.get(drone.index())?;
        let now = SimTime(self.head.now.0.saturating_add(head.clock_error_ns));
        Some(Senses {
            now_s: now.secs(),
            now,
            tick: self.head.tick,
            position_m: head.position_m,
            velocity_mps: head.velocity_mps,
            extra_reaction_s: head.extra_reaction_s,
            broken: BrokenSensors::from_wire(head.broken),
            obstacles: range(self.obstacles, head.obstacle_first, head.obstacle_count),
            neighbours: range(self.neighbours, head.neighbour_first, head.neighbour_count),
            shapes: self.shapes,
        })
    }
}

/// What one drone senses in one tick, and when.
#[derive(Clone, Copy, Debug)]
pub struct Senses<'a> {
    /// Simulated time at which the tick begins, by the drone's clock, s.
    pub now_s: f64,
    /// The same time, exact.
    pub now: SimTime,
    /// Number of the tick.
    pub tick: Tick,
    /// The drone's position as its sensors report it, world frame, m.
    pub position_m: [f64; 3],
    /// The drone's velocity as its sensors report it, world frame, m/s.
    pub velocity_mps: [f64; 3],
    /// Time that faults add to the drone's reaction time, s.
    pub extra_reaction_s: f64,
    /// The sensors that report nothing.
    pub broken: BrokenSensors,
    /// Obstacles that are at least partly in detection range.
    pub obstacles: &'a [SensedObstacle],
    /// Drones within ranging distance.
    pub neighbours: &'a [SensedNeighbour],
    shapes: &'a [SensedShape],
}

impl<'a> Senses<'a> {
    /// Makes the senses of a drone without faults at the given tick, time, position (m) and velocity (m/s), world frame. Tests
    /// and look-ahead simulations use this.
    #[must_use]
    pub fn new(
        (tick, now): (Tick, SimTime),
        (position_m, velocity_mps): ([f64; 3], [f64; 3]),
        obstacles: &'a [SensedObstacle],
        neighbours: &'a [SensedNeighbour],
        shapes: &'a [SensedShape],
    ) -> Self {
        Self {
            now_s: now.secs(),
            now,
            tick,
            position_m,
            velocity_mps,
            extra_reaction_s: 0.0,
            broken: BrokenSensors::default(),
            obstacles,
            neighbours,
            shapes,
        }
    }

    /// These senses with another time, position (m), velocity (m/s), obstacles and neighbours. Predictions of the near future
    /// use this; the outlines and the sensor faults stay the same.
    #[must_use]
    pub fn at<'b>(
        &self,
        now: SimTime,
        (position_m, velocity_mps): ([f64; 3], [f64; 3]),
        obstacles: &'b [SensedObstacle],
        neighbours: &'b [SensedNeighbour],
    ) -> Senses<'b>
    where
        'a: 'b,
    {
        Senses { now_s: now.secs(), now, position_m, velocity_mps, obstacles, neighbours, ..*self }
    }

    /// The horizontal part of the drone's position as its sensors report it, world frame, m.
    #[must_use]
    #[inline]
    pub fn position(&self) -> Vec2 {
        horizontal(self.position_m)
    }

    /// The horizontal part of the drone's velocity as its sensors report it, world frame, m/s.
    #[must_use]
    #[inline]
    pub fn velocity(&self) -> Vec2 {
        horizontal(self.velocity_mps)
    }

    /// The outline of a sensed obstacle; `None` if its index is out of range.
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
    fn a_written_sample_is_read_back() {
        let mut down = Downlink::default();
        down.drones.push(SensesHeader { neighbour_count: 1, position_m: [1.0, 2.0, 3.0], ..SensesHeader::default() });
        down.neighbours.push(SensedNeighbour { drone: DroneId(5), ..SensedNeighbour::default() });
        down.seal(3, SimTime(60));
        let mut words = vec![0u64; down.byte_len().div_ceil(8)];
        down.write_to(bytemuck::cast_slice_mut(&mut words));
        let view = DownlinkView::parse(bytemuck::cast_slice(&words)).unwrap();
        let senses = view.senses(DroneId(0)).unwrap();
        assert_eq!((senses.position_m, senses.position()), ([1.0, 2.0, 3.0], Vec2::new(1.0, 2.0)));
        assert_eq!(senses.neighbours[0].drone, DroneId(5));
        assert_eq!((view.head.tick, view.head.now, senses.now_s), (3, SimTime(60), 6e-8));
        assert!(view.senses(DroneId(1)).is_none());
    }

    #[test]
    fn a_drone_reads_its_own_clock() {
        let mut down = Downlink::default();
        down.drones.extend(
            [-1_000_000_000, 0, 5].map(|clock_error_ns| SensesHeader { clock_error_ns, ..SensesHeader::default() }),
        );
        down.seal(3, SimTime(60));
        let read = |drone| down.view().senses(DroneId(drone)).unwrap().now;
        assert_eq!([0, 1, 2].map(read), [SimTime(60 - 1_000_000_000), SimTime(60), SimTime(65)]);
    }

    #[test]
    fn a_sample_that_is_too_short_is_refused() {
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
