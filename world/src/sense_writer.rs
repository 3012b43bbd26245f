//! What each drone senses, written into the downlink.

use crate::body::Body;
use crate::sensor_fault::SensorFault;
use crate::sweep::{Contact, SensorSweep};
use skein_protocol::downlink::{Downlink, SensedNeighbour, SensedObstacle, SensedShape, SensesHeader};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, ObstacleId, Vec2, Vec3, raised};

/// Marks a shape that the downlink does not hold yet.
const NOT_WRITTEN: u32 = u32::MAX;

/// Writes senses into a downlink, each sensed shape once.
#[derive(Clone, Debug)]
pub(crate) struct SenseWriter {
    shapes: Vec<ConvexShape>,
    /// Index of each shape in the downlink; [`NOT_WRITTEN`] if it is not there yet.
    places: Vec<u32>,
}

impl SenseWriter {
    /// A writer for these obstacles.
    pub(crate) fn new(shapes: &[ConvexShape]) -> Self {
        Self { shapes: shapes.to_vec(), places: vec![NOT_WRITTEN; shapes.len()] }
    }

    /// Writes everything but the frames and the head. `drones` gives the incarnation and the sensor fault of each drone,
    /// by id. Without `ranging_m` (m) no drone senses neighbours.
    pub(crate) fn write(
        &mut self,
        bodies: &[Body],
        drones: impl Iterator<Item = (u32, SensorFault)>,
        sweep: &SensorSweep,
        ranging_m: Option<f64>,
        down: &mut Downlink,
    ) {
        down.drones.clear();
        down.obstacles.clear();
        down.neighbours.clear();
        down.shapes.clear();
        self.places.fill(NOT_WRITTEN);
        let mut contacts = sweep.contacts().iter().peekable();
        for ((drone, body), (incarnation, sensor_fault)) in bodies.iter().enumerate().zip(drones) {
            let (obstacle_first, neighbour_first) = (down.obstacles.len() as u32, down.neighbours.len() as u32);
            while let Some(contact) = contacts.next_if(|contact| contact.drone as usize == drone) {
                self.write_contact(contact, sensor_fault.position_error_m, down);
            }
            if let (true, Some(range)) = (body.is_alive() && !sensor_fault.no_ranging, ranging_m) {
                write_neighbours(body, bodies, sweep.neighbours_of(drone), range, down);
            }
            down.drones.push(SensesHeader {
                position_m: shifted(body.position(), sensor_fault.position_error_m),
                velocity_mps: shifted(body.velocity(), sensor_fault.velocity_error_mps),
                obstacle_first,
                obstacle_count: down.obstacles.len() as u32 - obstacle_first,
                neighbour_first,
                neighbour_count: down.neighbours.len() as u32 - neighbour_first,
                alive: u32::from(body.is_alive()),
                incarnation,
                link_faults: sensor_fault.link_faults,
                extra_reaction_s: sensor_fault.extra_reaction_s,
                broken: sensor_fault.broken(ranging_m.is_some()).to_wire(),
                reserved: 0,
            });
        }
    }

    /// A drone measures an obstacle relative to itself, so an error of its own position moves the obstacle with it.
    fn write_contact(&mut self, contact: &Contact, error_m: Vec2, down: &mut Downlink) {
        let obstacle = contact.obstacle as usize;
        if self.places[obstacle] == NOT_WRITTEN {
            self.places[obstacle] = down.shapes.len() as u32;
            let (shape, id) = (self.shapes[obstacle], ObstacleId(contact.obstacle));
            down.shapes.push(SensedShape { shape, id, reserved: 0 });
        }
        down.obstacles.push(SensedObstacle {
            nearest_m: shifted(contact.nearest.point, error_m),
            distance_m: contact.nearest.distance_m,
            shape: self.places[obstacle],
            reserved: 0,
        });
    }
}

/// A point or vector with a horizontal error.
fn shifted(value: Vec3, error: Vec2) -> [f64; 3] {
    raised(value.xy() + error, value.z)
}

fn write_neighbours(body: &Body, bodies: &[Body], ids: &[u32], range_m: f64, down: &mut Downlink) {
    for &id in ids {
        let other = &bodies[id as usize];
        let position = other.position() - body.position();
        if position.norm_squared() <= range_m * range_m {
            let velocity_mps = (other.velocity() - body.velocity()).into();
            let position_m = position.into();
            down.neighbours.push(SensedNeighbour { position_m, velocity_mps, drone: DroneId(id), reserved: 0 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::sweep::SweepRange;
    use crate::testing::{bodies, rectangle};
    use proptest::prelude::*;
    use skein_protocol::SimTime;
    use skein_protocol::wire::BrokenSensors;

    const RANGE: SweepRange = SweepRange { bodies_m: 66.0, detection_m: 90.0, clearance_m: 15.0 };

    fn sensed(bodies: &[Body], shapes: &[ConvexShape], ranging_m: Option<f64>) -> Downlink {
        sensed_with(bodies, shapes, ranging_m, SensorFault::default())
    }

    fn sensed_with(
        bodies: &[Body],
        shapes: &[ConvexShape],
        ranging_m: Option<f64>,
        sensor_fault: SensorFault,
    ) -> Downlink {
        let mut sweep = SensorSweep::new(shapes.iter().map(Outline::new).collect());
        let mut down = Downlink::default();
        sweep.sweep(bodies, RANGE);
        let drones = std::iter::repeat((1, sensor_fault));
        SenseWriter::new(shapes).write(bodies, drones, &sweep, ranging_m, &mut down);
        down.seal(0, SimTime::ZERO);
        down
    }

    #[test]
    fn obstacles_are_sensed_up_to_the_range_and_listed_once() {
        let shapes = [rectangle(500.0, 0.0, 10.0, 10.0), rectangle(100.0, 0.0, 10.0, 80.0)];
        let down = sensed(&bodies(&[[0.0, 0.0], [-0.1, 0.0], [20.0, 30.0]]), &shapes, None);
        let view = down.view();
        let first = view.senses(DroneId(0)).unwrap();
        assert_eq!(first.obstacles.len(), 1);
        assert_eq!((first.obstacles[0].nearest_m, first.obstacles[0].distance_m), ([90.0, 0.0, 50.0], 90.0));
        assert_eq!(first.shape(&first.obstacles[0]).unwrap().id, ObstacleId(1));
        assert!(view.senses(DroneId(1)).unwrap().obstacles.is_empty());
        assert_eq!(view.senses(DroneId(2)).unwrap().obstacles[0].distance_m, 70.0);
        assert_eq!((down.shapes.len(), down.shapes[0].shape), (1, shapes[1]));
    }

    #[test]
    fn dead_drones_sense_nothing_but_are_sensed() {
        let mut all = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
        all[1].kill();
        let down = sensed(&all, &[rectangle(80.0, 0.0, 10.0, 10.0)], Some(66.0));
        let (living, dead) = (down.view().senses(DroneId(0)).unwrap(), down.view().senses(DroneId(1)).unwrap());
        assert_eq!((living.obstacles.len(), living.neighbours[0].position_m), (1, [50.0, 0.0, 0.0]));
        assert!(dead.obstacles.is_empty() && dead.neighbours.is_empty());
        assert_eq!((down.drones[0].alive, down.drones[1].alive), (1, 0));
    }

    #[test]
    fn an_error_of_the_own_position_leaves_relative_measurements_right() {
        let (position_error_m, velocity_error_mps) = (Vec2::new(3.0, -1.0), Vec2::new(0.5, 0.0));
        let sensor_fault = SensorFault { position_error_m, velocity_error_mps, ..SensorFault::default() };
        let all = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
        let down = sensed_with(&all, &[rectangle(80.0, 0.0, 10.0, 10.0)], Some(66.0), sensor_fault);
        let senses = down.view().senses(DroneId(0)).unwrap();
        assert_eq!((senses.position_m, senses.velocity_mps), ([3.0, -1.0, 50.0], [0.5, 0.0, 0.0]));
        assert_eq!((senses.obstacles[0].nearest_m, senses.obstacles[0].distance_m), ([73.0, -1.0, 50.0], 70.0));
        assert_eq!(senses.neighbours[0].position_m, [50.0, 0.0, 0.0]);
    }

    #[test]
    fn ranging_can_be_off() {
        let blind = SensorFault { no_ranging: true, ..SensorFault::default() };
        let down = sensed_with(&bodies(&[[0.0, 0.0], [1.0, 0.0]]), &[], Some(9.0), blind);
        assert!(down.neighbours.is_empty());
        assert_eq!(down.view().senses(DroneId(1)).unwrap().broken, BrokenSensors { ranging: true, obstacles: false });
        assert_eq!(
            sensed_with(&bodies(&[[0.0, 0.0]]), &[], None, blind).drones[0].broken,
            0,
            "it has no ranging sensor"
        );
        assert!(sensed(&bodies(&[[0.0, 0.0], [1.0, 0.0]]), &[], None).neighbours.is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn neighbours_are_exactly_those_in_range_by_id(
            positions in prop::collection::vec([-300f64..300.0, -300f64..300.0], 1..120),
        ) {
            let all = bodies(&positions);
            let down = sensed(&all, &[], Some(60.0));
            for (i, body) in all.iter().enumerate() {
                let found: Vec<u32> =
                    down.view().senses(DroneId(i as u32)).unwrap().neighbours.iter().map(|n| n.drone.0).collect();
                let near = |other: &Body| (other.position() - body.position()).norm_squared() <= 3600.0;
                let wanted: Vec<u32> =
                    (0..all.len()).filter(|&j| j != i && near(&all[j])).map(|j| j as u32).collect();
                prop_assert_eq!(found, wanted);
            }
        }
    }
}
