//! A mission flies in the same way in each of the four directions.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::record::Outcome;
use skein_protocol::{Course, Vec2};
use support::{fly_to_the_end, parse};

/// A mission that starts 40 m right of its course, passes a circle and two walls that make a gap, and ends in a formation. All of it is
/// turned to this course. `keys`: tables of the file that name no place.
fn mission(course: Course, keys: &str) -> String {
    let turned = |x, y| -> [f64; 2] { course.to_world(Vec2::new(x, y)).into() };
    let wall = |y0: f64, y1: f64| [turned(400.0, y0), turned(420.0, y0), turned(420.0, y1), turned(400.0, y1)];
    format!(
        "[formation]\ndrones = 6\nstart_m = {:?}\nstart_jitter_m = 1\n[mission]\nend = \"goal\"\ngoal_m = {:?}\n\
         [[obstacle]]\nshape = \"circle\"\ncentre_m = {:?}\nradius_m = 40\n\
         [[obstacle]]\nshape = \"polygon\"\nvertices_m = {:?}\n[[obstacle]]\nshape = \"polygon\"\nvertices_m = {:?}\n{keys}",
        turned(10.0, -40.0),
        turned(650.0, 20.0),
        turned(220.0, -30.0),
        wall(60.0, 260.0),
        wall(-200.0, 0.0)
    )
}

/// How the mission went along each course: its ticks, its least separation and its least clearance, m.
fn flown(keys: &str) -> [(u64, f64, f64); 4] {
    Course::ALL.map(|course| {
        let scenario = parse(&mission(course, keys), &[]);
        assert_eq!(scenario.course(), course);
        let world = fly_to_the_end(&scenario, None);
        assert_eq!(world.ended(), Some(Outcome::Reached), "{course:?} {keys}");
        (world.tick(), world.min_separation_m(), world.min_clearance_m())
    })
}

#[test]
fn a_mission_flies_alike_along_each_course() {
    let few = "[drone]\nspeed_mps = 10\n";
    let late = "[drone]\nreaction_time_s = 0.1\n[sensors]\ndetection_range_m = 200\n[radio]\nrange_m = 90\nloss = 0.1\ndelay_s = 0.2\n";
    let by_words = "[sensors]\nranging = false\n";
    for keys in [few, late, by_words] {
        let [east, others @ ..] = flown(keys);
        assert_eq!(others, [east; 3], "{keys}");
    }
}
