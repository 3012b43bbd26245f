//! The schedule alone, on drones and obstacle sets made by hand.

use super::*;
use crate::drones::DroneTable;
use crate::event_log::EventLog;
use crate::fault_plan::{ClockDrift, FaultTrigger, Noise, PositionDrift, Wind};
use crate::geometry::{Nearest, Outline};
use crate::sensor_errors::RangingErrors;
use crate::stages::Stages;
use crate::sweep::Contact;
use crate::testing::rectangle;
use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED, Slot};
use skein_protocol::{Ballot, Course, GroupId, Phase, PlanStamp, Vec3};

/// Three drones and one obstacle set around x = 100 m.
struct Scene {
    drones: DroneTable,
    stages: Stages,
}

impl Scene {
    fn new() -> Self {
        Self {
            drones: DroneTable::new(&[0.0, -50.0, -100.0].map(|x| (Vec3::new(x, 0.0, 50.0), Vec3::zeros()))),
            stages: Stages::new(Course::East, &[Outline::new(&rectangle(100.0, 0.0, 5.0, 50.0))], 40.0),
        }
    }

    fn view(&self) -> FaultView<'_> {
        FaultView { drones: &self.drones, stages: &self.stages }
    }

    fn detect(&mut self) {
        let nearest = Nearest { point: Vec3::zeros(), distance_m: 60.0 };
        let contacts = [Contact { drone: 0, obstacle: 0, nearest }];
        self.stages.detect(&contacts, self.drones.bodies(), SimTime::ZERO, &mut EventLog::default());
    }

    /// Lets a drone obey the plan of this epoch.
    fn obey(&mut self, drone: u32, epoch: u32, phase: Phase, flags: u32) {
        self.obey_leading(drone, epoch, phase, flags, GroupId::ALL);
    }

    fn obey_leading(&mut self, drone: u32, epoch: u32, phase: Phase, flags: u32, led: GroupId) {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
        let slot = Slot { obeyed: PlanStamp { ballot, epoch }, phase: phase.to_wire(), flags, led, ..Slot::default() };
        self.drones.take_slot(DroneId(drone), &slot);
    }
}

fn fault(effect: FaultEffect, time: FaultTime, targets: FaultTargets, for_s: f64) -> Fault {
    Fault { effect, time, targets, for_s }
}

fn schedule(faults: Vec<Fault>) -> FaultSchedule {
    FaultSchedule::new(FaultPlan { seed: 5, faults }, 3)
}

fn at(seconds: f64) -> SimTime {
    SimTime::from_secs(seconds)
}

/// All faults that begin at an instant, with the drones they affect.
fn begun(schedule: &mut FaultSchedule, now: SimTime, scene: &Scene) -> Vec<(usize, Vec<u32>)> {
    schedule.observe(now, &scene.view());
    let changes = std::iter::from_fn(|| schedule.begin(now, &scene.view()));
    changes.map(|change| (change.fault, change.drones.iter().map(|id| id.0).collect())).collect()
}

fn one(drone: u32) -> FaultTargets {
    FaultTargets::Drones(vec![DroneId(drone)])
}

#[test]
fn a_fault_is_in_force_from_its_time_to_its_end() {
    let (scene, mut schedule) =
        (Scene::new(), schedule(vec![fault(FaultEffect::Deaf, FaultTime::At(1.0), one(1), 2.0)]));
    assert_eq!(begun(&mut schedule, at(0.98), &scene), []);
    assert_eq!(begun(&mut schedule, at(1.0), &scene), [(0, vec![1])]);
    assert_eq!(
        (schedule.standing(DroneId(1)).link_faults.deaf, schedule.standing(DroneId(0)).link_faults.deaf),
        (1, 0)
    );
    assert_eq!(begun(&mut schedule, at(1.02), &scene), [], "it begins once");
    assert_eq!(schedule.end(at(2.98)), []);
    assert_eq!(schedule.end(at(3.0)), [FaultChange { fault: 0, drones: vec![DroneId(1)] }]);
    assert_eq!(schedule.standing(DroneId(1)).link_faults.deaf, 0);
}

#[test]
fn effects_of_several_faults_add_up() {
    let wall = FaultEffect::Partition(vec![vec![DroneId(0)], vec![DroneId(1), DroneId(2)]]);
    let scene = Scene::new();
    let mut schedule = schedule(vec![
        fault(FaultEffect::Slow(0.2), FaultTime::At(0.0), FaultTargets::All, f64::INFINITY),
        fault(FaultEffect::Slow(0.3), FaultTime::At(0.0), one(0), 1.0),
        fault(FaultEffect::Blind { obstacles: true, ranging: false }, FaultTime::At(0.0), one(0), 1.0),
        fault(wall, FaultTime::At(0.0), FaultTargets::All, 1.0),
        fault(FaultEffect::Mute, FaultTime::At(0.0), one(2), 1.0),
    ]);
    assert_eq!(begun(&mut schedule, at(0.0), &scene).len(), 5);
    let (first, second) = (*schedule.standing(DroneId(0)), *schedule.standing(DroneId(1)));
    assert_eq!((first.extra_reaction_s, second.extra_reaction_s), (0.5, 0.2));
    assert!(first.no_obstacles && !first.no_ranging && !second.no_obstacles);
    assert!(first.link_faults.partitions.separates(second.link_faults.partitions));
    assert!(!second.link_faults.partitions.separates(schedule.standing(DroneId(2)).link_faults.partitions));
    assert_eq!(schedule.standing(DroneId(2)).link_faults.mute, 1);
    schedule.end(at(1.0));
    assert_eq!(
        (schedule.standing(DroneId(0)).extra_reaction_s, schedule.standing(DroneId(2)).link_faults.mute),
        (0.2, 0)
    );
}

#[test]
fn a_fault_waits_for_its_role_and_skips_named_drones_that_are_dead() {
    let mut scene = Scene::new();
    scene.drones.kill(DroneId(2));
    let mut schedule = schedule(vec![
        fault(FaultEffect::Kill, FaultTime::At(0.0), FaultTargets::Leader, f64::INFINITY),
        fault(FaultEffect::Kill, FaultTime::At(0.0), one(2), f64::INFINITY),
        fault(FaultEffect::Restart, FaultTime::At(0.0), one(2), 1.0),
        fault(FaultEffect::Restart, FaultTime::At(0.5), one(2), 1.0),
    ]);
    assert_eq!(begun(&mut schedule, at(0.0), &scene), [(1, vec![]), (2, vec![2])]);
    assert!(schedule.awaits_restart(DroneId(2)) && schedule.awaits_restarts());
    assert_eq!(begun(&mut schedule, at(0.5), &scene), [(3, vec![])], "a restart is in force already");
    scene.obey(1, 1, Phase::Cruise, SLOT_LEADS);
    assert_eq!(begun(&mut schedule, at(0.6), &scene), [(0, vec![1])]);
    assert_eq!(schedule.end(at(1.0)).len(), 1);
    assert!(!schedule.awaits_restarts());
}

/// One fault per event, without delay.
fn waiting_for(events: &[(FaultTrigger, usize)]) -> FaultSchedule {
    let when = |&(event, stage): &(FaultTrigger, usize)| FaultTime::On { event, stage, after_s: 0.0 };
    schedule(events.iter().map(|event| fault(FaultEffect::Deaf, when(event), FaultTargets::All, 1.0)).collect())
}

fn places(schedule: &mut FaultSchedule, now: SimTime, scene: &Scene) -> Vec<usize> {
    begun(schedule, now, scene).into_iter().map(|(place, _)| place).collect()
}

#[test]
fn events_about_an_obstacle_set_are_seen_in_their_order() {
    let mut scene = Scene::new();
    let mut schedule = waiting_for(&[
        (FaultTrigger::Detected, 0),
        (FaultTrigger::Grouped, 0),
        (FaultTrigger::Queued, 0),
        (FaultTrigger::Gate, 0),
        (FaultTrigger::Reforming, 0),
        (FaultTrigger::Passed, 0),
        (FaultTrigger::Detected, 1),
    ]);
    // A plan that was obeyed before the detection is not for this set.
    scene.obey(0, 1, Phase::Avoid, SLOT_QUEUED);
    assert_eq!(places(&mut schedule, at(0.0), &scene), [0usize; 0]);
    scene.detect();
    assert_eq!(places(&mut schedule, at(1.0), &scene), [0]);
    scene.obey(0, 2, Phase::Avoid, 0);
    assert_eq!(places(&mut schedule, at(2.0), &scene), [1]);
    scene.obey(1, 2, Phase::Avoid, SLOT_QUEUED);
    assert_eq!(places(&mut schedule, at(3.0), &scene), [2]);
    scene.drones.place(0, Vec3::new(100.0, 0.0, 50.0));
    assert_eq!(places(&mut schedule, at(4.0), &scene), [3]);
    // A drone that re-forms before the set does not count.
    scene.obey(1, 3, Phase::Reform, 0);
    assert_eq!(places(&mut schedule, at(5.0), &scene), [0usize; 0]);
    scene.obey(0, 3, Phase::Reform, 0);
    assert_eq!(places(&mut schedule, at(6.0), &scene), [4]);
    for drone in 0..3 {
        scene.drones.place(drone, Vec3::new(200.0, 0.0, 50.0));
    }
    scene.stages.pass(scene.drones.bodies(), at(7.0), &mut EventLog::default());
    assert_eq!(places(&mut schedule, at(7.0), &scene), [5], "there is no second set");
}

#[test]
fn elections_are_counted() {
    let mut scene = Scene::new();
    let mut schedule = waiting_for(&[
        (FaultTrigger::LeaderElected, 0),
        (FaultTrigger::LeaderElected, 1),
        (FaultTrigger::GroupLeaderElected, 0),
    ]);
    assert_eq!(places(&mut schedule, at(0.0), &scene), [0usize; 0]);
    scene.obey(0, 1, Phase::Cruise, SLOT_LEADS);
    assert_eq!(places(&mut schedule, at(1.0), &scene), [0]);
    scene.obey(0, 2, Phase::Cruise, SLOT_LEADS);
    assert_eq!(places(&mut schedule, at(2.0), &scene), [0usize; 0], "the same term is no new election");
    scene.obey_leading(1, 1, Phase::Cruise, SLOT_LEADS, GroupId::ALL.child(1));
    assert_eq!(places(&mut schedule, at(3.0), &scene), [1, 2]);
}

#[test]
fn the_delay_counts_from_the_event() {
    let mut scene = Scene::new();
    let time = FaultTime::On { event: FaultTrigger::Detected, stage: 0, after_s: 0.5 };
    let mut schedule = schedule(vec![fault(FaultEffect::Deaf, time, FaultTargets::All, 1.0)]);
    scene.detect();
    assert_eq!(places(&mut schedule, at(2.0), &scene), [0usize; 0]);
    assert_eq!(places(&mut schedule, at(2.48), &scene), [0usize; 0]);
    assert_eq!(places(&mut schedule, at(2.5), &scene), [0]);
}

#[test]
fn noise_is_drawn_in_each_tick_and_gusts_last() {
    let bias = Vec2::new(2.0, 0.0);
    let noise =
        Noise { position_bias_m: bias, position_std_m: 0.5, velocity_bias_mps: Vec2::zeros(), velocity_std_mps: 0.0 };
    let wind = Wind { acceleration_mps2: Vec2::new(0.0, 1.0), gust_mps2: 0.3, gust_s: 2.0 };
    let mut schedule = schedule(vec![
        fault(FaultEffect::Noise(noise), FaultTime::At(0.0), one(0), f64::INFINITY),
        fault(
            FaultEffect::Wind(wind),
            FaultTime::At(0.0),
            FaultTargets::Drones(vec![DroneId(2), DroneId(0)]),
            f64::INFINITY,
        ),
    ]);
    begun(&mut schedule, at(0.0), &Scene::new());
    let errors: Vec<Vec2> =
        (0..1000).map(|tick| schedule.sensor_fault(DroneId(0), (tick, at(0.0))).position_error_m).collect();
    let mean = errors.iter().sum::<Vec2>() / 1000.0;
    // Five standard errors of a mean of 1000 draws.
    assert!((mean - bias).amax() < 5.0 * 0.5 / 1000f64.sqrt(), "{mean}");
    assert_eq!(schedule.sensor_fault(DroneId(0), (7, at(0.0))).velocity_error_mps, Vec2::zeros());
    assert_eq!(schedule.sensor_fault(DroneId(1), (7, at(0.0))).position_error_m, Vec2::zeros());
    let blown = |drone, seconds| schedule.wind_mps2(DroneId(drone), at(seconds));
    assert_eq!(blown(0, 0.1), blown(0, 1.9));
    assert_ne!(blown(0, 1.9), blown(0, 2.1));
    assert_ne!(blown(0, 0.1), blown(2, 0.1));
    assert_eq!(blown(1, 0.1), Vec2::zeros());
}

#[test]
fn positions_and_clocks_drift_from_the_beginning_of_their_faults() {
    let drift = PositionDrift { bias_m: Vec2::new(1.0, 0.0), drift_mps: Vec2::new(0.5, 0.0), max_m: 3.0 };
    let clock = ClockDrift { offset_s: -0.5, drift_ppm: 1000.0 };
    let mut schedule = schedule(vec![
        fault(FaultEffect::Gnss(drift), FaultTime::At(2.0), one(0), 10.0),
        fault(FaultEffect::Gnss(PositionDrift { max_m: f64::INFINITY, ..drift }), FaultTime::At(2.0), one(1), 10.0),
        fault(FaultEffect::Clock(clock), FaultTime::At(2.0), FaultTargets::All, 10.0),
        fault(FaultEffect::Clock(clock), FaultTime::At(2.0), one(2), 1.0),
    ]);
    let scene = Scene::new();
    let told = |schedule: &FaultSchedule, drone, seconds| {
        let fault = schedule.sensor_fault(DroneId(drone), (0, at(seconds)));
        (fault.gnss_error_m.x, fault.clock_error_s)
    };
    assert_eq!(told(&schedule, 0, 1.0), (0.0, 0.0));
    begun(&mut schedule, at(2.0), &scene);
    assert_eq!(told(&schedule, 0, 2.0), (1.0, -0.5), "a jump");
    assert_eq!(told(&schedule, 0, 4.0), (2.0, -0.498));
    assert_eq!((told(&schedule, 0, 11.0).0, told(&schedule, 1, 11.0).0), (3.0, 5.5), "up to its bound");
    assert_eq!(told(&schedule, 2, 2.0), (0.0, -1.0), "faults add up");
    schedule.end(at(12.0));
    assert_eq!(told(&schedule, 0, 12.0), (0.0, 0.0), "the truth is back at once");
}

#[test]
fn of_several_faults_of_ranging_the_worst_counts() {
    let first = RangingErrors {
        dropout_share: 0.5,
        std_m: 1.0,
        latency_s: 0.1,
        field_rad: 2.0,
        occlusion: true,
        ..RangingErrors::default()
    };
    let second = RangingErrors {
        dropout_share: 0.2,
        outlier_share: 0.1,
        outlier_m: 4.0,
        latency_s: 0.3,
        field_rad: 3.0,
        ..RangingErrors::default()
    };
    let mut schedule = schedule(vec![
        fault(FaultEffect::Ranging(first), FaultTime::At(0.0), one(0), 1.0),
        fault(FaultEffect::Ranging(second), FaultTime::At(0.0), FaultTargets::All, 2.0),
    ]);
    begun(&mut schedule, at(0.0), &Scene::new());
    let both = RangingErrors { dropout_share: 0.5, std_m: 1.0, field_rad: 2.0, occlusion: true, ..second };
    assert_eq!((schedule.standing(DroneId(0)).ranging, schedule.standing(DroneId(1)).ranging), (both, second));
    assert!(!schedule.standing(DroneId(0)).no_ranging, "the drone does not know of it");
    schedule.end(at(1.0));
    assert_eq!(schedule.standing(DroneId(0)).ranging, second);
}
