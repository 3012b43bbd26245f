use super::*;
use crate::fault_plan::{Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime};
use crate::sensor_errors::{ClockErrors, RangingErrors};
use crate::testing::{bodies, params, rectangle};

fn model(errors: SensorErrors, drones: usize) -> SensorModel {
    SensorModel::new(&WorldParams { sensors: SensorErrors { seed: 7, ..errors }, ..params() }, drones)
}

fn ranging(ranging: RangingErrors) -> SensorModel {
    model(SensorErrors { ranging, ..SensorErrors::default() }, 2)
}

#[test]
fn ideal_sensors_have_no_error() {
    let mut ideal = model(SensorErrors::default(), 2);
    let pair = bodies(&[[0.0, 0.0], [30.0, 40.0]]);
    ideal.begin(0, &pair);
    assert_eq!((ideal.position_m(1), ideal.clock_ns(1, SimTime::from_secs(9.0))), (Vec2::zeros(), 0));
    assert!(ideal.obstacle_m(0, 0).is_none() && !ideal.draws_own_outlines());
    assert_eq!(
        ideal.range((0, 1), &RangingErrors::default(), &pair, &[]),
        Some((Vec3::new(30.0, 40.0, 0.0), Vec3::zeros()))
    );
}

/// Over one correlation time, the product of two values has the mean σ²/e.
#[test]
fn the_position_error_is_correlated_and_bounded() {
    let position = PositionError { std_m: 2.0, correlation_s: 1.0, max_m: 5.0 };
    let drones = 40;
    let mut errors = model(SensorErrors { position, ..SensorErrors::default() }, drones);
    let all = bodies(&vec![[0.0, 0.0]; drones]);
    let mut drawn: Vec<Vec<f64>> = Vec::new();
    for tick in 0..5000 {
        errors.begin(tick, &all);
        assert!((0..drones).all(|drone| errors.position_m(drone).norm() <= 5.0 + 1e-12));
        drawn.push((0..drones).map(|drone| errors.position_m(drone).x).collect());
    }
    let mean = |lag: usize| {
        let products = drawn.iter().zip(&drawn[lag..]).flat_map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y));
        products.sum::<f64>() / ((5000 - lag) * drones) as f64
    };
    // The bound takes 4.4 % of the draws and some of the variance.
    assert!((mean(0).sqrt() - 1.9).abs() < 0.15, "{}", mean(0).sqrt());
    assert!((mean(50) / mean(0) - libm::exp(-1.0)).abs() < 0.08, "{}", mean(50) / mean(0));
}

#[test]
fn clocks_drift_from_their_offsets() {
    let clock = ClockErrors { offset_max_s: 0.5, drift_max_ppm: 100.0 };
    let errors = model(SensorErrors { clock, ..SensorErrors::default() }, 50);
    let offsets: Vec<i64> = (0..50).map(|drone| errors.clock_ns(drone, SimTime::ZERO)).collect();
    assert!(offsets.iter().all(|offset| offset.abs() <= 500_000_000));
    assert!(offsets.iter().any(|offset| *offset > 100_000_000) && offsets.iter().any(|o| *o < -100_000_000));
    let later = |drone| errors.clock_ns(drone, SimTime::from_secs(1000.0)) - errors.clock_ns(drone, SimTime::ZERO);
    assert!((0..50).all(|drone| later(drone).abs() <= 100_000_000) && (0..50).any(|drone| later(drone) != 0));
}

#[test]
fn outlines_are_displaced_by_at_most_the_bound() {
    let mut errors = model(SensorErrors { obstacle_error_max_m: 0.5, ..SensorErrors::default() }, 1);
    let mut seen = Vec::new();
    for tick in 0..200 {
        errors.begin(tick, &bodies(&[[0.0, 0.0]]));
        seen.push(errors.obstacle_m(0, 3).unwrap());
    }
    assert!(seen.iter().all(|by| by.norm() <= 0.5) && seen.iter().any(|by| by.norm() > 0.4));
    assert!(seen.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn a_measurement_is_noisy_late_or_missing() {
    let near = |x: f64| bodies(&[[0.0, 0.0], [x, 0.0]]);
    let mut noisy = ranging(RangingErrors { std_m: 0.3, ..RangingErrors::default() });
    let (mut sum, mut squares) = (0.0, 0.0);
    for tick in 0..2000 {
        noisy.begin(tick, &near(50.0));
        let (position, velocity) = noisy.range((0, 1), &RangingErrors::default(), &near(50.0), &[]).unwrap();
        let error = position.norm() - 50.0;
        (sum, squares) = (sum + error, squares + error * error);
        assert_eq!(velocity, Vec3::zeros());
    }
    // Five standard errors.
    assert!((sum / 2000.0).abs() < 0.034 && ((squares / 2000.0).sqrt() - 0.3).abs() < 0.024);

    let mut late = ranging(RangingErrors { latency_s: 0.1, ..RangingErrors::default() });
    for tick in 0..10 {
        late.begin(tick, &near(50.0 + tick as f64));
    }
    let (position, _) = late.range((0, 1), &RangingErrors::default(), &near(59.0), &[]).unwrap();
    assert_eq!(position.x, 54.0, "five ticks ago");

    let mut missing = ranging(RangingErrors { dropout_share: 0.25, ..RangingErrors::default() });
    let measured = |tick| {
        missing.begin(tick, &near(50.0));
        usize::from(missing.range((0, 1), &RangingErrors::default(), &near(50.0), &[]).is_some())
    };
    let count: usize = (0..4000).map(measured).sum();
    // Five standard deviations of a binomial with p = 0.75, n = 4000.
    assert!(count.abs_diff(3000) < 137, "{count}");
}

#[test]
fn a_detour_makes_distances_longer() {
    let pair = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
    let mut detours = ranging(RangingErrors { outlier_share: 0.2, outlier_m: 4.0, ..RangingErrors::default() });
    let mut excess = Vec::new();
    for tick in 0..4000 {
        detours.begin(tick, &pair);
        excess.push(detours.range((0, 1), &RangingErrors::default(), &pair, &[]).unwrap().0.norm() - 50.0);
    }
    let longer: Vec<f64> = excess.iter().copied().filter(|excess| *excess > 1e-6).collect();
    assert!(excess.iter().all(|excess| (-1e-9..=8.0).contains(excess)));
    assert!(longer.len().abs_diff(800) < 127, "{}", longer.len());
    assert!((longer.iter().sum::<f64>() / longer.len() as f64 - 4.0).abs() < 0.4);
}

#[test]
fn neighbours_are_seen_ahead_and_in_the_open() {
    let ahead = ranging(RangingErrors { field_rad: 2.0, ..RangingErrors::default() });
    let pair = |x: f64, y: f64| bodies(&[[0.0, 0.0], [x, y]]);
    assert!(
        ahead.range((0, 1), &RangingErrors::default(), &pair(50.0, 10.0), &[]).is_some(),
        "at rest it looks along x"
    );
    assert!(ahead.range((0, 1), &RangingErrors::default(), &pair(-50.0, 10.0), &[]).is_none());
    let hidden = ranging(RangingErrors { occlusion: true, ..RangingErrors::default() });
    let wall = [Outline::new(&rectangle(25.0, 0.0, 2.0, 8.0))];
    assert!(hidden.range((0, 1), &RangingErrors::default(), &pair(50.0, 0.0), &wall).is_none());
    assert!(hidden.range((0, 1), &RangingErrors::default(), &pair(50.0, 30.0), &wall).is_some());
}

#[test]
fn a_fault_makes_ranging_worse_and_never_better() {
    let pair = bodies(&[[0.0, 0.0], [50.0, 0.0]]);
    let mut ideal = ranging(RangingErrors::default());
    let noise = RangingErrors { std_m: 2.0, ..RangingErrors::default() };
    let missing = RangingErrors { dropout_share: 1.0, ..RangingErrors::default() };
    ideal.begin(5, &pair);
    let exact = ideal.range((0, 1), &RangingErrors::default(), &pair, &[]);
    assert_ne!(ideal.range((0, 1), &noise, &pair, &[]), exact);
    assert_eq!(ideal.range((0, 1), &missing, &pair, &[]), None);
    let mut noisy = ranging(noise);
    noisy.begin(5, &pair);
    let by_fault = ideal.range((0, 1), &noise, &pair, &[]);
    let better = RangingErrors { std_m: 0.1, ..RangingErrors::default() };
    assert_eq!(noisy.range((0, 1), &better, &pair, &[]), by_fault, "the greater deviation counts");
}

/// The world keeps where bodies were from the first tick on, for as long as the latest measurement of any fault is late.
#[test]
fn a_fault_makes_measurements_late_from_any_tick_on() {
    let late = |latency_s: f64| RangingErrors { latency_s, ..RangingErrors::default() };
    let fault = |latency_s: f64| Fault {
        effect: FaultEffect::Ranging(late(latency_s)),
        time: FaultTime::At(0.0),
        targets: FaultTargets::All,
        for_s: 1.0,
    };
    let faults = FaultPlan { seed: 1, faults: vec![fault(0.04), fault(0.1), fault(0.06)] };
    let near = |tick: u64| bodies(&[[0.0, 0.0], [50.0 + tick as f64, 0.0]]);
    for sensors_s in [0.0, 0.04] {
        let sensors = SensorErrors { ranging: late(sensors_s), ..SensorErrors::default() };
        let mut model = SensorModel::new(&WorldParams { sensors, faults: faults.clone(), ..params() }, 2);
        for tick in 0..40 {
            model.begin(tick, &near(tick));
            for latency_s in [0.0, 0.04, 0.1] {
                let (position, _) = model.range((0, 1), &late(latency_s), &near(tick), &[]).unwrap();
                let age_ticks = (f64::max(latency_s, sensors_s) / 0.02).round() as u64;
                assert_eq!(position.x, 50.0 + tick.saturating_sub(age_ticks) as f64, "{latency_s} s late, tick {tick}");
            }
        }
        assert_eq!(model.past.len(), 6, "no older tick is kept");
    }
}

#[test]
fn a_fault_narrows_the_field_of_view_and_lets_obstacles_hide() {
    let pair = bodies(&[[0.0, 0.0], [50.0, 30.0]]);
    let wall = [Outline::new(&rectangle(25.0, 15.0, 2.0, 8.0))];
    let field = |field_rad| RangingErrors { field_rad, ..RangingErrors::default() };
    let ideal = RangingErrors::default();
    // The neighbour is 0.54 rad to the left of +x.
    let (all_round, ahead, narrow) = (ranging(ideal), ranging(field(1.2)), ranging(field(1.0)));
    let sees = |model: &SensorModel, fault| model.range((0, 1), &fault, &pair, &wall).is_some();
    assert!(sees(&all_round, ideal) && sees(&all_round, field(1.2)) && !sees(&all_round, field(1.0)));
    assert!(sees(&ahead, ideal) && !sees(&ahead, field(1.0)) && !sees(&narrow, field(1.2)));
    let hides = RangingErrors { occlusion: true, ..ideal };
    assert!(!sees(&all_round, hides) && !sees(&ranging(hides), ideal) && !sees(&ahead, hides));
    assert!(all_round.range((0, 1), &hides, &pair, &[]).is_some(), "in the open");
}
