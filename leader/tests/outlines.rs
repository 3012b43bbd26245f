//! What a drone learns of an obstacle reaches drones that do not sense it, although a plan covers the obstacle.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use skein_leader::leading::Leading;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{ObstacleId, Vec2};
use swarm::air::{Air, Swarm};
use swarm::{DEFAULT, wall};

const DRONES: usize = 4;

/// How far obstacle 1 reaches as far as each drone knows, m; `None` if the drone does not know it.
fn known_ends_m(swarm: &Swarm) -> Vec<Option<f64>> {
    let end_m = |leading: &Leading| leading.obstacles().get(ObstacleId(1)).map(|known| known.shape.bounds().1.x);
    swarm.drones.iter().flatten().map(end_m).collect()
}

#[test]
fn all_drones_learn_that_an_outline_has_grown_although_a_plan_covers_it() {
    let mut swarm = Swarm::new(DEFAULT, Air { seed: 5, loss: 0.2, ..Air::default() }, DRONES);
    swarm.scenery = vec![wall(1, 120.0)];
    swarm.run(10.0);
    assert!(
        swarm.side(0).iter().all(|(_, leading)| leading.planned_sets().len() == 1),
        "all obey a plan past the wall"
    );
    let longer = ConvexShape::rectangle(Vec2::new(150.0, 0.0), Vec2::new(35.0, 50.0), 0.0).unwrap();
    let now = swarm.now();
    assert!(swarm.drones[0].as_mut().unwrap().sense(now, ObstacleId(1), longer));
    swarm.run(3.0);
    assert_eq!(known_ends_m(&swarm), [Some(185.0); DRONES]);
}
