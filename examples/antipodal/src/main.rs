//! Drones on a circle swap places. They sense no neighbours: all that they know of each other is what they say. The pilot is made from
//! two parts of Skein's own pilot: the lines that keep drones apart (`skein_agent::separation`) and the filter that keeps to them.

mod antipodal;

use antipodal::Antipodal;

fn main() -> std::process::ExitCode {
    skein::App::new().try_pilot("antipodal", |birth| Ok(Box::new(Antipodal::new(birth)?))).main()
}
