//! What a leader plans for a formation whose drones are at rest although they are not in their slots.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_leader::params::Destination;
use skein_leader::silent::Silent;
use skein_protocol::{Phase, PlanStamp, SimTime, Vec2};
use swarm::air::{Air, Swarm};
use swarm::{DEFAULT, params};

const DRONES: u32 = 4;

/// The times at which drones that never move obey a new plan for the formation at the goal, s.
fn plans_for_drones_at_rest(seconds: f64) -> Vec<f64> {
    let mut swarm = Swarm::new(DEFAULT, Air::default(), DRONES as usize);
    let machine = |me| {
        let mut params = params(&DEFAULT, DRONES, me, 1, SimTime::ZERO);
        params.planner.destination = Destination::Goal { front_m: Vec2::new(60.0, 0.0) };
        Some(Leading::new(&params))
    };
    swarm.drones = (0..DRONES).map(machine).collect();
    swarm.own.iter_mut().for_each(|own| own.velocity = Vec2::zeros());
    let (mut times, mut last): (Vec<f64>, Option<PlanStamp>) = (Vec::new(), None);
    while swarm.now().since(SimTime::ZERO) < seconds {
        swarm.step().unwrap();
        let obeyed = swarm.drones[0].as_ref().unwrap().obeyed();
        let Some(plan) = obeyed.map(|bundle| bundle.plan).filter(|plan| plan.phase() == Phase::Reform) else {
            continue;
        };
        if last.replace(plan.id) != Some(plan.id) {
            times.push(swarm.now().since(SimTime::ZERO));
        }
    }
    times
}

#[test]
fn ranks_that_open_and_close_in_vain_do_so_ever_more_slowly() {
    let times = plans_for_drones_at_rest(400.0);
    let rests: Vec<f64> = times.windows(2).map(|pair| (pair[1] - pair[0]).round()).collect();
    assert_eq!(rests, [3.0, 3.0, 3.0, 6.0, 6.0, 12.0, 12.0, 24.0, 24.0, 48.0, 48.0, 96.0, 96.0]);
}

/// Where the slot of a drone is that has heard no other so far, relative to the front slot, m, at each of these times, s. A silent drone is
/// this far from the front slot, m.
fn lone_slots_m(beside_m: f64, times_s: [f64; 3]) -> [Vec2; 3] {
    let front_m = Vec2::new(60.0, 0.0);
    let mut params = params(&DEFAULT, 2, 0, 1, SimTime::ZERO);
    params.planner.destination = Destination::Goal { front_m };
    let mut leading = Leading::new(&params);
    let mut tick = 0;
    times_s.map(|until_s| {
        while DEFAULT.dt_s * (tick as f64) < until_s {
            tick += 1;
            let now = SimTime::from_secs(DEFAULT.dt_s * tick as f64);
            let (position, velocity) = (Vec2::new(20.0, 0.0), Vec2::zeros());
            let own = OwnState { tick, position, velocity, altitude_m: 50.0, climb_mps: 0.0 };
            let mut said = Vec::new();
            leading.elect(now, &own, &mut said);
            if leading.is_leader() {
                leading.refresh_members(now, &own);
                let place = front_m + Vec2::new(0.0, beside_m);
                let silent = [Silent { place, since: SimTime::ZERO, hangs: false }];
                if let Some(bundle) = leading.decide(now, &silent, &mut said).pop() {
                    leading.adopt(now, bundle);
                }
            }
        }
        let (anchor, _) = leading.obeyed().unwrap().plan.anchor_at(SimTime::from_secs(until_s));
        anchor + Vec2::from(leading.part().unwrap().slot_m) - front_m
    })
}

/// The other drone may live and be on its way. The safe distance is 20 m.
#[test]
fn the_last_drone_takes_another_slot_if_a_dead_one_hangs_in_the_front_slot() {
    let [soon, later, late] = lone_slots_m(15.0, [15.0, 25.0, 60.0]);
    assert_eq!([soon, later], [Vec2::zeros(); 2]);
    assert!(late.norm() > 25.0, "the slot is at {late}");
    assert_eq!(lone_slots_m(25.0, [15.0, 25.0, 60.0]), [Vec2::zeros(); 3], "it can come to the front slot");
}
