//! Obstacle sets on the way, by the true state: when a drone first senses each set, and when all drones are past it.

use crate::body::Body;
use crate::event_log::EventLog;
use crate::geometry::Outline;
use crate::sweep::Contact;
use skein_protocol::record::EventKind;
use skein_protocol::{Course, DroneId, ObstacleId, SimTime};

/// One set: obstacles whose extents along the flight overlap or nearly overlap.
#[derive(Clone, Debug)]
struct Stage {
    /// Mean of the centres of the obstacles' bounding boxes along the course, m.
    centre_x_m: f64,
    detected: bool,
    passed: bool,
}

/// All sets, in flight order. All abscissae are along the course.
#[derive(Clone, Debug)]
pub(crate) struct Stages {
    course: Course,
    stages: Vec<Stage>,
    obstacles: Vec<Extent>,
    begun_x_m: f64,
    past_x_m: f64,
}

/// Where an obstacle is along the flight.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    /// The number of its set.
    set: usize,
    front_x_m: f64,
    rear_x_m: f64,
    /// Between these altitudes it is in the way, m: its own, and the planning distance above and below.
    low_m: f64,
    high_m: f64,
}

impl Stages {
    /// Puts obstacles whose extents along the course are closer than `gap_m`, twice the planning distance, into one set.
    pub(crate) fn new(course: Course, outlines: &[Outline], gap_m: f64) -> Self {
        let extents: Vec<(f64, f64)> =
            outlines.iter().map(|outline| course.extent((outline.low(), outline.high()))).collect();
        let mut order: Vec<usize> = (0..outlines.len()).collect();
        order.sort_by(|&a, &b| extents[a].0.total_cmp(&extents[b].0));
        let obstacles = vec![Extent::default(); outlines.len()];
        let mut made =
            Self { course, stages: Vec::new(), obstacles, begun_x_m: f64::NEG_INFINITY, past_x_m: f64::NEG_INFINITY };
        let mut centres: Vec<f64> = Vec::new();
        let mut last_x_m = f64::NEG_INFINITY;
        for obstacle in order {
            let (front_x_m, rear_x_m) = extents[obstacle];
            if !centres.is_empty() && front_x_m - last_x_m >= gap_m {
                made.close(&centres);
                centres.clear();
            }
            let (floor_m, top_m) = outlines[obstacle].heights_m();
            let (low_m, high_m) = (floor_m - gap_m / 2.0, top_m + gap_m / 2.0);
            made.obstacles[obstacle] = Extent { set: made.stages.len(), front_x_m, rear_x_m, low_m, high_m };
            last_x_m = last_x_m.max(rear_x_m);
            centres.push((front_x_m + rear_x_m) / 2.0);
        }
        if !centres.is_empty() {
            made.close(&centres);
        }
        made
    }

    /// With obstacles that were all sensed.
    #[cfg(test)]
    pub(crate) fn sensed(outlines: &[Outline], gap_m: f64) -> Self {
        let mut made = Self::new(Course::East, outlines, gap_m);
        made.past_x_m = made.obstacles.iter().map(|obstacle| obstacle.rear_x_m).fold(f64::NEG_INFINITY, f64::max);
        made.begun_x_m = made.obstacles.iter().map(|obstacle| obstacle.front_x_m).fold(f64::NEG_INFINITY, f64::max);
        made
    }

    fn close(&mut self, centres: &[f64]) {
        let centre_x_m = centres.iter().sum::<f64>() / centres.len() as f64;
        self.stages.push(Stage { centre_x_m, detected: false, passed: false });
    }

    /// The greatest abscissa of the obstacles that living drones have sensed, m; −∞ without any. An obstacle that no drone ever senses
    /// lies beside the way, or beyond its end. One that drones fly over or under is not in the way.
    pub(crate) fn past_x_m(&self) -> f64 {
        self.past_x_m
    }

    /// The greatest abscissa at which such an obstacle begins, m; −∞ without any.
    pub(crate) fn begun_x_m(&self) -> f64 {
        self.begun_x_m
    }

    /// How far along the course a drone is, m.
    pub(crate) fn along_m(&self, body: &Body) -> f64 {
        self.course.along(body.position().xy())
    }

    /// Number of sets.
    pub(crate) fn count(&self) -> usize {
        self.stages.len()
    }

    /// Mean abscissa of the centres of the bounding boxes in a set, m.
    pub(crate) fn centre_x_m(&self, number: usize) -> f64 {
        self.stages[number].centre_x_m
    }

    /// The first set whose middle is ahead of this abscissa, m.
    pub(crate) fn ahead_of(&self, x_m: f64) -> Option<u32> {
        self.stages.iter().position(|stage| stage.centre_x_m > x_m).map(|number| number as u32)
    }

    /// Whether a living drone has sensed the set.
    pub(crate) fn is_detected(&self, number: usize) -> bool {
        self.stages[number].detected
    }

    /// Whether all living drones have passed the set.
    pub(crate) fn is_passed(&self, number: usize) -> bool {
        self.stages[number].passed
    }

    /// Logs the sets that are sensed for the first time, at the time when the tick opens.
    pub(crate) fn detect(&mut self, contacts: &[Contact], bodies: &[Body], opening: SimTime, log: &mut EventLog) {
        for contact in contacts {
            let Extent { set: number, front_x_m, rear_x_m, low_m, high_m } = self.obstacles[contact.obstacle as usize];
            let altitude_m = bodies[contact.drone as usize].position().z;
            if low_m < altitude_m && altitude_m < high_m {
                self.begun_x_m = self.begun_x_m.max(front_x_m);
                self.past_x_m = self.past_x_m.max(rear_x_m);
            }
            if !std::mem::replace(&mut self.stages[number].detected, true) {
                let what = EventKind::Detected {
                    stage: number as u32,
                    drone: DroneId(contact.drone),
                    obstacle: ObstacleId(contact.obstacle),
                    distance_m: contact.nearest.distance_m,
                };
                log.push(opening, what);
            }
        }
    }

    /// Logs the sets that the last living drone has passed, at the time when the tick ends.
    pub(crate) fn pass(&mut self, bodies: &[Body], end: SimTime, log: &mut EventLog) {
        let living = bodies.iter().filter(|body| body.is_alive()).map(|body| self.along_m(body));
        let Some(last) = living.reduce(f64::min) else { return };
        for (number, stage) in self.stages.iter_mut().enumerate() {
            if !stage.passed && last >= stage.centre_x_m {
                stage.passed = true;
                log.push(end, EventKind::Passed { stage: number as u32 });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event_log::tests::read;
    use crate::geometry::Nearest;
    use crate::testing::{bodies, event_kinds, rectangle};
    use skein_protocol::Vec3;

    /// The forest of the paper, its second set listed first.
    fn forest() -> Stages {
        let shapes = [
            rectangle(640.0, 45.0, 10.0, 15.0),
            rectangle(640.0, -45.0, 10.0, 15.0),
            rectangle(320.0, 0.0, 10.0, 110.0),
        ];
        Stages::new(Course::East, &shapes.each_ref().map(Outline::new), 40.0)
    }

    fn contact(drone: u32, obstacle: u32) -> Contact {
        Contact { drone, obstacle, nearest: Nearest { point: Vec3::zeros(), distance_m: 60.0 } }
    }

    #[test]
    fn sets_are_numbered_in_flight_order() {
        let sets: Vec<usize> = forest().obstacles.iter().map(|obstacle| obstacle.set).collect();
        assert_eq!(sets, [1, 1, 0]);
        assert_eq!(forest().stages.iter().map(|s| s.centre_x_m).collect::<Vec<_>>(), [320.0, 640.0]);
    }

    #[test]
    fn extents_closer_than_the_gap_are_one_set() {
        let sets = |x| {
            Stages::new(
                Course::East,
                &[rectangle(0.0, 0.0, 10.0, 5.0), rectangle(x, 90.0, 10.0, 5.0)].map(|s| Outline::new(&s)),
                40.0,
            )
        };
        assert_eq!(sets(59.9).stages.len(), 1);
        assert_eq!(sets(60.0).stages.len(), 2);
        assert_eq!(sets(59.0).stages[0].centre_x_m, 29.5);
    }

    #[test]
    fn detection_is_logged_once_per_set() {
        let (mut stages, mut log, all) = (forest(), EventLog::default(), bodies(&[[0.0, 0.0]; 5]));
        stages.detect(&[contact(3, 0), contact(4, 1)], &all, SimTime(5), &mut log);
        stages.detect(&[contact(0, 1), contact(0, 2)], &all, SimTime(6), &mut log);
        let detected = |stage, drone, obstacle| EventKind::Detected {
            stage,
            drone: DroneId(drone),
            obstacle: ObstacleId(obstacle),
            distance_m: 60.0,
        };
        assert_eq!(event_kinds(read(&mut log)), [detected(1, 3, 0), detected(0, 0, 2)]);
    }

    #[test]
    fn an_obstacle_that_drones_fly_over_is_not_in_the_way() {
        let low = |top_m| rectangle(100.0, 0.0, 10.0, 10.0).between(0.0, top_m).unwrap();
        let past_x_m = |top_m| {
            let mut stages = Stages::new(Course::East, &[Outline::new(&low(top_m))], 40.0);
            let above = [Body::new(Vec3::new(60.0, 0.0, 50.0), Vec3::zeros())];
            stages.detect(&[contact(0, 0)], &above, SimTime(5), &mut EventLog::default());
            assert!(stages.is_detected(0));
            stages.past_x_m()
        };
        assert_eq!((past_x_m(31.0), past_x_m(30.0)), (110.0, f64::NEG_INFINITY));
    }

    #[test]
    fn a_set_is_passed_when_the_last_living_drone_is_past_its_centre() {
        let (mut stages, mut log) = (forest(), EventLog::default());
        let mut all = bodies(&[[400.0, 0.0], [319.9, 0.0]]);
        stages.pass(&all, SimTime(1), &mut log);
        assert_eq!(read(&mut log), []);
        all[1].kill();
        stages.pass(&all, SimTime(2), &mut log);
        stages.pass(&all, SimTime(3), &mut log);
        assert_eq!(event_kinds(read(&mut log)), [EventKind::Passed { stage: 0 }]);
        all[0] = Body::new(Vec3::new(700.0, 0.0, 50.0), Vec3::zeros());
        all[0].kill();
        stages.pass(&all, SimTime(4), &mut log);
        assert_eq!(read(&mut log), [], "without living drones no set is passed");
    }

    #[test]
    fn without_obstacles_all_sets_are_passed() {
        let stages = Stages::new(Course::East, &[], 40.0);
        assert_eq!(stages.past_x_m, f64::NEG_INFINITY);
    }
}
