//! Energy, power and kinematics: E7, P1, K1.

use super::flown::{fly_file, velocity};
use skein_protocol::energy::power_w;

#[test]
fn p1_power_is_the_papers_and_hovering_costs_a_third_more_than_cruising() {
    for (speed_mps, watt) in [(0.0, 168.48), (5.0, 143.61), (10.0, 126.03), (20.0, 178.30)] {
        assert!((power_w(speed_mps) - watt).abs() <= 0.01, "{speed_mps} m/s");
    }
    assert!((power_w(0.0) / power_w(10.0) - 4.0 / 3.0).abs() < 0.01);
}

#[test]
fn e7_energy_is_the_sum_of_power_over_all_drones_and_ticks() {
    let flown = fly_file("paper/s2-right", &[]);
    // In a tick a drone uses the power of its speed at the beginning of the tick: 10 m/s in the first one.
    let first = 8.0 * power_w(10.0);
    let rest = flown.ticks[..flown.ticks.len() - 1].iter().flat_map(|(_, rows)| rows);
    let sum_j = (first + rest.map(|row| power_w(velocity(row).norm())).sum::<f64>()) * 0.02;
    let recorded_j: f64 = flown.ticks.last().unwrap().1.iter().map(|row| row.energy_j).sum();
    assert!((recorded_j / sum_j - 1.0).abs() < 1e-9, "{recorded_j} J recorded, {sum_j} J summed");
}

#[test]
fn k1_the_nominal_speed_is_held_where_possible_and_no_limit_is_broken() {
    for name in ["paper/s1-right", "paper/forest"] {
        let flown = fly_file(name, &[]);
        let speeds = flown.ticks.iter().flat_map(|(_, rows)| rows.iter().map(|row| velocity(row).norm()));
        assert!(speeds.fold(0.0, f64::max) <= 20.0 + 1e-9, "{name}");
        let detected_s = flown.detected_s(0);
        let free = flown.ticks.iter().take_while(|(t_s, _)| *t_s < detected_s);
        for row in free.flat_map(|(_, rows)| rows) {
            assert!((velocity(row).norm() - 10.0).abs() < 0.05, "{name}: {row:?}");
        }
        for two in flown.ticks.windows(2) {
            for (before, after) in two[0].1.iter().zip(&two[1].1) {
                let acceleration = (velocity(after) - velocity(before)).norm() / 0.02;
                assert!(acceleration <= 5.0 + 1e-6, "{name}: {acceleration} m/s² at {} s", two[0].0);
            }
        }
    }
}
