//! A swarm flies alike at every size: indoors as outdoors.
#![allow(clippy::unwrap_used)]

mod support;

use skein_protocol::record::Outcome;
use skein_scenario::Scenario;
use support::{fly_to_the_end, parse};

/// `scenarios/paper/s2-right.toml` with all lengths, speeds and accelerations times this.
fn s2_right(scale: f64) -> Scenario {
    let of = |length: f64| length * scale;
    let text = format!(
        "[formation]\ndrones = 8\nspacing_m = {}\n[mission]\nstop_x_m = {}\nreform_speed_max_mps = {}\narrival_error_m = {}\n\
         [drone]\nsafe_distance_m = {}\nspeed_mps = {}\nspeed_change_mps = {}\nspeed_max_mps = {}\nacceleration_max_mps2 = {}\n\
         drag_coefficient = {}\n[avoidance]\nclearance_m = {}\nplanning_distance_m = {}\n[sensors]\ndetection_range_m = {}\n\
         [[obstacle]]\nshape = \"rectangle\"\ncentre_m = [{}, {}]\nhalf_size_m = [{}, {}]\n",
        of(65.0),
        of(100.0),
        of(15.0),
        of(0.8),
        of(37.0),
        of(10.0),
        of(5.0),
        of(20.0),
        of(5.0),
        of(0.509_683_995_922_528),
        of(15.0),
        of(20.0),
        of(90.0),
        of(144.0),
        of(-115.0),
        of(5.0),
        of(80.0),
    );
    parse(&text, &[])
}

#[test]
fn the_size_of_a_swarm_does_not_change_how_it_flies() {
    let ends = [0.5, 0.1, 0.02].map(|scale| {
        let world = fly_to_the_end(&s2_right(scale), None);
        assert_eq!((world.ended(), world.violations()), (Some(Outcome::Reached), 0), "at {scale} of the size");
        (world.tick(), world.min_separation_m() / (37.0 * scale))
    });
    let [(tick, separation), others @ ..] = ends;
    for (other, other_separation) in others {
        assert_eq!(other, tick);
        assert!((other_separation - separation).abs() < 1e-3, "{ends:?}");
    }
}
