//! Lockstep and wall clock.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Least and greatest speed of a wall clock.
const SPEEDS: [f64; 2] = [1e-6, 1e6];

/// What paces the ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Clock {
    /// Each tick waits for every living drone and for nothing else.
    #[default]
    Lockstep,
    /// The wall clock. A drone that is late keeps its last command.
    Realtime {
        /// Simulated seconds per second of wall time, from 1e-6 to 1e6.
        speed: f64,
    },
}

/// A text that does not name a clock.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{text}` is no clock: expected `lockstep`, `realtime` or `realtime:SPEED` with SPEED from 1e-6 to 1e6")]
pub struct ClockError {
    text: String,
}

impl FromStr for Clock {
    type Err = ClockError;

    fn from_str(text: &str) -> Result<Self, ClockError> {
        let error = || ClockError { text: text.to_owned() };
        match text.split_once(':') {
            None if text == "lockstep" => Ok(Self::Lockstep),
            None if text == "realtime" => Ok(Self::Realtime { speed: 1.0 }),
            Some(("realtime", speed)) => match speed.parse::<f64>() {
                Ok(speed) if (SPEEDS[0]..=SPEEDS[1]).contains(&speed) => Ok(Self::Realtime { speed }),
                _ => Err(error()),
            },
            _ => Err(error()),
        }
    }
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lockstep => f.write_str("lockstep"),
            Self::Realtime { speed: 1.0 } => f.write_str("realtime"),
            Self::Realtime { speed } => write!(f, "realtime:{speed}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_is_parsed_from_the_text_it_prints() {
        for text in ["lockstep", "realtime", "realtime:2.5"] {
            assert_eq!(text.parse::<Clock>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "realtime:",
            "realtime:0",
            "realtime:-1",
            "realtime:inf",
            "realtime:1e-300",
            "realtime:1e300",
            "realtime:nan",
            "lockstep:2",
            "fast",
        ] {
            let error = text.parse::<Clock>().unwrap_err();
            assert!(error.to_string().contains("expected `lockstep`"), "{text}");
        }
    }
}
