//! What is around each body, found once per tick, for the drones' senses and for the invariants.

use crate::body::Body;
use crate::geometry::{Nearest, Outline};
use crate::neighbours::Neighbours;

/// An obstacle that a drone senses if it lives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    pub(crate) drone: u32,
    pub(crate) obstacle: u32,
    pub(crate) nearest: Nearest,
}

/// How far a sweep looks, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SweepRange {
    /// For other bodies.
    pub(crate) bodies_m: f64,
    /// For obstacles that drones sense.
    pub(crate) detection_m: f64,
    /// For obstacles whose distance is checked, sensed or not.
    pub(crate) clearance_m: f64,
}

/// What is around each body.
#[derive(Clone, Debug)]
pub(crate) struct SensorSweep {
    outlines: Vec<Outline>,
    neighbours: Neighbours,
    contacts: Vec<Contact>,
    clearances_m: Vec<f64>,
}

impl SensorSweep {
    /// Nothing swept yet, among these obstacles.
    pub(crate) fn new(outlines: Vec<Outline>) -> Self {
        Self { outlines, neighbours: Neighbours::default(), contacts: Vec::new(), clearances_m: Vec::new() }
    }

    /// Looks around every body anew. Reuses the memory of the last sweep.
    pub(crate) fn sweep(&mut self, bodies: &[Body], range: SweepRange) {
        self.neighbours.find(bodies, range.bodies_m);
        self.contacts.clear();
        self.clearances_m.clear();
        for (drone, body) in bodies.iter().enumerate() {
            let clearance_m = if body.flies() { self.look_around(drone, body, range) } else { f64::INFINITY };
            self.clearances_m.push(clearance_m);
        }
    }

    /// The flying bodies near a flying body, and perhaps some that are a little farther away; ids ascending.
    pub(crate) fn neighbours_of(&self, drone: usize) -> &[u32] {
        self.neighbours.of(drone)
    }

    /// The outlines of all obstacles, by id.
    pub(crate) fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    /// The obstacles in detection range, by drone, then by obstacle.
    pub(crate) fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Distance of each body to the nearest obstacle, m, by drone. Infinite if the body has landed or the obstacle is
    /// out of range.
    pub(crate) fn clearances_m(&self) -> &[f64] {
        &self.clearances_m
    }

    /// Drops the contacts of drones that sense no obstacles.
    pub(crate) fn retain_contacts_of(&mut self, senses: impl Fn(u32) -> bool) {
        self.contacts.retain(|contact| senses(contact.drone));
    }

    /// Adds the contacts of one drone. Returns its distance to the nearest obstacle, m.
    fn look_around(&mut self, drone: usize, body: &Body, range: SweepRange) -> f64 {
        let limit_m = range.detection_m.max(range.clearance_m);
        let mut clearance_m = f64::INFINITY;
        for (obstacle, outline) in self.outlines.iter().enumerate() {
            if outline.box_distance_squared(body.position()) > limit_m * limit_m {
                continue;
            }
            let nearest = outline.nearest(body.position());
            clearance_m = clearance_m.min(nearest.distance_m);
            if nearest.distance_m <= range.detection_m {
                self.contacts.push(Contact { drone: drone as u32, obstacle: obstacle as u32, nearest });
            }
        }
        clearance_m
    }
}
