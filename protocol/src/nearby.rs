//! Frames by where they were sent, so that with a limited range no drone looks at all of them: what a tick costs a drone
//! depends on who is near, not on how many there are.

use crate::Vec2;
use crate::frame::{AirFrame, NEVER_TRANSMITTED};
use crate::link_faults::LinkFaults;
use crate::message::Topic;
use bytemuck::{Pod, Zeroable};

/// Up to so many frames it is cheaper to look at all of them.
const FEW: usize = 32;

/// Topics that are heard no farther than a range, as a radio gives them ([`crate::radio::Radio::locality`]).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Locality {
    /// Side of a square cell: no frame of these topics is heard from farther away, m.
    pub cell_m: f64,
    /// One bit a topic, at its number on the wire; 0: none, and nothing is sorted.
    pub topics: u32,
    /// Frames of other topics: they come first in the order, and concern everybody.
    pub everywhere: u32,
}

impl Locality {
    /// Whether a frame of this kind is heard in the neighbourhood alone.
    #[must_use]
    pub fn holds(&self, kind: u16) -> bool {
        kind < 32 && self.topics >> kind & 1 == 1
    }

    /// Takes a topic in.
    #[must_use]
    pub fn with(self, topic: Topic, range_m: f64) -> Self {
        Self { cell_m: self.cell_m.max(range_m), topics: self.topics | 1 << topic as u16, ..self }
    }

    fn cell(&self, point: Vec2) -> (i32, i32) {
        // A shade wider, so that rounding never puts two points at that distance two cells apart.
        let side_m = (self.cell_m * 1.000_001).max(f64::MIN_POSITIVE);
        ((point.x / side_m).floor() as i32, (point.y / side_m).floor() as i32)
    }
}

/// Frames that were sent in one cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct FrameCell {
    /// Column, along x.
    pub x: i32,
    /// Row, along y.
    pub y: i32,
    /// The first of them in the order.
    pub first: u32,
    /// Their number.
    pub count: u32,
}

/// The index as the world builds it, tick after tick in the same memory.
#[derive(Clone, Debug, Default)]
pub struct FrameIndex {
    /// What it holds.
    pub locality: Locality,
    /// By column, then row.
    pub cells: Vec<FrameCell>,
    /// Places of all frames: those that are heard everywhere, then cell by cell.
    pub order: Vec<u32>,
    sorted: Vec<((i32, i32), u32)>,
}

impl FrameIndex {
    /// Sorts the frames of a tick. Not if they are few, nor if some are cut off for another reason than their range:
    /// then everybody has to look at each, to count it right.
    pub fn build(&mut self, locality: Locality, frames: &[AirFrame]) {
        self.locality = Locality::default();
        self.cells.clear();
        self.order.clear();
        self.sorted.clear();
        let plain =
            |frame: &AirFrame| frame.link_faults == LinkFaults::default() && frame.queue_ns != NEVER_TRANSMITTED;
        if locality.topics == 0 || frames.len() <= FEW || !frames.iter().all(plain) {
            return;
        }
        for (frame, place) in frames.iter().zip(0..) {
            if locality.holds(frame.frame.kind) {
                self.sorted.push((locality.cell(frame.position()), place));
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

    /// Borrowed, for readers in the same process.
    #[must_use]
    pub fn view(&self) -> NearbyFrames<'_> {
        NearbyFrames { locality: self.locality, cells: &self.cells, order: &self.order }
    }
}

/// The index as a drone reads it, in place.
#[derive(Clone, Copy, Debug)]
pub struct NearbyFrames<'a> {
    /// What it holds.
    pub locality: Locality,
    /// By column, then row.
    pub cells: &'a [FrameCell],
    /// Places of all frames: those that are heard everywhere, then cell by cell.
    pub order: &'a [u32],
}

impl<'a> NearbyFrames<'a> {
    /// Calls `visit` with the places of all frames that could be heard at `here`, m. Those left out are out of range.
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
    use crate::ids::DroneId;
    use proptest::prelude::*;

    fn frame(source: u32, position_m: [f64; 2], kind: u16) -> AirFrame {
        let mut frame = AirFrame { source: DroneId(source), position_m, ..AirFrame::zeroed() };
        frame.frame.kind = kind;
        frame
    }

    proptest! {
        #[test]
        fn whatever_is_in_range_or_heard_everywhere_is_visited_once(
            points in prop::collection::vec(([-400f64..400.0, -400f64..400.0], 1u16..8), 0..300),
            here in [-500f64..500.0, -500f64..500.0],
        ) {
            let frames: Vec<AirFrame> =
                points.iter().zip(0..).map(|(&(point, kind), id)| frame(id, point, kind)).collect();
            let locality = Locality::default().with(Topic::Pose, 60.0).with(Topic::Obstacle, 90.0);
            let mut index = FrameIndex::default();
            index.build(locality, &frames);
            prop_assume!(index.locality.topics != 0);
            let mut visits = vec![0; frames.len()];
            index.view().each(here.into(), |place| visits[place] += 1);
            for (frame, visits) in frames.iter().zip(visits) {
                let near = (frame.position() - Vec2::from(here)).norm() <= 90.0;
                if near || frame.frame.kind > 2 {
                    prop_assert_eq!(visits, 1);
                }
                prop_assert!(visits <= 1);
            }
        }
    }

    #[test]
    fn few_frames_and_frames_that_are_cut_off_are_not_sorted() {
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
