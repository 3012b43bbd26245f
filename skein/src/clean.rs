//! `skein clean`: removes what dead runs left behind.

use crate::exit::{Exit, Failure};

/// Removes unlocked runs of this user, and nothing else.
pub(crate) fn clean() -> Result<Exit, Failure> {
    let cleaned = skein_bus::clean().map_err(Failure::environment)?;
    println!("removed {} dead runs and {} of their files in shared memory", cleaned.runs, cleaned.files);
    Ok(Exit::Reached)
}
