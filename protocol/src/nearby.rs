//! A spatial index of the frames of a tick, by the position of the sender. With a limited radio range, a drone examines
//! only the frames from nearby cells. The cost of a tick for one drone then depends on the number of drones nearby, not on
//! the size of the swarm.

use crate::Vec2;
use crate::frame::{AirFrame, NEVER_TRANSMITTED};
use crate::link_faults::LinkFaults;
use crate::message::Topic;
use crate::space::horizontal;
use crate::topic_name::OWN_TOPIC;
use bytemuck::{Pod, Zeroable};

/// Up to this number of frames, examining all of them is cheaper than building the index.
const FEW: usize = 32;

/// The bit of [`Locality::topics`] for all topics that pilots define.
const OWN_BIT: u32 = 31;

/// The topics that no drone hears beyond a limited range. [`crate::radio::Radio::locality`] computes them for a radio.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Locality {
    /// Side of a square cell, m. No frame of these topics is heard from farther away.
    pub cell_m: f64,
    /// One bit per built-in topic, at the topic's number on the wire, and one for all topics that pilots define. 0: no topic is limited in range, and the index stays empty.
    pub topics: u32,
    /// Number of frames of other topics. They come first in the order, and every drone must examine them.
    pub everywhere: u32,
}

impl Locality {
    /// Whether frames of this kind are limited in range. `kind` is a topic's number on the wire.
    #[must_use]
    pub fn holds(&self, kind: u16) -> bool {
        let bit = if kind & OWN_TOPIC != 0 { OWN_BIT } else { u32::from(kind) };
        (kind & OWN_TOPIC != 0 || bit < OWN_BIT) && self.topics >> bit & 1 == 1
    }

    /// Adds a topic that is heard up to `range_m`, m. The cells grow to that size if they are smaller.
    #[must_use]
    pub fn with(self, topic: Topic, range_m: f64) -> Self {
        Self { cell_m: self.cell_m.max(range_m), topics: self.topics | 1 << topic as u16, ..self }
    }

    /// Adds all topics that pilots define, as [`Locality::with`] does.
    #[must_use]
    pub fn with_own(self, range_m: f64) -> Self {
        Self { cell_m: self.cell_m.max(range_m), topics: self.topics | 1 << OWN_BIT, ..self }
    }

    /// Whether frames of topics that pilots define are limited in range.
    #[must_use]
    pub fn holds_own(&self) -> bool {
        self.holds(OWN_TOPIC)
    }

    /// Whether the frame is sure to be out of range at this place, world frame, m.
    #[inline]
    #[must_use]
    pub fn is_beyond(&self, frame: &AirFrame, here: [f64; 3]) -> bool {
        let offset = |axis: usize| frame.position_m[axis] - here[axis];
        let [x, y, z] = [offset(0), offset(1), offset(2)];
        self.holds(frame.frame.kind) && x * x + y * y + z * z > self.side_m() * self.side_m()
    }

    /// Side of a cell, m. It is slightly greater than the range, so that rounding never puts two points at exactly this distance two cells
    /// apart.
    fn side_m(&self) -> f64 {
        (self.cell_m * 1.000_001).max(f64::MIN_POSITIVE)
    }

    fn cell(&self, point: Vec2) -> (i32, i32) {
        let side_m = self.side_m();
        ((point.x / side_m).floor() as i32, (point.y / side_m).floor() as i32)
    }
}

/// The frames that were sent from one cell: a run of entries in the index's order.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct FrameCell {
    /// Column, along x.
    pub x: i32,
    /// Row, along y.
    pub y: i32,
    /// Position in the order of the cell's first frame.
    pub first: u32,
    /// Number of frames in the cell.
    pub count: u32,
}

/// The index as the world builds it. Its memory is reused from tick to tick.
#[derive(Clone, Debug, Default)]
pub struct FrameIndex {
    /// Cell size and the topics that are sorted into cells.
    pub locality: Locality,
    /// The cells with at least one frame, sorted by column, then by row.
    pub cells: Vec<FrameCell>,
    /// Positions of all frames in the tick's list: first the frames of other topics, then those of each cell in turn.
    pub order: Vec<u32>,
    sorted: Vec<((i32, i32), u32)>,
}

impl FrameIndex {
    /// Sorts the frames of a tick into cells. The index stays empty if there are few frames. It also stays empty if any
    /// frame may be dropped for another reason than its range: every drone must then examine every frame, so that each
    /// drop is counted under its own reason.
    pub fn build(&mut self, locality: Locality, frames: &[AirFrame]) {
        self.locality = Locality::default();
        self.cells.clear();
        self.order.clear();
        self.sorted.clear();
        let unaffected =
            |frame: &AirFrame| frame.link_faults == LinkFaults::default() && frame.queue_ns != NEVER_TRANSMITTED;
        if locality.topics == 0 || frames.len() <= FEW || !frames.iter().all(unaffected) {
            return;
        }
        for (frame, place) in frames.iter().zip(0..) {
            if locality.holds(frame.frame.kind) {
                self.sorted.push((locality.cell(horizontal(frame.position_m)), place));
            } else {
                self.order.push(place);
            }
        }
        self.locality = Locality { everywhere: self.order.len() as u32, ..locality };
        self.sorted.sort_unstable();
        for &((x, y), place) in &self.sorted {
            match self.cells.last_mut() {
                Some(cell) if (cell.x, cell.y) == (x, y) => cell.count += 1,
                _ => self.cells.push(FrameCell { x, y, first: self.order.len() as u32, count: 1 }),
            }
            self.order.push(place);
        }
    }

    /// A borrowed view of the index, for readers in the same process.
    #[must_use]
    pub fn view(&self) -> NearbyFrames<'_> {
        NearbyFrames { locality: self.locality, cells: &self.cells, order: &self.order }
    }
}

/// The index as a drone reads it, without a copy.
#[derive(Clone, Copy, Debug)]
pub struct NearbyFrames<'a> {
    /// Cell size and the topics that are sorted into cells.
    pub locality: Locality,
    /// The cells with at least one frame, sorted by column, then by row.
    pub cells: &'a [FrameCell],
    /// Positions of all frames in the tick's list: first the frames of other topics, then those of each cell in turn.
    pub order: &'a [u32],
}

impl<'a> NearbyFrames<'a> {
    /// Calls `visit` with the position in the tick's list of each frame that could be heard above or below the place `here` (world
    /// frame, m). All other frames are out of range.
    pub fn each(&self, here: Vec2, mut visit: impl FnMut(usize)) {
        let mut run = |first: usize, count: usize| {
            let places = self.order.get(first..first.saturating_add(count)).unwrap_or_default();
            places.iter().for_each(|&place| visit(place as usize));
        };
        run(0, self.locality.everywhere as usize);
        let (x, y) = self.locality.cell(here);
        for column in x.saturating_sub(1)..=x.saturating_add(1) {
            let (from, to) = ((column, y.saturating_sub(1)), (column, y.saturating_add(1)));
            let first = self.cells.partition_point(|cell| (cell.x, cell.y) < from);
            let rows = self.cells[first..].iter().take_while(|cell| (cell.x, cell.y) <= to);
            rows.for_each(|cell| run(cell.first as usize, cell.count as usize));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::ids::DroneId;
    use proptest::prelude::*;

    fn frame(source: u32, [x, y]: [f64; 2], kind: u16) -> AirFrame {
        let mut frame = AirFrame { source: DroneId(source), position_m: [x, y, 20.0], ..AirFrame::zeroed() };
        frame.frame.kind = kind;
        frame
    }

    proptest! {
        #[test]
        fn each_frame_in_range_or_of_unlimited_range_is_visited_exactly_once(
            points in prop::collection::vec(([-400f64..400.0, -400f64..400.0], prop_oneof![1u16..8, OWN_TOPIC..=u16::MAX, Just(32u16)]), 0..300),
            own in any::<bool>(),
            here in [-500f64..500.0, -500f64..500.0],
        ) {
            let frames: Vec<AirFrame> =
                points.iter().zip(0..).map(|(&(point, kind), id)| frame(id, point, kind)).collect();
            let locality = Locality::default().with(Topic::Pose, 60.0).with(Topic::Obstacle, 90.0);
            let locality = if own { locality.with_own(90.0) } else { locality };
            let mut index = FrameIndex::default();
            index.build(locality, &frames);
            prop_assume!(index.locality.topics != 0);
            let mut visits = vec![0; frames.len()];
            index.view().each(here.into(), |place| visits[place] += 1);
            for (frame, visits) in frames.iter().zip(visits) {
                let near = (horizontal(frame.position_m) - Vec2::from(here)).norm() <= 90.0;
                let local = frame.frame.kind <= 2 || own && frame.frame.kind & OWN_TOPIC != 0;
                if near || !local {
                    prop_assert_eq!(visits, 1);
                }
                prop_assert!(visits <= 1);
                if index.locality.is_beyond(frame, [here[0], here[1], 50.0]) {
                    prop_assert!(local && (frame.position() - Vec3::new(here[0], here[1], 50.0)).norm() > 90.0);
                } else {
                    prop_assert!(!local || (frame.position() - Vec3::new(here[0], here[1], 50.0)).norm() < 90.1);
                }
            }
        }
    }

    #[test]
    fn the_index_stays_empty_for_few_frames_or_a_muted_sender() {
        let locality = Locality::default().with(Topic::Pose, 10.0);
        let mut index = FrameIndex::default();
        let mut frames = vec![frame(0, [0.0; 2], 1); FEW + 1];
        index.build(locality, &frames);
        assert_eq!((index.cells.len(), index.order.len()), (1, FEW + 1));
        index.build(locality, &frames[1..]);
        assert_eq!((index.locality, index.order.len()), (Locality::default(), 0));
        frames[3].link_faults.mute = 1;
        index.build(locality, &frames);
        assert!(index.cells.is_empty());
    }
}
