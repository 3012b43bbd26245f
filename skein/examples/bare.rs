//! The least pilot of one's own: it keeps the velocity that it starts with, as the built-in pilot `cruise` does. What a pilot of
//! one's own costs beside a built-in one is measured with it:
//!
//! ```sh
//! cargo run --release -p skein --example bare -- bench pilots cruise,bare
//! ```

use skein::{App, Command, Inbox, Out, Pilot, Senses};

struct Bare {
    velocity_mps: Option<[f64; 3]>,
}

impl Pilot for Bare {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        Command::velocity(*self.velocity_mps.get_or_insert(senses.velocity_mps))
    }
}

fn main() -> std::process::ExitCode {
    App::new().pilot("bare", |_| Box::new(Bare { velocity_mps: None })).main()
}
