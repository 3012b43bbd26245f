//! Where the drones of many beacons are, in little memory. What is passed on about a drone is less than what the drone says itself, and in a
//! large swarm most is passed on.

use skein_protocol::payload::{MAX_PLACES, Pose, QueuePlace};
use skein_protocol::{Vec2, horizontal, prefetch};

/// No place.
const NONE: u32 = u32::MAX;

/// A state as it is passed on, see [`skein_protocol::payload::Present`]; or the place of one that says more in [`FullStates`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct BriefState {
    position_m: [f32; 3],
    velocity_mps: [f32; 2],
    /// [`NONE`]; or the place of the state in full, and then all else here is unused.
    place: u32,
}

/// The states that say more than what is passed on. Every value is kept as it was heard.
#[derive(Clone, Default)]
pub(crate) struct FullStates {
    states: Vec<FullState>,
    /// The places that are free.
    free: Vec<u32>,
    /// First and second entries of [`Pose::queue`]. A list is empty while all its entries are unused.
    queues: [Vec<QueuePlace>; MAX_PLACES],
}

/// All of a state but the places in queues, in one line of the cache: the states of a large swarm do not fit into it.
#[repr(align(64))]
#[derive(Clone, Copy, Debug)]
struct FullState {
    position_m: [f64; 3],
    velocity_mps: [f64; 3],
    hears: u32,
    /// Whether the drone has a place in a queue.
    queued: bool,
}

impl From<&Pose> for FullState {
    #[inline]
    fn from(pose: &Pose) -> Self {
        let &Pose { position_m, velocity_mps, hears, queue, .. } = pose;
        Self { position_m, velocity_mps, hears, queued: queue != [QueuePlace::default(); MAX_PLACES] }
    }
}

impl BriefState {
    /// `None` if the state says more.
    #[inline]
    fn of(pose: &Pose) -> Option<Self> {
        let &Pose { position_m: [x, y, z], velocity_mps: [vx, vy, vz], .. } = pose;
        if pose.hears != 0 || vz.to_bits() != 0 || pose.queue != [QueuePlace::default(); MAX_PLACES] {
            return None;
        }
        let position_m = [brief(x)?, brief(y)?, brief(z)?];
        Some(Self { position_m, velocity_mps: [brief(vx)?, brief(vy)?], place: NONE })
    }

    /// A state in full at this place.
    #[inline]
    pub(crate) fn at(place: usize) -> Self {
        Self { position_m: [0.0; 3], velocity_mps: [0.0; 2], place: place as u32 }
    }
}

/// The same number in half of the memory, if it has no more digits.
#[inline]
fn brief(number: f64) -> Option<f32> {
    let brief = number as f32;
    (f64::from(brief).to_bits() == number.to_bits()).then_some(brief)
}

impl FullStates {
    /// Number of states and of free places.
    pub(crate) fn len(&self) -> usize {
        self.states.len()
    }

    #[inline]
    fn full(&self, state: &BriefState) -> Option<&FullState> {
        self.states.get(state.place as usize)
    }

    /// The horizontal part of the position, world frame, m.
    #[inline]
    pub(crate) fn position(&self, state: &BriefState) -> Vec2 {
        match self.full(state) {
            Some(full) => horizontal(full.position_m),
            None => Vec2::new(state.position_m[0].into(), state.position_m[1].into()),
        }
    }

    /// The horizontal part of the velocity, world frame, m/s.
    #[inline]
    pub(crate) fn velocity(&self, state: &BriefState) -> Vec2 {
        match self.full(state) {
            Some(full) => horizontal(full.velocity_mps),
            None => Vec2::new(state.velocity_mps[0].into(), state.velocity_mps[1].into()),
        }
    }

    /// The horizontal parts of position and velocity, world frame, m and m/s.
    #[inline]
    pub(crate) fn flight(&self, state: &BriefState) -> (Vec2, Vec2) {
        match self.full(state) {
            Some(full) => (horizontal(full.position_m), horizontal(full.velocity_mps)),
            None => (self.position(state), self.velocity(state)),
        }
    }

    /// Position and velocity, world frame, m and m/s.
    pub(crate) fn motion(&self, state: &BriefState) -> ([f64; 3], [f64; 3]) {
        if let Some(full) = self.full(state) {
            return (full.position_m, full.velocity_mps);
        }
        let [vx, vy] = state.velocity_mps.map(f64::from);
        (state.position_m.map(f64::from), [vx, vy, 0.0])
    }

    /// A hash of the drones that the drone hears: [`Pose::hears`].
    #[inline]
    pub(crate) fn hears(&self, state: &BriefState) -> u32 {
        self.full(state).map_or(0, |full| full.hears)
    }

    /// An entry of [`Pose::queue`].
    #[inline]
    pub(crate) fn queue_place(&self, state: &BriefState, number: usize) -> QueuePlace {
        let queued = self.full(state).is_some_and(|full| full.queued);
        let place = self.queues[number].get(state.place as usize).filter(|_| queued);
        place.copied().unwrap_or_default()
    }

    /// Keeps the state of a beacon in place of an earlier one of the same drone. `relayed`: the beacon was passed on.
    #[inline]
    pub(crate) fn keep(&mut self, old: Option<&BriefState>, pose: &Pose, relayed: bool) -> BriefState {
        if relayed && let Some(brief) = BriefState::of(pose) {
            old.into_iter().for_each(|old| self.release(old));
            return brief;
        }
        if let Some(old) = old
            && let Some(full) = self.states.get_mut(old.place as usize)
        {
            let was_queued = std::mem::replace(full, pose.into()).queued;
            if was_queued || full.queued {
                self.set_queue(old.place as usize, pose);
            }
            return *old;
        }
        let place = self.free.pop().map_or(self.states.len(), |place| place as usize);
        match self.states.get_mut(place) {
            Some(free) => *free = pose.into(),
            None => self.states.push(pose.into()),
        }
        self.set_queue(place, pose);
        BriefState::at(place)
    }

    /// Keeps a state at this place, while none is free. The places of those from there on rise by one.
    pub(crate) fn insert(&mut self, place: usize, pose: &Pose) {
        self.states.insert(place, pose.into());
        for queue in self.queues.iter_mut().filter(|queue| !queue.is_empty()) {
            queue.insert(place, QueuePlace::default());
        }
        self.set_queue(place, pose);
    }

    /// Removes the state at this place, while none is free. The places of those behind it fall by one.
    pub(crate) fn remove(&mut self, place: usize) {
        self.states.remove(place);
        for queue in self.queues.iter_mut().filter(|queue| !queue.is_empty()) {
            queue.remove(place);
        }
    }

    /// Forgets a state.
    pub(crate) fn release(&mut self, state: &BriefState) {
        if self.full(state).is_some() {
            self.free.push(state.place);
            let places = self.queues.iter_mut().filter_map(|queue| queue.get_mut(state.place as usize));
            places.for_each(|place| *place = QueuePlace::default());
        }
    }

    #[inline]
    fn set_queue(&mut self, place: usize, pose: &Pose) {
        for (queue, heard) in self.queues.iter_mut().zip(pose.queue) {
            if let Some(kept) = queue.get_mut(place) {
                *kept = heard;
            } else if heard != QueuePlace::default() {
                queue.resize(self.states.len(), QueuePlace::default());
                queue[place] = heard;
            }
        }
    }

    /// Gives back the memory of queues in which no drone waits any more.
    pub(crate) fn tidy(&mut self) {
        for queue in &mut self.queues {
            if queue.iter().all(|place| *place == QueuePlace::default()) {
                *queue = Vec::new();
            }
        }
    }

    /// Fetches a state into the cache.
    #[inline]
    pub(crate) fn warm(&self, state: &BriefState) {
        self.full(state).into_iter().for_each(prefetch);
    }

    /// Fetches all of them into the cache.
    #[inline]
    pub(crate) fn warm_all(&self) {
        prefetch(self.states.as_slice());
    }

    /// Fetches the places in queues of a state into the cache.
    #[inline]
    pub(crate) fn warm_queue(&self, state: &BriefState) {
        self.warm(state);
        self.queues.iter().filter_map(|queue| queue.get(state.place as usize)).for_each(prefetch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn pose(number: u32) -> Pose {
        Pose { position_m: [f64::from(number), 0.5, 1.0], velocity_mps: [0.25, -0.0, 0.0], ..Pose::zeroed() }
    }

    #[test]
    fn a_state_that_is_passed_on_takes_little_memory_unless_it_says_more() {
        let place = QueuePlace { set: 9, ..QueuePlace::default() };
        let more = [
            Pose { hears: 7, ..pose(1) },
            Pose { position_m: [0.1, 0.0, 0.0], ..pose(2) },
            Pose { velocity_mps: [1.0, 2.0, 3.0], ..pose(3) },
            Pose { velocity_mps: [1.0, 2.0, -0.0], ..pose(4) },
            Pose { queue: [place, QueuePlace::default()], ..pose(5) },
        ];
        assert!(more.iter().all(|pose| BriefState::of(pose).is_none()));
        let mut full = FullStates::default();
        let first = full.keep(None, &pose(0), false);
        assert_eq!((first.place, full.len()), (0, 1), "it was not passed on");
        assert_eq!(full.keep(None, &pose(1), true).place, NONE);
        let first = full.keep(Some(&first), &pose(7), true);
        assert_eq!(full.motion(&first).0, pose(7).position_m);
        assert!(full.motion(&first).1[1].is_sign_negative());
        let queued = full.keep(None, &more[4], true);
        assert_eq!((queued.place, full.queue_place(&queued, 0)), (0, place), "a free place is used again");
    }

    #[test]
    fn queues_take_memory_only_while_a_drone_waits() {
        let places = |routes: [u16; MAX_PLACES]| Pose {
            queue: routes.map(|route| QueuePlace { set: 9 * u32::from(route > 0), route, ..QueuePlace::default() }),
            ..pose(0)
        };
        let mut full = FullStates::default();
        let kept = [(); 4].map(|()| full.keep(None, &places([1, 2]), false));
        let kept = kept.map(|state| full.keep(Some(&state), &places([2, 0]), false));
        full.tidy();
        assert_eq!(full.queues.each_ref().map(Vec::len), [4, 0]);
        kept[..3].iter().for_each(|state| _ = full.keep(Some(state), &pose(8), true));
        assert_eq!(full.queue_place(&kept[3], 0).route, 2);
        full.release(&kept[3]);
        full.tidy();
        assert_eq!(full.queues.each_ref().map(Vec::capacity), [0, 0]);
    }
}
