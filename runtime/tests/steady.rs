//! Once a swarm is in formation, a tick allocates nothing in the world or in the drones.
#![allow(unsafe_code, reason = "an allocator that counts")]
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::DroneId;
use skein_protocol::slot::{LinkStats, Slot};
use skein_runtime::{PilotHost, StepScratch, mission};
use skein_scenario::Scenario;
use skein_world::World;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use support::{parse, pilot_hosts};

thread_local! {
    /// Allocations of this thread: those of one test only.
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system's allocator. Counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of the system's allocator.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of the system's allocator.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A long flight without obstacles, by the default strategy.
fn scenario(drones: u32, more: &str) -> Scenario {
    let text = format!(
        "[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n[drone]\nsafe_distance_m = 37\n\
         [mission]\nstop_x_m = 100000\n[time]\ntimeout_s = 10000\n{more}"
    );
    parse(&text, &[])
}

struct Swarm {
    world: World,
    pilot_hosts: Vec<PilotHost>,
    scratch: StepScratch,
    slots: Vec<Slot>,
    stats: LinkStats,
}

impl Swarm {
    fn new(scenario: &Scenario) -> Self {
        Self {
            world: mission::world(scenario).unwrap(),
            pilot_hosts: pilot_hosts(scenario),
            scratch: StepScratch::default(),
            slots: vec![Slot::default(); scenario.formation.drones as usize],
            stats: LinkStats::default(),
        }
    }

    /// Flies one tick. Returns the number of allocations of the drones and of the world.
    fn tick(&mut self) -> [u64; 2] {
        let mut spent = [0, 0];
        let mut count = |part: usize, before: u64| spent[part] += COUNT.get() - before;
        let before = COUNT.get();
        self.world.process_commands();
        let down = self.world.downlink();
        count(1, before);
        // The copy is the test's, and does not count.
        let down = down.clone();
        let mut said = Vec::with_capacity(self.pilot_hosts.len());
        for (pilot_host, slot) in self.pilot_hosts.iter_mut().zip(&mut self.slots) {
            let before = COUNT.get();
            let sent = pilot_host.step(&down.view(), &mut self.scratch, slot, &mut self.stats);
            count(0, before);
            // Encoding is the runtime's part, and does not count.
            said.push(sent.frames().collect::<Vec<_>>());
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

/// After `settle` ticks, none of 500 ticks allocates.
fn allocates_nothing_after(scenario: &Scenario, settle: u32) {
    let mut swarm = Swarm::new(scenario);
    for _ in 0..settle {
        swarm.tick();
    }
    for tick in 0..500 {
        assert_eq!(swarm.tick(), [0, 0], "allocations of drones and world, {tick} ticks after {settle}");
    }
}

#[test]
fn eight_drones_in_formation() {
    allocates_nothing_after(&scenario(8, ""), 500);
}

#[test]
fn a_hundred_drones_in_range_of_each_other() {
    allocates_nothing_after(&scenario(100, "[radio]\nrange_m = 1000\n"), 1500);
}

#[test]
fn eight_drones_with_a_slow_and_lossy_radio() {
    allocates_nothing_after(
        &scenario(8, "[radio]\ndelay_s = 0.1\njitter_s = 0.03\ndelay_model = \"gamma\"\nloss = 0.2\n"),
        4000,
    );
}
