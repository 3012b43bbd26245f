//! Values of options that several commands share.

use clap::ValueEnum;
use skein_bus::{PinMode, WaitMode};
use std::time::Duration;

/// Which runtime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum RuntimeChoice {
    /// One process for the world and one for each drone
    #[default]
    Processes,
    /// Function calls in one thread
    Inline,
}

/// Whether processes are pinned to cores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum PinChoice {
    /// Drone i to core i modulo the number of cores
    #[default]
    Auto,
    /// The operating system decides
    Off,
}

impl From<PinChoice> for PinMode {
    fn from(choice: PinChoice) -> Self {
        match choice {
            PinChoice::Auto => Self::Auto,
            PinChoice::Off => Self::Off,
        }
    }
}

/// How processes wait for each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum WaitChoice {
    /// Sleep until woken
    #[default]
    Block,
    /// Look again and again, and yield the core in between
    Yield,
}

impl From<WaitChoice> for WaitMode {
    fn from(choice: WaitChoice) -> Self {
        match choice {
            WaitChoice::Block => Self::Block,
            WaitChoice::Yield => Self::Yield,
        }
    }
}

/// Parses `KEY.PATH=VALUE`, the value of `--set`.
pub(crate) fn key_value(text: &str) -> Result<(String, String), ArgumentError> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.trim().to_owned())),
        _ => Err(ArgumentError("expected key.path=value")),
    }
}

/// Parses `NAME=COUNT`.
pub(crate) fn name_and_count(text: &str) -> Result<(String, u32), ArgumentError> {
    let wrong = ArgumentError("expected NAME=COUNT, such as a=4: a host's name and its number of drones");
    let (name, count) = text.split_once('=').ok_or(wrong)?;
    Ok((name.to_owned(), count.parse().map_err(|_| wrong)?))
}

/// Parses a time, s.
pub(crate) fn seconds(text: &str) -> Result<Duration, ArgumentError> {
    let seconds = text.parse().ok().filter(|s: &f64| (0.01..=1e6).contains(s));
    seconds.map(Duration::from_secs_f64).ok_or(ArgumentError("expected a number of seconds from 0.01 to 1000000"))
}

/// Why an argument is refused.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct ArgumentError(pub &'static str);
