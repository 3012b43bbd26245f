use super::*;
use proptest::prelude::*;

const PARAMS: SafetyParams = SafetyParams {
    safe_distance_m: 30.0,
    clearance_m: 15.0,
    acceleration_max_mps2: 5.0,
    braking_mps2: 5.0,
    gain_per_s: 1.5,
    margin: 0.02,
    reaction_time_s: 0.0,
    dt_s: DT,
    scale: Scale::FULL,
};
const DT: f64 = 0.02;

/// Flies two drones. Each wants to keep its initial velocity. Returns their least distance, m.
fn fly_pair(mut p: [Vec2; 2], mut v: [Vec2; 2], shares: [f64; 2]) -> f64 {
    let wanted = v;
    let mut filters = [Safety::new(PARAMS), Safety::new(PARAMS)];
    let mut least = f64::INFINITY;
    for _ in 0..1500 {
        let accelerations = [0, 1].map(|i| {
            let other = 1 - i;
            let (position_m, velocity_mps) = (p[other] - p[i], v[other] - v[i]);
            let id = DroneId(other as u32);
            let neighbour =
                Neighbour { id, position_m, velocity_mps, age_s: 0.0, sensed: true, least_m: 0.0, share: shares[i] };
            let want = (wanted[i] - v[i]) * 2.0;
            filters[i].filter(want, v[i], std::iter::empty(), std::iter::once(neighbour))
        });
        for i in 0..2 {
            let next = v[i] + accelerations[i] * DT;
            p[i] += (v[i] + next) * (DT / 2.0);
            v[i] = next;
        }
        least = least.min((p[0] - p[1]).norm());
    }
    least
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn two_drones_on_any_crossing_keep_their_distance(
        angle in 0.3..std::f64::consts::PI, offset in -40.0..40.0, share in 0.1..0.9
    ) {
        let other = Vec2::new(f64::cos(angle), f64::sin(angle)) * 10.0;
        let start = -other * 15.0 + Vec2::new(0.0, offset);
        let (p, v) = ([Vec2::new(-150.0, 0.0), start], [Vec2::new(10.0, 0.0), other]);
        prop_assume!((p[0] - p[1]).norm() > 45.0);
        let least = fly_pair(p, v, [share, 1.0 - share]);
        prop_assert!(least >= PARAMS.safe_distance_m, "{least}");
    }
}

#[test]
fn a_drone_with_the_whole_share_keeps_its_distance_from_a_drone_that_does_nothing() {
    let least = fly_pair([Vec2::zeros(), Vec2::new(90.0, 5.0)], [Vec2::new(10.0, 0.0), Vec2::zeros()], [1.0, 0.0]);
    assert!(least >= PARAMS.safe_distance_m, "{least}");
}

#[test]
fn a_drone_keeps_its_distance_behind_a_drone_that_brakes_hard_for_any_share() {
    for share in [0.1, 0.5, 0.9] {
        let (mut ahead, mut behind) = ((31.0, 10.0), (0.0, 10.0));
        let mut filter = Safety::new(PARAMS);
        for _ in 0..1500 {
            let neighbour = Neighbour {
                id: DroneId(0),
                position_m: Vec2::new(ahead.0 - behind.0, 0.0),
                velocity_mps: Vec2::new(ahead.1 - behind.1, 0.0),
                age_s: 0.0,
                sensed: true,
                least_m: 0.0,
                share,
            };
            let (velocity, wanted) = (Vec2::new(behind.1, 0.0), Vec2::new((10.0 - behind.1) * 2.0, 0.0));
            let a = filter.filter(wanted, velocity, std::iter::empty(), std::iter::once(neighbour));
            let brake = -f64::min(PARAMS.acceleration_max_mps2, ahead.1 / DT);
            for (body, a) in [(&mut ahead, brake), (&mut behind, a.x)] {
                *body = (body.0 + body.1 * DT + a * DT * DT / 2.0, body.1 + a * DT);
            }
            assert!(ahead.0 - behind.0 >= PARAMS.safe_distance_m, "{} with share {share}", ahead.0 - behind.0);
        }
    }
}

#[test]
fn a_drone_stops_before_a_wall() {
    let mut filter = Safety::new(PARAMS);
    let (mut x, mut v) = (-80.0, Vec2::new(10.0, 0.0));
    for _ in 0..2000 {
        let wall = NearObstacle { nearest_m: Vec2::new(-x, 0.0), distance_m: -x };
        let a = filter.filter((Vec2::new(10.0, 0.0) - v) * 2.0, v, std::iter::once(wall), std::iter::empty());
        let next = v + a * DT;
        x += (v.x + next.x) * DT / 2.0;
        v = next;
        assert!(x <= -PARAMS.clearance_m, "{x}");
    }
    assert!(x > -PARAMS.clearance_m - 1.0, "the drone stopped too far from the wall: {x}");
}

fn neighbour(position_m: Vec2, velocity_mps: Vec2, share: f64) -> Neighbour {
    Neighbour { id: DroneId(7), position_m, velocity_mps, age_s: 0.0, sensed: true, least_m: 0.0, share }
}

fn filtered(wanted: Vec2, velocity: Vec2, neighbours: &[Neighbour]) -> Vec2 {
    Safety::new(PARAMS).filter(wanted, velocity, std::iter::empty(), neighbours.iter().copied())
}

#[test]
fn an_old_beacon_causes_no_evasion_if_ranging_would_have_sensed_a_near_drone() {
    let from_beacon = Neighbour { age_s: 4.0, sensed: false, ..neighbour(Vec2::new(65.0, 0.0), Vec2::zeros(), 0.5) };
    assert!(
        filtered(Vec2::zeros(), Vec2::zeros(), &[from_beacon]).x < -1.0,
        "without ranging, the neighbour may be much nearer than its beacon says"
    );
    let unsensed = Neighbour { least_m: 60.0, ..from_beacon };
    assert_eq!(filtered(Vec2::zeros(), Vec2::zeros(), &[unsensed]), Vec2::zeros());
}

#[test]
fn a_drone_between_two_others_does_not_accelerate_sideways() {
    // Both neighbours are slightly too near and almost opposite. Full sideways acceleration gains nothing.
    let distance_m = PARAMS.safe_distance_m + 0.3;
    let squeezed = [Vec2::new(distance_m, 0.0), Vec2::new(-distance_m, -0.6)].map(|p| neighbour(p, Vec2::zeros(), 1.0));
    let a = filtered(Vec2::zeros(), Vec2::zeros(), &squeezed);
    assert!(a.norm() < 1.0, "{a}");
}

#[test]
fn a_silent_chaser_does_not_push_a_drone_into_a_neighbour_ahead() {
    let ahead = neighbour(Vec2::new(34.0, 0.0), Vec2::new(-6.0, 0.0), 1.0);
    let chaser = neighbour(Vec2::new(-33.0, 0.0), Vec2::new(3.0, 0.0), 1.0);
    let own = Vec2::new(6.0, 0.0);
    let alone = filtered(Vec2::zeros(), own, &[ahead]);
    assert!(alone.x < -2.0, "{alone}");
    let chased = filtered(Vec2::zeros(), own, &[ahead, chaser]);
    assert!((chased - alone).norm() < 0.2, "the chaser changed the command from {alone} to {chased}");
}

#[test]
fn one_that_is_too_far_away_to_be_ranged_needs_no_more_room_than_one_that_is_ranged() {
    let late = SafetyParams { acceleration_max_mps2: 13.0, reaction_time_s: 0.4, ..PARAMS };
    let kept_m = late.keep_m(late.reaction_time_s);
    let beyond_m = |distance_m: f64, least_m: f64| {
        let position_m = Vec2::new(distance_m, 0.0);
        let (id, velocity_mps) = (DroneId(1), Vec2::zeros());
        let neighbour = Neighbour { id, position_m, velocity_mps, age_s: 0.7, sensed: false, least_m, share: 0.5 };
        late.neighbour_barrier(&neighbour).beyond_m
    };
    let old_m = late.keep_m(0.7);
    assert!(kept_m + 1.0 < old_m);
    for (distance_m, least_m, wanted_m) in [
        (kept_m + 1.0, kept_m - 2.0, 1.0),
        (kept_m - 3.0, kept_m - 2.0, -2.0),
        (kept_m + 1.0, kept_m + 9.0, 9.0),
        (kept_m + 1.0, 0.0, kept_m + 1.0 - old_m),
    ] {
        assert!((beyond_m(distance_m, least_m) - wanted_m).abs() < 1e-9, "{distance_m} m away, at least {least_m} m");
    }
}

/// What was expected of the neighbours is kept for as many ticks as the reaction time has, whenever that was set.
#[test]
fn expectations_are_kept_for_the_reaction_time_that_was_set_last() {
    let mut safety = Safety::new(PARAMS);
    for (reaction_time_s, ticks) in [(0.0, 0), (0.1, 5), (0.04, 2)] {
        safety.set_reaction_time(reaction_time_s);
        safety.expected.clear();
        for _ in 0..20 {
            safety.filter(Vec2::zeros(), Vec2::zeros(), std::iter::empty(), std::iter::empty());
        }
        assert_eq!(safety.expected.len(), ticks + 1, "{reaction_time_s} s");
    }
}
