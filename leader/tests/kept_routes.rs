//! Drones that fly a route already when their leader plans anew.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_leader::plan_bundle::PlanBundle;
use skein_protocol::payload::{Assignment, Pose};
use skein_protocol::{DroneId, Message, MessageRef, SimTime, Vec2};
use swarm::{DEFAULT, params, step, wall};

/// Drone 0, in front of a wall at x = 200 m. It leads.
struct Leader {
    leading: Leading,
    tick: u64,
}

impl Leader {
    /// Runs for 2 s, in which it hears these drones, in these places, m. Returns what it says.
    fn hears(&mut self, drones: &[(u32, Vec2)]) -> Vec<Message> {
        let mut said = Vec::new();
        for _ in 0..100 {
            self.tick += 1;
            let (stamp, term) = (SimTime::from_secs(0.02 * self.tick as f64), self.leading.term());
            for &(drone, place) in drones {
                let pose = Pose { stamp, position_m: [place.x, place.y, 50.0], term, incarnation: 1, ..Pose::zeroed() };
                self.leading.hear(stamp, DroneId(drone), &Message::Pose(pose), &mut Vec::new());
            }
            let position = Vec2::new(120.0, 0.0);
            let own = OwnState { tick: self.tick, position, velocity: Vec2::zeros(), altitude_m: 50.0, climb_mps: 0.0 };
            step(&mut self.leading, stamp, &own, &mut said);
        }
        said
    }

    fn plan(&self) -> &PlanBundle {
        self.leading.obeyed().unwrap()
    }

    fn route(&self, drone: u32) -> u16 {
        self.plan().parts.get(DroneId(drone)).unwrap().route
    }
}

/// A drone that evades others, or comes back after a fault, can be beside a wall on the side that its route does not lead past. A plan
/// for it and for a further drone names a time at which it arrives, or no other drone could read it.
#[test]
fn a_drone_on_the_wrong_side_of_a_wall_stays_on_its_route() {
    let (id, shape) = wall(0, 200.0);
    let mut leader = Leader { leading: Leading::new(&params(&DEFAULT, 3, 0, 1, SimTime::ZERO)), tick: 0 };
    leader.leading.sense(SimTime::ZERO, id, shape);
    leader.hears(&[(1, Vec2::new(100.0, 60.0))]);
    let (first, left) = (leader.plan().plan.id, leader.route(1));
    assert_eq!(left, 1, "it is on the left");
    let said = leader.hears(&[(1, Vec2::new(200.0, -90.0)), (2, Vec2::new(80.0, -40.0))]);
    assert!(leader.plan().plan.id > first && leader.plan().parts.len() == 3, "{:?}", leader.plan());
    assert_eq!(leader.route(1), left);
    assert!(leader.plan().parts.iter().all(|part| part.arrival_s.is_finite()));
    assert!(said.iter().any(|message| matches!(message, Message::Assignment(Assignment { drone: DroneId(1), .. }))));
    for message in said {
        let frame = message.encode();
        assert!(MessageRef::read(&frame).is_ok(), "{message:?}");
    }
}
