use super::*;
use crate::braking_filter::{BrakingFilter, BrakingFilterParams, OwnMotion};
use bytemuck::Zeroable;
use proptest::prelude::*;
use skein_protocol::raised;

const FILTER: BrakingFilterParams = BrakingFilterParams {
    safe_distance_m: 25.0,
    clearance_m: 15.0,
    acceleration_max_mps2: 5.0,
    braking_mps2: 5.0,
    speed_max_mps: 20.0,
    dt_s: 0.02,
};

/// Three drones in line at rest, 60 m apart. Drone 0 is in front.
fn separations(me: u32, incarnation: u32) -> Separations {
    let params = SeparationParams {
        me: DroneId(me),
        incarnation,
        starts_m: [0.0, -60.0, -120.0].map(|x| Vec2::new(x, 0.0)).into(),
        start_velocity: Vec2::zeros(),
        reaction_time_s: 0.0,
        keep_m: FILTER.keep_m(),
        radio_range_m: f64::INFINITY,
        braking_mps2: FILTER.braking_mps2,
        period_s: 0.1,
        dt_s: FILTER.dt_s,
    };
    Separations::new(params, SimTime::ZERO)
}

fn no_peers() -> Peers {
    Peers::new(3, 1.0)
}

fn path(tick: u64, position: Vec2, velocity: Vec2) -> OwnPath {
    let now = SimTime::from_secs(tick as f64 * FILTER.dt_s);
    OwnPath::new((tick, now), vec![position], velocity, FILTER.law(), FILTER.stride())
}

fn pose(at: SimTime, position: Vec2, velocity: Vec2) -> Pose {
    Pose { stamp: at, position_m: raised(position, 0.0), velocity_mps: raised(velocity, 0.0), ..Pose::zeroed() }
}

/// The command of a drone at `position` that wants to fly along x.
fn command(separations: &Separations, position: Vec2, velocity: Vec2) -> Vec2 {
    let own = OwnMotion {
        tick: 0,
        now: SimTime::ZERO,
        sensed_position: position,
        sensed_velocity: velocity,
        position,
        velocity,
        speed_limit_mps: 20.0,
        lag: 0,
    };
    BrakingFilter::new(FILTER).filter(&own, Vec2::new(5.0, 0.0), [].into_iter(), [].into_iter(), separations.lines())
}

/// Two drones that fly one behind the other, and whose first command takes effect after half a second.
#[test]
fn both_drones_keep_to_their_first_line_if_their_first_command_is_to_brake() {
    let (lag, velocity) = (25, Vec2::new(8.0, 6.0));
    let starts_m = [Vec2::new(40.0, 30.0), Vec2::zeros()];
    for (me, side) in [(0, Side::Front), (1, Side::Back)] {
        let params = SeparationParams {
            me: DroneId(me),
            starts_m: starts_m.into(),
            start_velocity: velocity,
            reaction_time_s: f64::from(lag) * FILTER.dt_s,
            ..separations(me, 1).params
        };
        let lines = Separations::new(params, SimTime::ZERO);
        let (line, _) = lines.lines().next().unwrap();
        let way = |ticks: u32| starts_m[me as usize] + velocity * (f64::from(ticks) * FILTER.dt_s);
        let given = (0..=lag).map(way).collect();
        let path = OwnPath::new((0, SimTime::ZERO), given, velocity, FILTER.law(), FILTER.stride());
        // The line stays in the middle of the two, 50 m apart.
        let distance_m = path.distance_m(line, side);
        assert!((distance_m - 25.0).abs() < 1e-3, "{side:?}: {distance_m} m");
        let braking = OwnPath::new((0, SimTime::ZERO), vec![way(0)], velocity, FILTER.law(), FILTER.stride());
        let early_m = braking.distance_m(line, side);
        assert!((early_m < 21.0) == (side == Side::Front), "a front drone that brakes at once: {early_m} m");
    }
}

#[test]
fn a_drone_stops_half_of_the_distance_before_its_line() {
    let follower = separations(1, 1);
    let stop_x = -30.0 - FILTER.keep_m() / 2.0;
    assert_eq!(command(&follower, Vec2::new(stop_x - 12.0, 0.0), Vec2::new(10.0, 0.0)), Vec2::new(5.0, 0.0));
    assert!(command(&follower, Vec2::new(stop_x - 10.05, 0.0), Vec2::new(10.0, 0.0)).x < -3.0);
}

#[test]
fn the_drone_ahead_gives_room_to_its_follower() {
    let (mut leader, mut follower) = (separations(0, 1), separations(1, 1));
    let (tick, velocity) = (50, Vec2::new(10.0, 0.0));
    let now = SimTime::from_secs(tick as f64 * FILTER.dt_s);
    let mut peers = Peers::new(3, 2.0);
    peers.hear(now, DroneId(1), pose(now, Vec2::new(-60.0, 0.0), velocity));
    let mut say = Vec::new();
    leader.speak(&peers, &path(tick, Vec2::new(40.0, 0.0), velocity), &mut say);
    let [Message::Separation(said)] = say[..] else { panic!("{say:?}") };
    let at = Vec2::new(-30.0 - FILTER.keep_m() / 2.0 - 1e-6, 0.0);
    assert!(command(&follower, at, Vec2::zeros()).x < 0.2, "it is at its line");
    follower.hear(DroneId(0), &said, &peers, &path(tick, at, Vec2::zeros()));
    assert_eq!(command(&follower, at, Vec2::zeros()), Vec2::new(5.0, 0.0));
}

#[test]
fn a_restarted_drone_hovers_until_all_others_have_addressed_it() {
    let (mut restarted, mut others) = (separations(1, 2), [separations(0, 1), separations(2, 1)]);
    let here = path(0, Vec2::new(-60.0, 0.0), Vec2::zeros());
    assert!(!restarted.has_agreed_with_all() && restarted.lines().count() == 0);
    for (other, source) in others.iter_mut().zip([0, 2].map(DroneId)) {
        for knows in [false, true] {
            assert!(!restarted.has_agreed_with_all(), "drone {source:?} has not addressed it");
            if knows {
                other.hear_incarnation(DroneId(1), 2);
            }
            let mut say = Vec::new();
            let tick = 50 + u64::from(source.0);
            other.speak(
                &Peers::new(3, 2.0),
                &path(tick, Vec2::new(-60.0 * f64::from(source.0), 0.0), Vec2::zeros()),
                &mut say,
            );
            let [Message::Separation(said)] = say[..] else { panic!("{say:?}") };
            restarted.hear(source, &said, &no_peers(), &here);
        }
    }
    assert!(restarted.has_agreed_with_all());
}

proptest! {
    #[test]
    fn no_message_stops_a_drone_from_commanding(
        lines in prop::collection::vec((any::<(i64, u32, u16, u16)>(), -1e12f64..1e12, any::<(i32, i32, i32)>(), 0u32..4), 1..30)
    ) {
        let mut drone = separations(1, 1);
        let here = path(0, Vec2::new(-60.0, 0.0), Vec2::new(3.0, 1.0));
        for ((stamp, number, incarnation, addressed), stop_m, (angle, speed, deceleration), source) in lines {
            let separator = Separator {
                stamp: SimTime::from_secs(stamp as f64 * 1e-12),
                stop_m,
                angle_rad: angle as f32 * 1e-6,
                speed_mps: speed as f32 * 1e-6,
                deceleration_mps2: deceleration as f32 * 1e-6,
                peer: DroneId(1),
                number,
                incarnation: incarnation % 3,
                peer_incarnation: addressed % 3,
            };
            let mut separators = [Separator::default(); MAX_SEPARATORS];
            separators[0] = separator;
            drone.hear(DroneId(source), &Separation { count: 1, of: 0, separators }, &no_peers(), &here);
            let acceleration = command(&drone, Vec2::new(-60.0, 0.0), Vec2::new(3.0, 1.0));
            prop_assert!(acceleration.norm() <= FILTER.acceleration_max_mps2 * (1.0 + 1e-9));
        }
    }
}

/// Flies three drones in line along x for a minute. Only neighbours in the line hear each other's lines. Returns where they are then.
fn fly_a_chain(passes_on: bool) -> [f64; 3] {
    let mut drones = [0, 1, 2].map(|me| separations(me, 1));
    let mut peers = [0, 1, 2].map(|_| Peers::new(3, 2.0));
    let mut bodies = [0.0, -60.0, -120.0].map(|x| (Vec2::new(x, 0.0), Vec2::zeros()));
    for tick in 0..3000 {
        let now = SimTime::from_secs(f64::from(tick) * FILTER.dt_s);
        let mut said = Vec::new();
        for (me, drone) in drones.iter_mut().enumerate() {
            let (position, velocity) = bodies[me];
            let mut say = Vec::new();
            drone.set_reach(passes_on.then_some(70.0));
            drone.speak(&peers[me], &path(tick as u64, position, velocity), &mut say);
            said.extend(say.into_iter().map(|message| (me, message)));
        }
        for me in 0..3 {
            let here = path(tick as u64, bodies[me].0, bodies[me].1);
            for from in (0..3).filter(|&from| from != me) {
                peers[me].hear(now, DroneId(from as u32), pose(now, bodies[from].0, bodies[from].1));
            }
            for (from, message) in said.iter().filter(|(from, _)| from.abs_diff(me) == 1) {
                let Message::Separation(lines) = message else { panic!("{message:?}") };
                drones[me].hear(DroneId(*from as u32), lines, &peers[me], &here);
            }
        }
        for (drone, (position, velocity)) in drones.iter().zip(&mut bodies) {
            let next = *velocity + command(drone, *position, *velocity) * FILTER.dt_s;
            *position += (*velocity + next) * (FILTER.dt_s / 2.0);
            *velocity = next;
        }
    }
    bodies.map(|(position, _)| position.x)
}

#[test]
fn a_drone_out_of_reach_is_freed_by_lines_that_others_pass_on() {
    let [_, _, last] = fly_a_chain(false);
    let start_line_x = -60.0;
    assert!(last <= start_line_x - FILTER.keep_m() / 2.0 + 1e-6, "it stays behind the line from the start: {last}");
    let [first, middle, last] = fly_a_chain(true);
    assert!(last > 100.0, "{first}, {middle}, {last}");
    assert!(first - middle >= FILTER.keep_m() - 1e-6 && middle - last >= FILTER.keep_m() - 1e-6);
}

/// The room beside the lines that each of two drones has which hang still and near each other for a second, m. `from_s`: from when on.
fn rooms_of_blocked_drones_m(drones: &mut [Separations; 2], from_s: f64) -> [f64; 2] {
    let places = [Vec2::new(-40.0, 0.0), Vec2::new(-80.0, 0.0)];
    let mut peers = [Peers::new(3, 2.0), Peers::new(3, 2.0)];
    let first = (from_s / FILTER.dt_s).round() as u64;
    let last = first + 100;
    for tick in first..last {
        let now = SimTime::from_secs(tick as f64 * FILTER.dt_s);
        let here = places.map(|place| path(tick, place, Vec2::zeros()));
        for me in 0..2 {
            let (other, mut say) = (1 - me, Vec::new());
            peers[me].hear(now, DroneId(other as u32), pose(now, places[other], Vec2::zeros()));
            drones[me].speak(&peers[me], &here[me], &mut say);
            for message in say {
                let Message::Separation(lines) = message else { panic!("{message:?}") };
                drones[other].hear(DroneId(me as u32), &lines, &peers[other], &here[other]);
            }
        }
    }
    [0, 1].map(|me: usize| {
        let peer = DroneId(1 - me as u32);
        let known = drones[me].known.iter().find(|known| known.peer == peer).expect("they know each other");
        let side = known.pair.side();
        let lines = known.pair.lines().iter();
        let here = path(last, places[me], Vec2::zeros());
        lines.map(|line| here.distance_m(&line.line, side) - FILTER.keep_m() / 2.0).fold(f64::INFINITY, f64::min)
    })
}

#[test]
fn two_drones_that_block_each_other_have_the_room_between_them_in_turn() {
    let mut drones = [separations(0, 1), separations(1, 1)];
    let all_m = 40.0 - FILTER.keep_m();
    for (from_s, wanted_m) in
        [(0.0, [all_m, 0.0]), (58.0, [all_m, 0.0]), (61.0, [0.0, all_m]), (78.0, [0.0, all_m]), (81.0, [all_m, 0.0])]
    {
        let rooms_m = rooms_of_blocked_drones_m(&mut drones, from_s);
        let differ_m = (rooms_m[0] - wanted_m[0]).abs().max((rooms_m[1] - wanted_m[1]).abs());
        assert!(differ_m < 0.01, "after {from_s} s: {rooms_m:?}, not {wanted_m:?}");
    }
}

/// Where drone 1 may be at most after drone 0 has spoken, m: that one is still at `x_m`, and has not heard drone 1 at x = −60 m for a while.
fn edge_m(radio_range_m: f64, silent_s: f64, x_m: f64) -> f64 {
    let params = SeparationParams { radio_range_m, ..separations(0, 1).params };
    let mut leader = Separations::new(params, SimTime::ZERO);
    let mut peers = Peers::new(3, 2.0);
    let heard = SimTime::from_secs(1.0);
    peers.hear(heard, DroneId(1), pose(heard, Vec2::new(-60.0, 0.0), Vec2::zeros()));
    let tick = ((1.0 + silent_s) / FILTER.dt_s).round() as u64;
    leader.speak(&peers, &path(tick, Vec2::new(x_m, 0.0), Vec2::zeros()), &mut Vec::new());
    let (line, _) = leader.lines().next().unwrap();
    line.normal().x * line.stop_m() + FILTER.keep_m() / 2.0
}

#[test]
fn a_drone_makes_no_line_that_a_lost_one_cannot_hear_of() {
    let middle_m = |x_m: f64| (x_m - 60.0) / 2.0 + FILTER.keep_m() / 2.0;
    for (range_m, silent_s, x_m) in [(200.0, 1.0, 700.0), (f64::INFINITY, 4.0, 700.0)] {
        let differ_m = (edge_m(range_m, silent_s, x_m) - middle_m(x_m)).abs();
        assert!(differ_m < 1e-3, "range {range_m} m, silent for {silent_s} s, at {x_m} m: {differ_m} m");
    }
    assert!(edge_m(200.0, 4.0, 700.0) < 0.0, "the first line stays");
}

#[test]
fn drones_that_do_not_hear_each_other_get_a_line_along_the_flight() {
    let params = SeparationParams { radio_range_m: 200.0, ..separations(0, 1).params };
    let normal = |x_m, y_m| params.normal(Vec2::new(x_m, y_m)).unwrap();
    assert_eq!((normal(160.0, 130.0), normal(-160.0, -130.0)), (Vec2::y(), -Vec2::y()));
    assert_eq!(normal(60.0, 80.0), Vec2::new(0.6, 0.8), "they are near");
    assert_eq!(normal(240.0, 100.0), Vec2::new(12.0, 5.0).normalize(), "one is almost straight ahead");
    let close = SeparationParams { radio_range_m: 50.0, ..params.clone() };
    assert_eq!(close.normal(Vec2::new(40.0, 50.0)), Some(Vec2::new(4.0, 5.0).normalize()), "they are not far aside");
}

#[test]
fn a_drone_far_behind_has_most_of_the_room() {
    let params = SeparationParams { radio_range_m: 200.0, ..separations(0, 1).params };
    let stop_m = |ahead_m: f64, speed_mps: f64| {
        let velocity = Vec2::new(speed_mps, 0.0);
        let path = path(0, Vec2::new(ahead_m, 0.0), velocity);
        let own = Stop { at: path.end(), velocity };
        let other = Stop { at: own.at - Vec2::new(ahead_m, 0.0), velocity };
        let line = params.line(None, Side::Front, &own, &other, 0.0, &path).unwrap();
        line.stop_m() - other.at.x
    };
    let keep_m = FILTER.keep_m();
    for (ahead_m, speed_mps, wanted_m) in
        [(250.0, 10.0, 250.0 - keep_m), (150.0, 10.0, 75.0), (250.0, 0.0, 125.0), (250.0, -10.0, 125.0)]
    {
        assert!((stop_m(ahead_m, speed_mps) - wanted_m).abs() < 1e-3, "{ahead_m} m ahead at {speed_mps} m/s");
    }
}
