//! The engine alone, on scenes made by hand.

use super::*;
use crate::body::Body;
use crate::faults::{FaultTrigger, Noise, Wind};
use crate::geometry::Outline;
use crate::log::Log;
use crate::process::Process;
use crate::senses::Contact;
use crate::stages::Stages;
use crate::testing::{bodies, rectangle};
use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED};
use skein_protocol::{Ballot, GroupId, Phase, PlanStamp};

/// Three drones and one obstacle set around x = 100 m.
struct Stage {
    bodies: Vec<Body>,
    processes: Vec<Process>,
    stages: Stages,
}

impl Stage {
    fn new() -> Self {
        Self {
            bodies: bodies(&[[0.0, 0.0], [-50.0, 0.0], [-100.0, 0.0]]),
            processes: vec![Process::default(); 3],
            stages: Stages::new(&[Outline::new(&rectangle(100.0, 0.0, 5.0, 50.0))], 40.0),
        }
    }

    fn scene(&self) -> Scene<'_> {
        Scene { bodies: &self.bodies, processes: &self.processes, stages: &self.stages }
    }

    fn detect(&mut self) {
        let nearest = crate::geometry::Nearest { point: Vec2::zeros(), distance_m: 60.0 };
        self.stages.detect(&[Contact { drone: 0, obstacle: 0, nearest }], SimTime::ZERO, &mut Log::default());
    }

    /// Lets a drone obey the plan of this epoch.
    fn obey(&mut self, drone: usize, epoch: u32, phase: Phase, flags: u32) {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
        let slot = &mut self.processes[drone].slot;
        (slot.obeyed, slot.phase, slot.flags) = (PlanStamp { ballot, epoch }, phase.to_wire(), flags);
    }
}

fn fault(effect: FaultEffect, time: FaultTime, targets: FaultTargets, for_s: f64) -> Fault {
    Fault { effect, time, targets, for_s }
}

fn engine(faults: Vec<Fault>) -> Engine {
    Engine::new(FaultPlan { seed: 5, faults }, 3)
}

fn at(seconds: f64) -> SimTime {
    SimTime::from_secs(seconds)
}

/// All that begins at an instant.
fn begun(engine: &mut Engine, now: SimTime, stage: &Stage) -> Vec<(usize, Vec<u32>)> {
    engine.observe(now, &stage.scene());
    let turns = std::iter::from_fn(|| engine.begin(now, &stage.scene()));
    turns.map(|turn| (turn.fault, turn.drones.iter().map(|id| id.0).collect())).collect()
}

fn one(drone: u32) -> FaultTargets {
    FaultTargets::Drones(vec![DroneId(drone)])
}

#[test]
fn a_fault_is_in_force_from_its_time_to_its_end() {
    let (stage, mut engine) = (Stage::new(), engine(vec![fault(FaultEffect::Deaf, FaultTime::At(1.0), one(1), 2.0)]));
    assert_eq!(begun(&mut engine, at(0.98), &stage), []);
    assert_eq!(begun(&mut engine, at(1.0), &stage), [(0, vec![1])]);
    assert_eq!((engine.standing(DroneId(1)).cuts.deaf, engine.standing(DroneId(0)).cuts.deaf), (1, 0));
    assert_eq!(begun(&mut engine, at(1.02), &stage), [], "once");
    assert_eq!(engine.end(at(2.98)), []);
    assert_eq!(engine.end(at(3.0)), [Turn { fault: 0, drones: vec![DroneId(1)] }]);
    assert_eq!(engine.standing(DroneId(1)).cuts.deaf, 0);
}

#[test]
fn faults_add_up() {
    let wall = FaultEffect::Partition(vec![vec![DroneId(0)], vec![DroneId(1), DroneId(2)]]);
    let stage = Stage::new();
    let mut engine = engine(vec![
        fault(FaultEffect::Slow(0.2), FaultTime::At(0.0), FaultTargets::All, f64::INFINITY),
        fault(FaultEffect::Slow(0.3), FaultTime::At(0.0), one(0), 1.0),
        fault(FaultEffect::Blind { obstacles: true, ranging: false }, FaultTime::At(0.0), one(0), 1.0),
        fault(wall, FaultTime::At(0.0), FaultTargets::All, 1.0),
        fault(FaultEffect::Mute, FaultTime::At(0.0), one(2), 1.0),
    ]);
    assert_eq!(begun(&mut engine, at(0.0), &stage).len(), 5);
    let (first, second) = (*engine.standing(DroneId(0)), *engine.standing(DroneId(1)));
    assert_eq!((first.extra_reaction_s, second.extra_reaction_s), (0.5, 0.2));
    assert!(first.no_obstacles && !first.no_ranging && !second.no_obstacles);
    assert!(first.cuts.partitions.separates(second.cuts.partitions));
    assert!(!second.cuts.partitions.separates(engine.standing(DroneId(2)).cuts.partitions));
    assert_eq!(engine.standing(DroneId(2)).cuts.mute, 1);
    engine.end(at(1.0));
    assert_eq!((engine.standing(DroneId(0)).extra_reaction_s, engine.standing(DroneId(2)).cuts.mute), (0.2, 0));
}

#[test]
fn a_role_is_waited_for_and_the_named_dead_are_left_out() {
    let mut stage = Stage::new();
    stage.bodies[2].alive = false;
    let mut engine = engine(vec![
        fault(FaultEffect::Kill, FaultTime::At(0.0), FaultTargets::Leader, f64::INFINITY),
        fault(FaultEffect::Kill, FaultTime::At(0.0), one(2), f64::INFINITY),
        fault(FaultEffect::Restart, FaultTime::At(0.0), one(2), 1.0),
        fault(FaultEffect::Restart, FaultTime::At(0.5), one(2), 1.0),
    ]);
    assert_eq!(begun(&mut engine, at(0.0), &stage), [(1, vec![]), (2, vec![2])]);
    assert!(engine.awaits_restart(DroneId(2)) && engine.awaits_restarts());
    assert_eq!(begun(&mut engine, at(0.5), &stage), [(3, vec![])], "it is to be started already");
    stage.obey(1, 1, Phase::Cruise, SLOT_LEADS);
    assert_eq!(begun(&mut engine, at(0.6), &stage), [(0, vec![1])]);
    assert_eq!(engine.end(at(1.0)).len(), 1);
    assert!(!engine.awaits_restarts());
}

/// A fault that follows each event at once.
fn waiting_for(events: &[(FaultTrigger, usize)]) -> Engine {
    let when = |&(event, stage): &(FaultTrigger, usize)| FaultTime::On { event, stage, after_s: 0.0 };
    engine(events.iter().map(|event| fault(FaultEffect::Deaf, when(event), FaultTargets::All, 1.0)).collect())
}

fn places(engine: &mut Engine, now: SimTime, stage: &Stage) -> Vec<usize> {
    begun(engine, now, stage).into_iter().map(|(place, _)| place).collect()
}

#[test]
fn events_of_an_obstacle_set_are_seen_in_their_order() {
    let mut stage = Stage::new();
    let mut engine = waiting_for(&[
        (FaultTrigger::Detected, 0),
        (FaultTrigger::Grouped, 0),
        (FaultTrigger::Queued, 0),
        (FaultTrigger::Gate, 0),
        (FaultTrigger::Reforming, 0),
        (FaultTrigger::Passed, 0),
        (FaultTrigger::Detected, 1),
    ]);
    // An old plan to avoid is no plan for a set that is detected later.
    stage.obey(0, 1, Phase::Avoid, SLOT_QUEUED);
    assert_eq!(places(&mut engine, at(0.0), &stage), [0usize; 0]);
    stage.detect();
    assert_eq!(places(&mut engine, at(1.0), &stage), [0]);
    stage.obey(0, 2, Phase::Avoid, 0);
    assert_eq!(places(&mut engine, at(2.0), &stage), [1]);
    stage.obey(1, 2, Phase::Avoid, SLOT_QUEUED);
    assert_eq!(places(&mut engine, at(3.0), &stage), [2]);
    stage.bodies[0].position.x = 100.0;
    assert_eq!(places(&mut engine, at(4.0), &stage), [3]);
    // Who re-forms before the set does not count.
    stage.obey(1, 3, Phase::Reform, 0);
    assert_eq!(places(&mut engine, at(5.0), &stage), [0usize; 0]);
    stage.obey(0, 3, Phase::Reform, 0);
    assert_eq!(places(&mut engine, at(6.0), &stage), [4]);
    stage.bodies.iter_mut().for_each(|body| body.position.x = 200.0);
    stage.stages.pass(&stage.bodies, at(7.0), &mut Log::default());
    assert_eq!(places(&mut engine, at(7.0), &stage), [5], "and there is no second set");
}

#[test]
fn elections_are_counted() {
    let mut stage = Stage::new();
    let mut engine = waiting_for(&[
        (FaultTrigger::LeaderElected, 0),
        (FaultTrigger::LeaderElected, 1),
        (FaultTrigger::GroupLeaderElected, 0),
    ]);
    assert_eq!(places(&mut engine, at(0.0), &stage), [0usize; 0]);
    stage.obey(0, 1, Phase::Cruise, SLOT_LEADS);
    assert_eq!(places(&mut engine, at(1.0), &stage), [0]);
    stage.obey(0, 2, Phase::Cruise, SLOT_LEADS);
    assert_eq!(places(&mut engine, at(2.0), &stage), [0usize; 0], "the same term");
    stage.obey(1, 1, Phase::Cruise, SLOT_LEADS);
    stage.processes[1].slot.led = GroupId::ALL.child(1);
    assert_eq!(places(&mut engine, at(3.0), &stage), [1, 2]);
}

#[test]
fn after_an_event_counts_from_it() {
    let mut stage = Stage::new();
    let time = FaultTime::On { event: FaultTrigger::Detected, stage: 0, after_s: 0.5 };
    let mut engine = engine(vec![fault(FaultEffect::Deaf, time, FaultTargets::All, 1.0)]);
    stage.detect();
    assert_eq!(places(&mut engine, at(2.0), &stage), [0usize; 0]);
    assert_eq!(places(&mut engine, at(2.48), &stage), [0usize; 0]);
    assert_eq!(places(&mut engine, at(2.5), &stage), [0]);
}

#[test]
fn noise_is_drawn_each_tick_and_gusts_last() {
    let bias = Vec2::new(2.0, 0.0);
    let noise =
        Noise { position_bias_m: bias, position_std_m: 0.5, velocity_bias_mps: Vec2::zeros(), velocity_std_mps: 0.0 };
    let wind = Wind { acceleration_mps2: Vec2::new(0.0, 1.0), gust_mps2: 0.3, gust_s: 2.0 };
    let mut engine = engine(vec![
        fault(FaultEffect::Noise(noise), FaultTime::At(0.0), one(0), f64::INFINITY),
        fault(
            FaultEffect::Wind(wind),
            FaultTime::At(0.0),
            FaultTargets::Drones(vec![DroneId(2), DroneId(0)]),
            f64::INFINITY,
        ),
    ]);
    begun(&mut engine, at(0.0), &Stage::new());
    let errors: Vec<Vec2> = (0..1000).map(|tick| engine.sensor_fault(DroneId(0), tick).position_error_m).collect();
    let mean = errors.iter().sum::<Vec2>() / 1000.0;
    // Five standard errors of a mean of 1000.
    assert!((mean - bias).amax() < 5.0 * 0.5 / 1000f64.sqrt(), "{mean}");
    assert_eq!(engine.sensor_fault(DroneId(0), 7).velocity_error_mps, Vec2::zeros());
    assert_eq!(engine.sensor_fault(DroneId(1), 7).position_error_m, Vec2::zeros());
    let blown = |drone, seconds| engine.wind_mps2(DroneId(drone), at(seconds));
    assert_eq!(blown(0, 0.1), blown(0, 1.9));
    assert_ne!(blown(0, 1.9), blown(0, 2.1));
    assert_ne!(blown(0, 0.1), blown(2, 0.1));
    assert_eq!(blown(1, 0.1), Vec2::zeros());
}
