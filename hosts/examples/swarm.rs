//! An application with a pilot of its own, `thinker`, which keeps its velocity and computes for about two milliseconds in each tick. The
//! tests of this crate fly with it, because they have no other way to `skein`. It also shows what a second host brings to pilots that think
//! hard: see docs/hosts.md.

use skein::{App, Command, Inbox, Out, Pilot, Senses};
use std::hint::black_box;

/// Multiplications of a thinker in each tick: about two milliseconds of a core at 3 GHz. Work, not time: on a core that drones share, each
/// takes its own time.
const THOUGHT: u64 = 1_500_000;

#[derive(Default)]
struct Thinker {
    velocity_mps: Option<[f64; 3]>,
}

impl Pilot for Thinker {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        black_box((0..THOUGHT).fold(1_u64, |thought, step| black_box(thought.wrapping_mul(step | 1))));
        Command::velocity(*self.velocity_mps.get_or_insert(senses.velocity_mps))
    }
}

fn main() -> std::process::ExitCode {
    App::new().pilot("thinker", |_| Box::new(Thinker::default())).main()
}
