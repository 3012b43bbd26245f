//! What each drone senses, written into the downlink.

use crate::body::Body;
use crate::sensor_errors::RangingErrors;
use crate::sensor_fault::SensorFault;
use crate::sensor_model::SensorModel;
use crate::sweep::{Contact, SensorSweep};
use skein_protocol::downlink::{Downlink, SensedNeighbour, SensedObstacle, SensedShape, SensesHeader};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, ObstacleId, SimTime, Vec2, Vec3, raised};
use std::borrow::Borrow;

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
    /// by id.
    pub(crate) fn write<F: Borrow<SensorFault>>(
        &mut self,
        sensed: &Sensed<'_>,
        drones: impl Iterator<Item = (u32, F)>,
        down: &mut Downlink,
    ) {
        down.drones.clear();
        down.obstacles.clear();
        down.neighbours.clear();
        down.shapes.clear();
        self.places.fill(NOT_WRITTEN);
        let mut contacts = sensed.sweep.contacts().iter().peekable();
        for ((drone, body), (incarnation, sensor_fault)) in sensed.bodies.iter().enumerate().zip(drones) {
            let sensor_fault = sensor_fault.borrow();
            let (obstacle_first, neighbour_first) = (down.obstacles.len() as u32, down.neighbours.len() as u32);
            while let Some(contact) = contacts.next_if(|contact| contact.drone as usize == drone) {
                if body.is_alive() {
                    self.write_contact(contact, sensed, sensor_fault, down);
                }
            }
            if body.is_alive() && !sensor_fault.no_ranging {
                sensed.write_neighbours(drone, &sensor_fault.ranging, down);
            }
            let fault_m = sensor_fault.position_error_m + sensor_fault.gnss_error_m;
            let position_error_m = fault_m + sensed.model.position_m(drone);
            let SimTime(clock_fault_ns) = SimTime::from_secs(sensor_fault.clock_error_s);
            down.drones.push(SensesHeader {
                position_m: shifted(body.position(), position_error_m),
                velocity_mps: shifted(body.velocity(), sensor_fault.velocity_error_mps),
                obstacle_first,
                obstacle_count: down.obstacles.len() as u32 - obstacle_first,
                neighbour_first,
                neighbour_count: down.neighbours.len() as u32 - neighbour_first,
                alive: u32::from(body.is_alive()),
                incarnation,
                link_faults: sensor_fault.link_faults,
                extra_reaction_s: sensor_fault.extra_reaction_s,
                clock_error_ns: sensed.model.clock_ns(drone, sensed.now) + clock_fault_ns,
                broken: sensor_fault.broken(sensed.ranging_m.is_some()).to_wire(),
                reserved: 0,
            });
        }
    }

    /// A drone measures an obstacle relative to itself, so an error of its own position moves the obstacle with it.
    fn write_contact(&mut self, contact: &Contact, sensed: &Sensed<'_>, fault: &SensorFault, down: &mut Downlink) {
        let (drone, obstacle) = (contact.drone as usize, contact.obstacle as usize);
        let (model, position) = (sensed.model, sensed.bodies[drone].position());
        let mut nearest = contact.nearest;
        let displaced_m = model.obstacle_m(drone, contact.obstacle).unwrap_or_default();
        if displaced_m != Vec2::zeros() {
            let aside = displaced_m.push(0.0);
            nearest = sensed.sweep.outlines()[obstacle].nearest(position - aside);
            nearest.point += aside;
        }
        let own_m = fault.position_error_m + fault.gnss_error_m + model.position_m(drone);
        let own_outline = model.draws_own_outlines() || fault.gnss_error_m != Vec2::zeros();
        let mut place = self.places[obstacle];
        if own_outline || place == NOT_WRITTEN {
            place = down.shapes.len() as u32;
            let whole = &self.shapes[obstacle];
            let shape = if own_outline {
                model.outline(whole, position.xy() - displaced_m).moved(own_m + displaced_m)
            } else {
                self.places[obstacle] = place;
                *whole
            };
            down.shapes.push(SensedShape { shape, id: ObstacleId(contact.obstacle), reserved: 0 });
        }
        down.obstacles.push(SensedObstacle {
            nearest_m: shifted(nearest.point, own_m),
            distance_m: nearest.distance_m,
            shape: place,
            reserved: 0,
        });
    }
}

/// What the senses of a tick are made from.
#[derive(Clone, Copy)]
pub(crate) struct Sensed<'a> {
    /// The bodies of all drones, by id.
    pub(crate) bodies: &'a [Body],
    /// What is around them.
    pub(crate) sweep: &'a SensorSweep,
    /// Greatest distance at which a drone senses a neighbour, m; `None`: drones sense no neighbours.
    pub(crate) ranging_m: Option<f64>,
    /// The errors of this tick.
    pub(crate) model: &'a SensorModel,
    /// The time at which the tick begins.
    pub(crate) now: SimTime,
}

impl Sensed<'_> {
    fn write_neighbours(&self, drone: usize, fault: &RangingErrors, down: &mut Downlink) {
        let Some(range_m) = self.ranging_m else { return };
        for &id in self.sweep.neighbours_of(drone) {
            let other = id as usize;
            if (self.bodies[other].position() - self.bodies[drone].position()).norm_squared() > range_m * range_m {
                continue;
            }
            let measured = self.model.range((drone, other), fault, self.bodies, self.sweep.outlines());
            down.neighbours.extend(measured.map(|(position, velocity)| SensedNeighbour {
                position_m: position.into(),
                velocity_mps: velocity.into(),
                drone: DroneId(id),
                reserved: 0,
            }));
        }
    }
}

/// A point or vector with a horizontal error.
fn shifted(value: Vec3, error: Vec2) -> [f64; 3] {
    raised(value.xy() + error, value.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::sweep::SweepRange;
    use crate::testing::{bodies, params, rectangle};
    use proptest::prelude::*;
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
        sensed_by(bodies, shapes, ranging_m, std::iter::repeat(sensor_fault))
    }

    fn sensed_by(
        bodies: &[Body],
        shapes: &[ConvexShape],
        ranging_m: Option<f64>,
        faults: impl Iterator<Item = SensorFault>,
    ) -> Downlink {
        let mut sweep = SensorSweep::new(shapes.iter().map(Outline::new).collect());
        let mut down = Downlink::default();
        sweep.sweep(bodies, RANGE);
        let drones = faults.map(|fault| (1, fault));
        let model = SensorModel::new(&params(), bodies.len());
        let sensed = Sensed { bodies, sweep: &sweep, ranging_m, model: &model, now: SimTime::ZERO };
        SenseWriter::new(shapes).write(&sensed, drones, &mut down);
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
    fn a_wrong_position_moves_the_outlines_that_this_drone_alone_senses() {
        let gnss_error_m = Vec2::new(3.0, -1.0);
        let drones = [SensorFault::default(), SensorFault { gnss_error_m, ..SensorFault::default() }];
        let shapes = [rectangle(80.0, 0.0, 10.0, 10.0)];
        let all = bodies(&[[0.0, 0.0], [0.0, 5.0], [0.0, -5.0]]);
        let down = sensed_by(&all, &shapes, None, [drones[0], drones[1], drones[0]].into_iter());
        let outline = |drone| {
            let senses = down.view().senses(DroneId(drone)).unwrap();
            let sensed = senses.obstacles[0];
            (senses.shape(&sensed).unwrap().shape, sensed.nearest_m, senses.position_m)
        };
        let (shape, nearest_m, position_m) = outline(1);
        assert_eq!((shape, nearest_m), (shapes[0].moved(gnss_error_m), [73.0, 4.0, 50.0]));
        assert_eq!(position_m, [3.0, 4.0, 50.0]);
        assert_eq!((outline(0).0, outline(2).0, down.shapes.len()), (shapes[0], shapes[0], 2));
    }

    #[test]
    fn ranging_fails_and_clocks_jump_without_a_word() {
        let silent = RangingErrors { dropout_share: 1.0, ..RangingErrors::default() };
        let fault = SensorFault { ranging: silent, clock_error_s: -0.25, ..SensorFault::default() };
        let down = sensed_with(&bodies(&[[0.0, 0.0], [1.0, 0.0]]), &[], Some(9.0), fault);
        assert!(down.neighbours.is_empty());
        assert_eq!((down.drones[0].broken, down.drones[0].clock_error_ns), (0, -250_000_000));
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
