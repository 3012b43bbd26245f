//! A look-ahead with a minimal pilot: it flies straight on and arrives when it is in its slot.

use super::*;
use crate::test_params::planner;
use bytemuck::Zeroable;
use skein_leader::assignments::Assignments;
use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
use skein_protocol::payload::{Assignment, Plan};
use skein_protocol::{PlanStamp, Vec2};

const DT_S: f64 = 0.1;

#[derive(Clone, Debug, Default)]
struct Straight {
    obeyed: Option<Plan>,
}

impl Pilot for Straight {
    fn step(&mut self, _senses: &Senses<'_>, _inbox: &Inbox<'_>, _out: &mut Out) -> Command {
        Command::default()
    }
}

impl RolloutPilot for Straight {
    fn id(&self) -> DroneId {
        DroneId(0)
    }

    fn obey(&mut self, _now: SimTime, bundle: PlanBundle) {
        self.obeyed = Some(bundle.plan);
    }

    fn stamp(&self) -> PlanStamp {
        self.obeyed.map_or_else(PlanStamp::default, |plan| plan.id)
    }

    fn newest_stamp(&self) -> PlanStamp {
        self.stamp()
    }

    fn plan(&self) -> Option<&Plan> {
        self.obeyed.as_ref()
    }

    fn part_past(&self, _set: u32) -> Option<Assignment> {
        None
    }

    fn own_part(&self, _plan: &Plan, _position: Vec2) -> Assignment {
        Assignment::zeroed()
    }

    fn slot(&self) -> Option<Vec2> {
        Some(Vec2::zeros())
    }

    fn last_gate_x_m(&self) -> f64 {
        f64::NEG_INFINITY
    }
}

fn params() -> RolloutParams {
    RolloutParams {
        dt_s: DT_S,
        safe_distance_m: 30.0,
        clearance_m: 15.0,
        acceleration_max_mps2: 5.0,
        detection_range_m: 90.0,
        ranging_m: 60.0,
        speed_mps: 10.0,
        reform_speed_max_mps: 15.0,
        planner: planner(),
    }
}

/// A plan whose only slot is at this abscissa, m.
fn bundle(slot_x_m: f64) -> PlanBundle {
    let mut parts = Assignments::default();
    parts.add(&Assignment::zeroed());
    PlanBundle { plan: Plan { anchor_m: [slot_x_m, 0.0], ..Plan::zeroed() }, parts }
}

/// A look-ahead of one drone at the origin that flies with 10 m/s, over slots at these abscissas, m.
fn rollout(slots_m: &[f64]) -> Rollout<Straight> {
    let drone = RolloutDrone { pilot: Straight::default(), position: Vec2::zeros(), velocity: Vec2::new(10.0, 0.0) };
    let input = RolloutInput {
        tick: 0,
        now: SimTime(0),
        objective: Objective { energy_per_kj: 0.0, time_per_s: 1.0 },
        members: vec![DroneId(0)],
        obstacles: Vec::new(),
        drones: vec![drone],
        alternatives: slots_m.iter().map(|&slot_x_m| bundle(slot_x_m)).collect(),
        interim: 0,
    };
    Rollout::new(params(), input)
}

#[test]
fn the_alternative_that_arrives_clearly_sooner_is_chosen_at_the_fixed_tick() {
    let mut rollout = rollout(&[100.0, 60.0]);
    for tick in 0..10 {
        assert_eq!(rollout.advance(tick), None);
    }
    let chosen = rollout.advance(10).unwrap();
    assert_eq!(chosen.plan.anchor_m[0], 60.0);
    assert_eq!(chosen.plan.candidates, 2);
    assert_eq!(chosen.plan.stamp, SimTime::from_secs(1.0));
    assert_eq!(chosen.plan.id.epoch, 1, "it supersedes the interim plan");
}

#[test]
fn without_a_finished_forecast_the_interim_plan_is_kept() {
    let chosen = rollout(&[100.0, 60.0]).choose();
    assert_eq!((chosen.plan.anchor_m[0], chosen.plan.candidates), (100.0, 0));
}

#[test]
fn an_alternative_that_never_arrives_is_not_chosen() {
    let mut rollout = rollout(&[100.0, -50.0]);
    assert_eq!(rollout.advance(0), None);
    assert_eq!(rollout.choose().plan.anchor_m[0], 100.0);
}
