//! Random operations on a swarm: the invariants always hold, and once the faults end, the swarm becomes one group.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod swarm;

use proptest::prelude::*;
use skein_protocol::SimTime;
use swarm::air::{Air, Swarm};
use swarm::{DEFAULT, Periods, wall};

/// Coarser than in flight, so that much happens in few ticks.
const PERIODS: Periods = Periods { dt_s: 0.05, ..DEFAULT };
/// The longest that a dead drone counts as living that was last heard over other drones, s: twelve time-outs.
const FAR_S: f64 = 12.0 * PERIODS.peer_timeout_s;
/// Time within which the swarm becomes one group once there are no faults and no obstacles ahead, s.
const FAIR_S: f64 = 20.0 + FAR_S;

/// An operation. Indices are taken modulo the number of elements.
#[derive(Clone, Debug)]
enum Operation {
    /// So many ticks go by.
    Run(u8),
    Kill(u8),
    Restart(u8),
    Freeze(u8),
    Wake(u8),
    /// One bit a drone.
    Cut(u8),
    Heal,
    /// From now on the air loses this part in 16, and takes this many ticks, give or take.
    Weather {
        loss: u8,
        delay: u8,
        jitter: u8,
    },
    /// A message on the air is lost, comes this much later, or comes again this much later.
    Lose(u16),
    Delay(u16, u8),
    Double(u16, u8),
    /// A drone is moved along and across the course, m.
    Move(u8, i8, i8),
    /// A wall stands so far ahead of the first drone, m.
    Wall(u8),
}

fn operation() -> impl Strategy<Value = Operation> {
    use Operation::*;
    prop_oneof![
        10 => (1..60u8).prop_map(Run),
        2 => any::<u8>().prop_map(Kill),
        2 => any::<u8>().prop_map(Restart),
        1 => any::<u8>().prop_map(Freeze),
        1 => any::<u8>().prop_map(Wake),
        1 => any::<u8>().prop_map(Cut),
        1 => Just(Heal),
        1 => (0..10u8, 0..20u8, 0..10u8).prop_map(|(loss, delay, jitter)| Weather { loss, delay, jitter }),
        2 => any::<u16>().prop_map(Lose),
        2 => (any::<u16>(), 1..40u8).prop_map(|(i, ticks)| Delay(i, ticks)),
        2 => (any::<u16>(), 1..100u8).prop_map(|(i, ticks)| Double(i, ticks)),
        2 => (any::<u8>(), any::<i8>(), any::<i8>()).prop_map(|(i, x, y)| Move(i, x, y)),
        1 => (40..200u8).prop_map(Wall),
    ]
}

fn apply(swarm: &mut Swarm, operation: &Operation) -> Result<(), TestCaseError> {
    let drones = swarm.drones.len();
    let drone = |i: u8| usize::from(i) % drones;
    match *operation {
        Operation::Run(ticks) => {
            for _ in 0..ticks {
                swarm.step().map_err(|breach| TestCaseError::fail(format!("{breach:?}")))?;
            }
        }
        Operation::Kill(i) => swarm.kill(drone(i)),
        Operation::Restart(i) if swarm.drones[drone(i)].is_none() => swarm.restart(drone(i)),
        Operation::Restart(_) => {}
        Operation::Freeze(i) => swarm.frozen[drone(i)] = swarm.drones[drone(i)].is_some(),
        Operation::Wake(i) => swarm.frozen[drone(i)] = false,
        Operation::Cut(bits) => swarm.sides = (0..drones).map(|i| bits >> i & 1).collect(),
        Operation::Heal => swarm.sides.fill(0),
        Operation::Weather { loss, delay, jitter } => {
            swarm.air.loss = f64::from(loss) / 16.0;
            swarm.air.delay_s = f64::from(delay) * PERIODS.dt_s;
            swarm.air.jitter_s = f64::from(jitter.min(delay)) * PERIODS.dt_s;
        }
        Operation::Lose(i) => drop(swarm.take_post(i.into())),
        Operation::Delay(i, ticks) => {
            let post = swarm.take_post(i.into());
            post.into_iter().for_each(|((due, from, number, to), message)| {
                swarm.posts().insert((due + u64::from(ticks), from, number, to), message);
            });
        }
        Operation::Double(i, ticks) => {
            if let Some(((due, from, number, to), message)) = swarm.take_post(i.into()) {
                swarm.posts().insert((due, from, number, to), message);
                swarm.posts().insert((due + u64::from(ticks), from, number, to), message);
            }
        }
        Operation::Move(i, x, y) => {
            swarm.own[drone(i)].position += skein_protocol::Vec2::new(f64::from(x), f64::from(y));
        }
        Operation::Wall(ahead) => {
            let first = swarm.own.iter().map(|own| own.position.x).fold(f64::NEG_INFINITY, f64::max);
            let id = swarm.scenery.len() as u32;
            swarm.scenery.push(wall(id, first + f64::from(ahead)));
        }
    }
    Ok(())
}

/// Ends all faults. Frozen drones wake; dead ones stay dead.
fn peace(swarm: &mut Swarm) {
    swarm.frozen.fill(false);
    swarm.sides.fill(0);
    swarm.air = Air { seed: swarm.air.seed, ..Air::default() };
}

/// Flies on until all drones have passed all obstacles.
fn pass(swarm: &mut Swarm) -> Result<(), TestCaseError> {
    let rear = swarm.scenery.iter().map(|(_, shape)| shape.bounds().1.x).fold(f64::NEG_INFINITY, f64::max);
    while swarm.own.iter().any(|own| own.position.x < rear + 25.0) {
        apply(swarm, &Operation::Run(20))?;
    }
    Ok(())
}

/// Checks that the invariants hold, and that the swarm becomes one group in the end.
fn becomes_one(drones: usize, seed: u64, operations: &[Operation]) -> Result<(), TestCaseError> {
    let mut swarm = Swarm::new(PERIODS, Air { seed, ..Air::default() }, drones);
    for operation in operations {
        apply(&mut swarm, operation)?;
    }
    peace(&mut swarm);
    let before = swarm.clone().until(FAIR_S, |s| swarm::discord(&s.side(0)));
    prop_assert!(before.is_ok(), "{before:?} in {:?}", swarm.now());
    pass(&mut swarm)?;
    let after = swarm.until(FAIR_S, |s| s.disunion(0));
    prop_assert!(after.is_ok(), "{after:?} in {:?}", swarm.now());
    Ok(())
}

/// Each of these once left a drone without a leader for good, or for too long.
#[test]
fn courses_that_once_failed_pass() {
    use Operation::*;
    let storm = |loss, delay, jitter| Weather { loss, delay, jitter };
    let courses: [(usize, u64, Vec<Operation>); 10] = [
        (6, 1_310_268_213_066_250_311, vec![Wall(67), storm(2, 8, 5), Run(24), Move(74, 12, 0), Kill(0), Run(7)]),
        (8, 17_864_427_315_851_311, {
            let start = vec![Move(232, 71, -76), Kill(166), storm(1, 1, 1), Wall(74), Run(131)];
            [start, vec![Freeze(40), Double(3675, 14), Run(50)]].concat()
        }),
        (8, 743_727_919_943_166_502, {
            let start = vec![Run(14), Wall(171), Run(24), Kill(37), Run(27), storm(0, 14, 0), Run(51)];
            [start, vec![Kill(156), Run(28), Restart(44), Cut(18), Run(17)]].concat()
        }),
        (4, 0, {
            let start = vec![Run(8), Wall(115), Move(126, 35, 0), Move(37, 70, 6)];
            [start, vec![Freeze(160), Run(107), Cut(252), Run(114)]].concat()
        }),
        (7, 0, vec![Move(153, 74, -61), Run(6), Cut(34), Wall(75), Freeze(96), Run(32), Kill(0)]),
        (5, 0, vec![Wall(150), Run(92), Cut(138), Run(25), Restart(0)]),
        (7, 0, vec![Freeze(94), Move(52, 113, 0), Run(2), Wall(40), Run(144)]),
        (3, 0, {
            let start = vec![Kill(107), Run(15), Freeze(43), Run(74), Double(9569, 53), Run(47)];
            [start, vec![Restart(8), Double(385, 39), Kill(136), Kill(81)]].concat()
        }),
        (8, 2_211_509_183_443_130, {
            let start = vec![Run(6), Cut(182), Run(8), Move(205, 0, -11), Run(23), Cut(145), Wall(40), Kill(27)];
            [start, vec![Run(32), Cut(85), storm(3, 12, 0), Run(55)]].concat()
        }),
        (3, 0, vec![Wall(40), Run(5), Kill(91), Kill(42), Restart(24), Wall(95)]),
    ];
    for (number, (drones, seed, operations)) in courses.into_iter().enumerate() {
        let outcome = becomes_one(drones, seed, &operations);
        assert!(outcome.is_ok(), "course {number}: {outcome:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(300), failure_persistence: None, max_shrink_iters: 2000, ..ProptestConfig::default() })]

    #[test]
    fn the_swarm_becomes_one(
        drones in 2..9usize, seed in any::<u64>(), operations in prop::collection::vec(operation(), 1..40),
    ) {
        becomes_one(drones, seed, &operations)?;
    }

    #[test]
    fn memory_is_bounded(operations in prop::collection::vec(operation(), 1..60), seed in any::<u64>()) {
        let mut swarm = Swarm::new(PERIODS, Air { seed, ..Air::default() }, 4);
        for operation in &operations {
            apply(&mut swarm, operation)?;
        }
        let walls = swarm.scenery.len();
        for leading in swarm.drones.iter().flatten() {
            let bundle = [leading.obeyed(), leading.ledger().origin()];
            prop_assert!(bundle.into_iter().flatten().all(|bundle| bundle.parts.len() <= 4));
            prop_assert!(leading.planned_sets().len() <= walls && leading.obstacles().iter().count() <= walls);
            prop_assert!(leading.peers().living(SimTime::ZERO).count() <= 3);
        }
    }
}
