//! The theorem of `docs/safety.md`, in crowds of any size and state. `examples/crowd_search.rs` searches for longer.

mod crowd;

use crowd::words::{Adversary, fly_by_words};
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
        let adversary = Adversary { delay_s, loss, restarts };
        let least_m = fly_by_words(seed, (drones, density), 400, (WISHES[wish], lag), adversary).least_m;
        prop_assert!(least_m >= -1e-6, "{least_m} m with {:?}", WISHES[wish]);
    }
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
