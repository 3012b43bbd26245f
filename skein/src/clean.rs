//! `skein clean`: removes what dead runs left behind.

use crate::exit::{Exit, Failure};
use crate::output::print_line;

/// Removes unlocked runs of this user, and nothing else.
pub(crate) fn clean() -> Result<Exit, Failure> {
    let cleaned = skein_bus::clean().map_err(Failure::environment)?;
    print_line(format!("removed {} dead runs and {} of their files in shared memory", cleaned.runs, cleaned.files))?;
    Ok(Exit::Reached)
}
