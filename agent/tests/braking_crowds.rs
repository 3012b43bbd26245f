//! The theorem of `docs/safety.md`, in crowds of any size and state. `examples/crowd_search.rs` searches for longer.

mod crowd;

use crowd::blind::{Failures, fly_blind};
use crowd::errors::Errors;
use crowd::words::{Adversary, fly_by_words, fly_with_errors};
use crowd::{WISHES, fly};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn no_crowd_breaks_a_distance(seed in any::<u64>(), drones in 2usize..60, density in 0.7f64..4.0, wish in 0usize..5) {
        let least_m = fly(seed, (drones, density), 250, (WISHES[wish], 0), 0.0).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }

    #[test]
    fn no_crowd_that_only_talks_breaks_a_distance(
        seed in any::<u64>(), drones in 2usize..20, density in 0.7f64..3.0, wish in 0usize..5, lag in 0u32..12,
        delay_s in 0.0f64..3.0, loss in 0.0f64..0.9, restarts in 0.0f64..0.3
    ) {
        let adversary = Adversary::new(delay_s, loss, restarts);
        let least_m = fly_by_words(seed, (drones, density), 400, (WISHES[wish], lag), adversary).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn no_crowd_that_passes_lines_on_breaks_a_distance(
        seed in any::<u64>(), drones in 3usize..20, density in 0.7f64..3.0, wish in 0usize..5, lag in 0u32..12,
        delay_s in 0.0f64..3.0, loss in 0.0f64..0.9, restarts in -0.3f64..0.3, reach_m in 30.0f64..200.0
    ) {
        let adversary = Adversary::new(delay_s, loss, restarts).with_reach(reach_m);
        let least_m = fly_by_words(seed, (drones, density), 400, (WISHES[wish], lag), adversary).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn no_crowd_with_wrong_positions_clocks_and_outlines_breaks_a_distance(
        seed in any::<u64>(), drones in 2usize..20, density in 0.7f64..3.0, wish in 0usize..5, lag in 0u32..12,
        delay_s in 0.0f64..3.0, loss in 0.0f64..0.9, restarts in -0.3f64..0.3
    ) {
        let adversary = Adversary::new(delay_s, loss, restarts);
        let errors = |crowd: &crowd::Crowd| Errors::random(crowd, seed);
        let least_m = fly_with_errors(seed, (drones, density), 400, (WISHES[wish], lag), adversary, errors).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn no_crowd_whose_ranging_fails_breaks_a_distance(
        seed in any::<u64>(), drones in 2usize..16, density in 0.7f64..3.0, wish in 0usize..5, lag in -8i32..10,
        delay_s in 0.0f64..2.0, loss in 0.0f64..0.8, rate_per_s in 0.05f64..1.0
    ) {
        let adversary = Adversary::new(delay_s, loss, 0.0);
        let failures = Failures { rate_per_s, waits: true };
        let lag = lag.max(0) as u32;
        let flown = fly_blind(seed, (drones, density), 500, (WISHES[wish], lag), (adversary, failures));
        prop_assert!(flown.least_m >= -1e-6, "{} m with {:?}", flown.least_m, WISHES[wish]);
    }
}

/// Blind drones that do not wait for common lines break distances, and those that do fly on.
#[test]
fn blind_drones_have_to_wait_for_common_lines() {
    let adversary = Adversary::new(1.0, 0.5, 0.0);
    let fly = |seed: u64, waits: bool| {
        let failures = Failures { rate_per_s: 0.2, waits };
        fly_blind(seed, (10, 1.5), 500, (WISHES[seed as usize % 5], 0), (adversary, failures))
    };
    let broken = (0..20).filter(|&seed| fly(seed, false).least_m < -1e-6).count();
    assert!(broken > 2, "{broken} of 20 crowds");
    let flown_m = (0..20).map(|seed| fly(seed, true).mean_m).sum::<f64>() / 20.0;
    assert!(flown_m > 5.0, "{flown_m} m");
}

/// Drones that do not allow for their errors break distances, so the errors are not harmless.
#[test]
fn crowds_that_do_not_allow_for_their_errors_break_distances() {
    let adversary = Adversary::new(0.3, 0.2, 0.0);
    let broken = |seed: &u64| {
        let errors = |crowd: &crowd::Crowd| Errors::random(crowd, *seed).unallowed();
        fly_with_errors(*seed, (12, 1.5), 300, (WISHES[*seed as usize % 5], 0), adversary, errors).least_m < -1e-6
    };
    let count = (0..20).filter(broken).count();
    assert!(count > 5, "{count} of 20 crowds");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn no_crowd_whose_commands_are_late_breaks_a_distance(
        seed in any::<u64>(), drones in 2usize..40, density in 0.7f64..4.0, wish in 0usize..5, lag in 0u32..20,
        freezes in -0.1f64..0.1
    ) {
        let least_m = fly(seed, (drones, density), 250, (WISHES[wish], lag), freezes.max(0.0)).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }
}
