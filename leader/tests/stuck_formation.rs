//! What a leader plans for a formation whose drones are at rest although they are not in their slots.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use skein_leader::leading::Leading;
use skein_leader::params::Destination;
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
