//! What is around each body: surveyed once a tick, for the senses and for the invariants.

use crate::body::Body;
use crate::geometry::{Nearest, Outline};
use crate::grid::Neighbours;
use skein_protocol::downlink::{Downlink, SensedNeighbour, SensedObstacle, SensedShape, SensesHeader};
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::shape::ConvexShape;
use skein_protocol::wire::BrokenSensors;
use skein_protocol::{DroneId, ObstacleId, Vec2};

/// An obstacle that a living drone senses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    pub drone: u32,
    pub obstacle: u32,
    pub nearest: Nearest,
}

/// What is around each body.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surroundings {
    /// Flying bodies near each.
    pub neighbours: Neighbours,
    /// By drone, then obstacle.
    pub contacts: Vec<Contact>,
    /// Distance of each flying body to the nearest obstacle, m; infinite if it is beyond the reach of the survey.
    pub clearance_m: Vec<f64>,
}

/// How far a survey looks, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// For bodies.
    pub bodies_m: f64,
    /// For obstacles that are sensed.
    pub detection_m: f64,
    /// For obstacles whose distance matters, sensed or not.
    pub clearance_m: f64,
}

impl Surroundings {
    /// Surveys anew, in the memory of the last time.
    pub fn survey(&mut self, bodies: &[Body], outlines: &[Outline], reach: Reach) {
        self.neighbours.find(bodies, reach.bodies_m);
        self.contacts.clear();
        self.clearance_m.clear();
        for (drone, body) in bodies.iter().enumerate() {
            let clearance = if body.flies() { self.look_around(drone, body, outlines, reach) } else { f64::INFINITY };
            self.clearance_m.push(clearance);
        }
    }

    fn look_around(&mut self, drone: usize, body: &Body, outlines: &[Outline], reach: Reach) -> f64 {
        let detection = if body.alive { reach.detection_m } else { f64::NEG_INFINITY };
        let limit = detection.max(reach.clearance_m);
        let mut clearance = f64::INFINITY;
        for (obstacle, outline) in outlines.iter().enumerate() {
            if outline.box_distance_squared(body.position) > limit * limit {
                continue;
            }
            let nearest = outline.nearest(body.position);
            clearance = clearance.min(nearest.distance_m);
            if nearest.distance_m <= detection {
                self.contacts.push(Contact { drone: drone as u32, obstacle: obstacle as u32, nearest });
            }
        }
        clearance
    }
}

/// What a drone is told differently from the truth.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SensorFault {
    /// Its radio.
    pub cuts: LinkFaults,
    /// Added to its reaction time, s.
    pub extra_reaction_s: f64,
    /// It senses no obstacles.
    pub no_obstacles: bool,
    /// It senses no neighbours.
    pub no_ranging: bool,
    /// Added to what it is told of its own position, m. What it ranges, it ranges right.
    pub position_error_m: Vec2,
    /// Added to what it is told of its own velocity, m/s.
    pub velocity_error_mps: Vec2,
}

impl SensorFault {
    /// What the drone's sensors say of themselves. One that it does not have is not broken.
    fn broken(&self, ranging: bool) -> BrokenSensors {
        BrokenSensors { obstacles: self.no_obstacles, ranging: self.no_ranging && ranging }
    }
}

/// Writes senses into a downlink, each sensed shape once.
#[derive(Clone, Debug)]
pub(crate) struct SenseWriter {
    shapes: Vec<ConvexShape>,
    /// Place of each shape in the downlink; `u32::MAX`: not yet there.
    places: Vec<u32>,
}

impl SenseWriter {
    /// For these obstacles.
    pub fn new(shapes: &[ConvexShape]) -> Self {
        Self { shapes: shapes.to_vec(), places: vec![u32::MAX; shapes.len()] }
    }

    /// Fills everything but the frames and the head.
    pub fn tell(
        &mut self,
        bodies: &[Body],
        drones: impl Iterator<Item = (u32, SensorFault)>,
        around: &Surroundings,
        ranging_m: Option<f64>,
        down: &mut Downlink,
    ) {
        down.drones.clear();
        down.obstacles.clear();
        down.neighbours.clear();
        down.shapes.clear();
        self.places.fill(u32::MAX);
        let mut contacts = around.contacts.iter().peekable();
        for ((drone, body), (incarnation, sensor_fault)) in bodies.iter().enumerate().zip(drones) {
            let (obstacle_first, neighbour_first) = (down.obstacles.len() as u32, down.neighbours.len() as u32);
            while let Some(contact) = contacts.next_if(|contact| contact.drone as usize == drone) {
                self.tell_contact(contact, sensor_fault.position_error_m, down);
            }
            if let (true, Some(range)) = (body.alive && !sensor_fault.no_ranging, ranging_m) {
                tell_neighbours(body, bodies, around.neighbours.of(drone), range, down);
            }
            down.drones.push(SensesHeader {
                position_m: (body.position + sensor_fault.position_error_m).into(),
                velocity_mps: (body.velocity + sensor_fault.velocity_error_mps).into(),
                obstacle_first,
                obstacle_count: down.obstacles.len() as u32 - obstacle_first,
                neighbour_first,
                neighbour_count: down.neighbours.len() as u32 - neighbour_first,
                alive: u32::from(body.alive),
                incarnation,
                link_faults: sensor_fault.cuts,
                extra_reaction_s: sensor_fault.extra_reaction_s,
                broken: sensor_fault.broken(ranging_m.is_some()).to_wire(),
                reserved: 0,
            });
        }
    }

    /// A drone measures where an obstacle is from itself: an error of its own position moves the point along.
    fn tell_contact(&mut self, contact: &Contact, error_m: Vec2, down: &mut Downlink) {
        let obstacle = contact.obstacle as usize;
        if self.places[obstacle] == u32::MAX {
            self.places[obstacle] = down.shapes.len() as u32;
            let (shape, id) = (self.shapes[obstacle], ObstacleId(contact.obstacle));
            down.shapes.push(SensedShape { shape, id, reserved: 0 });
        }
        down.obstacles.push(SensedObstacle {
            nearest_m: (contact.nearest.point + error_m).into(),
            distance_m: contact.nearest.distance_m,
            shape: self.places[obstacle],
            reserved: 0,
        });
    }
}

fn tell_neighbours(body: &Body, bodies: &[Body], ids: &[u32], range_m: f64, down: &mut Downlink) {
    for &id in ids {
        let other = &bodies[id as usize];
        let position = other.position - body.position;
        if position.norm_squared() <= range_m * range_m {
            let velocity_mps = (other.velocity - body.velocity).into();
            let position_m = position.into();
            down.neighbours.push(SensedNeighbour { position_m, velocity_mps, drone: DroneId(id), reserved: 0 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{bodies, rectangle};
    use proptest::prelude::*;
    use skein_protocol::SimTime;

    const REACH: Reach = Reach { bodies_m: 66.0, detection_m: 90.0, clearance_m: 15.0 };

    fn told(bodies: &[Body], shapes: &[ConvexShape], ranging_m: Option<f64>) -> Downlink {
        told_to(bodies, shapes, ranging_m, SensorFault::default())
    }

    fn told_to(bodies: &[Body], shapes: &[ConvexShape], ranging_m: Option<f64>, sensor_fault: SensorFault) -> Downlink {
        let outlines: Vec<Outline> = shapes.iter().map(Outline::new).collect();
        let (mut around, mut down) = (Surroundings::default(), Downlink::default());
        around.survey(bodies, &outlines, REACH);
        let drones = std::iter::repeat((1, sensor_fault));
        SenseWriter::new(shapes).tell(bodies, drones, &around, ranging_m, &mut down);
        down.seal(0, SimTime::ZERO);
        down
    }

    #[test]
    fn obstacles_are_sensed_up_to_the_range_and_listed_once() {
        let shapes = [rectangle(500.0, 0.0, 10.0, 10.0), rectangle(100.0, 0.0, 10.0, 80.0)];
        let down = told(&bodies(&[[0.0, 0.0], [-0.1, 0.0], [20.0, 30.0]]), &shapes, None);
        let view = down.view();
        let first = view.senses(DroneId(0)).unwrap();
        assert_eq!(first.obstacles.len(), 1);
        assert_eq!((first.obstacles[0].nearest_m, first.obstacles[0].distance_m), ([90.0, 0.0], 90.0));
        assert_eq!(first.shape(&first.obstacles[0]).unwrap().id, ObstacleId(1));
        assert!(view.senses(DroneId(1)).unwrap().obstacles.is_empty());
        assert_eq!(view.senses(DroneId(2)).unwrap().obstacles[0].distance_m, 70.0);
        assert_eq!((down.shapes.len(), down.shapes[0].shape), (1, shapes[1]));
    }

    #[test]
    fn the_dead_sense_nothing_and_are_sensed() {
        let mut all = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
        all[1].alive = false;
        let down = told(&all, &[rectangle(80.0, 0.0, 10.0, 10.0)], Some(66.0));
        let (living, dead) = (down.view().senses(DroneId(0)).unwrap(), down.view().senses(DroneId(1)).unwrap());
        assert_eq!((living.obstacles.len(), living.neighbours[0].position_m), (1, [50.0, 0.0]));
        assert!(dead.obstacles.is_empty() && dead.neighbours.is_empty());
        assert_eq!((down.drones[0].alive, down.drones[1].alive), (1, 0));
    }

    #[test]
    fn an_error_of_ones_own_position_leaves_what_is_ranged_right() {
        let (position_error_m, velocity_error_mps) = (Vec2::new(3.0, -1.0), Vec2::new(0.5, 0.0));
        let sensor_fault = SensorFault { position_error_m, velocity_error_mps, ..SensorFault::default() };
        let all = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
        let down = told_to(&all, &[rectangle(80.0, 0.0, 10.0, 10.0)], Some(66.0), sensor_fault);
        let senses = down.view().senses(DroneId(0)).unwrap();
        assert_eq!((senses.position, senses.velocity), (position_error_m, velocity_error_mps));
        assert_eq!((senses.obstacles[0].nearest_m, senses.obstacles[0].distance_m), ([73.0, -1.0], 70.0));
        assert_eq!(senses.neighbours[0].position_m, [50.0, 0.0]);
    }

    #[test]
    fn ranging_can_be_off() {
        let blind = SensorFault { no_ranging: true, ..SensorFault::default() };
        let down = told_to(&bodies(&[[0.0, 0.0], [1.0, 0.0]]), &[], Some(9.0), blind);
        assert!(down.neighbours.is_empty());
        assert_eq!(down.view().senses(DroneId(1)).unwrap().broken, BrokenSensors { ranging: true, obstacles: false });
        assert_eq!(told_to(&bodies(&[[0.0, 0.0]]), &[], None, blind).drones[0].broken, 0, "it has none");
        assert!(told(&bodies(&[[0.0, 0.0], [1.0, 0.0]]), &[], None).neighbours.is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn neighbours_are_all_in_range_by_id(
            positions in prop::collection::vec([-300f64..300.0, -300f64..300.0], 1..120),
        ) {
            let all = bodies(&positions);
            let down = told(&all, &[], Some(60.0));
            for (i, body) in all.iter().enumerate() {
                let found: Vec<u32> =
                    down.view().senses(DroneId(i as u32)).unwrap().neighbours.iter().map(|n| n.drone.0).collect();
                let near = |other: &Body| (other.position - body.position).norm_squared() <= 3600.0;
                let wanted: Vec<u32> =
                    (0..all.len()).filter(|&j| j != i && near(&all[j])).map(|j| j as u32).collect();
                prop_assert_eq!(found, wanted);
            }
        }
    }
}
