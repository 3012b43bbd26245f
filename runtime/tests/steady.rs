//! Once a swarm is in formation a tick allocates nothing, in the world as in the drones.
#![allow(unsafe_code, reason = "an allocator that counts")]
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_runtime::mission;
use skein_runtime::pilot_host::{PilotHost, StepScratch};
use skein_scenario::{Scenario, ScenarioSource};
use skein_world::World;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of this thread; a test's own, whatever runs beside it.
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: the system's allocator, and a counter that allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: as the caller promised.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The default strategy on a field with an obstacle that comes much later.
fn scenario(drones: u32, more: &str) -> Scenario {
    let text = format!(
        "[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n[drone]\nsafe_distance_m = 37\n\
         [mission]\nstop_x_m = 100000\n[time]\ntimeout_s = 10000\n{more}"
    );
    Scenario::parse(&text, ScenarioSource { name: "steady", stem: "steady" }, &[]).unwrap()
}

struct Swarm {
    world: World,
    cockpits: Vec<PilotHost>,
    desk: StepScratch,
    slots: Vec<Slot>,
    stats: LinkStats,
}

impl Swarm {
    fn new(scenario: &Scenario) -> Self {
        let ids = 0..scenario.formation.drones;
        Self {
            world: mission::world(scenario).unwrap(),
            cockpits: ids.map(|id| mission::pilot_host(scenario, DroneId(id), 1, SimTime::ZERO)).collect(),
            desk: StepScratch::default(),
            slots: vec![Slot::default(); scenario.formation.drones as usize],
            stats: LinkStats::default(),
        }
    }

    /// One tick; allocations of the drones, and of the world.
    fn tick(&mut self) -> [u64; 2] {
        let mut spent = [0, 0];
        let mut count = |who: usize, before: u64| spent[who] += COUNT.get() - before;
        let before = COUNT.get();
        self.world.process_commands();
        let down = self.world.downlink();
        count(1, before);
        // The test's own copy.
        let down = down.clone();
        let mut said = Vec::with_capacity(self.cockpits.len());
        for (pilot_host, slot) in self.cockpits.iter_mut().zip(&mut self.slots) {
            let before = COUNT.get();
            let words = pilot_host.step(&down.view(), &mut self.desk, slot, &mut self.stats);
            count(0, before);
            // As the wire does it.
            said.push(words.iter().map(Message::encode).collect::<Vec<_>>());
        }
        let before = COUNT.get();
        for ((slot, frames), id) in self.slots.iter().zip(&said).zip(0..) {
            self.world.take_slot(DroneId(id), slot);
            self.world.take_frames(DroneId(id), frames);
        }
        self.world.advance();
        count(1, before);
        spent
    }
}

fn steady(scenario: &Scenario, settle: u32) {
    let mut swarm = Swarm::new(scenario);
    (0..settle).for_each(|_| _ = swarm.tick());
    for tick in 0..500 {
        assert_eq!(swarm.tick(), [0, 0], "allocations of drones and world, {tick} ticks after {settle}");
    }
}

#[test]
fn eight_in_formation() {
    steady(&scenario(8, ""), 500);
}

#[test]
fn a_hundred_in_range_of_each_other() {
    steady(&scenario(100, "[radio]\nrange_m = 1000\n"), 1500);
}

#[test]
fn delayed_and_lossy() {
    steady(&scenario(8, "[radio]\ndelay_s = 0.1\njitter_s = 0.03\ndelay_model = \"gamma\"\nloss = 0.2\n"), 4000);
}
