//! Lockstep and wall clock.

use skein_protocol::histogram;
use skein_protocol::record::Percentiles;
use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

/// What paces the ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Clock {
    /// Each tick waits for every living drone and for nothing else.
    #[default]
    Lockstep,
    /// By the wall clock, so many times as fast; a drone that is late keeps its last command.
    Realtime {
        /// Simulated seconds in a second, > 0.
        speed: f64,
    },
}

impl FromStr for Clock {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || format!("`{text}` is no clock: expected `lockstep`, `realtime` or `realtime:SPEED` with SPEED > 0");
        match text.split_once(':') {
            None if text == "lockstep" => Ok(Self::Lockstep),
            None if text == "realtime" => Ok(Self::Realtime { speed: 1.0 }),
            Some(("realtime", speed)) => match speed.parse::<f64>() {
                Ok(speed) if speed > 0.0 && speed.is_finite() => Ok(Self::Realtime { speed }),
                _ => Err(expected()),
            },
            _ => Err(expected()),
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

/// A wall clock that has fallen behind by more than this starts anew instead of catching up.
const STALL: Duration = Duration::from_secs(1);

/// Deadlines of ticks on the wall clock.
#[derive(Clone, Debug)]
pub struct Pacer {
    next: Instant,
    period: Duration,
    late: Lateness,
}

/// How late ticks opened: a histogram, one bin a microsecond.
#[derive(Clone, Debug)]
pub struct Lateness {
    /// The last bin holds all that is longer.
    bins: Vec<u32>,
    max_us: u64,
}

/// Bins of [`Lateness`].
const LATE_BINS: usize = 20_000;

impl Default for Lateness {
    fn default() -> Self {
        Self { bins: vec![0; LATE_BINS], max_us: 0 }
    }
}

impl Lateness {
    fn note(&mut self, late: Duration) {
        let late_us = late.as_micros() as u64;
        self.bins[(late_us as usize).min(LATE_BINS - 1)] += 1;
        self.max_us = self.max_us.max(late_us);
    }

    /// Mean, median, 99th percentile and maximum, s.
    #[must_use]
    pub fn spread(&self) -> Percentiles {
        histogram::percentiles(&self.bins, self.max_us, 1e-6)
    }
}

impl Pacer {
    /// The first tick opens now; ticks last `dt_s` simulated seconds.
    #[must_use]
    pub fn new(dt_s: f64, speed: f64) -> Self {
        let period = Duration::from_secs_f64(dt_s / speed);
        Self { next: Instant::now(), period, late: Lateness::default() }
    }

    /// The deadline of the tick that opens now, which is when the next one opens.
    pub fn open(&mut self) -> Instant {
        let now = Instant::now();
        self.late.note(now.saturating_duration_since(self.next));
        if now.saturating_duration_since(self.next) > STALL {
            self.next = now;
        }
        self.next += self.period;
        self.next
    }

    /// How late ticks opened so far.
    #[must_use]
    pub fn lateness(&self) -> &Lateness {
        &self.late
    }

    /// Stands still for a while that does not count.
    pub fn stand_still(&mut self, span: Duration) {
        self.next += span;
    }

    /// Sleeps until the next tick opens.
    pub fn pause(&self) {
        std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_read_back_as_written() {
        for text in ["lockstep", "realtime", "realtime:2.5"] {
            assert_eq!(text.parse::<Clock>().unwrap().to_string(), text);
        }
        for text in ["", "realtime:", "realtime:0", "realtime:-1", "realtime:inf", "realtime:nan", "lockstep:2", "fast"]
        {
            assert!(text.parse::<Clock>().unwrap_err().contains("expected `lockstep`"), "{text}");
        }
    }

    #[test]
    fn deadlines_keep_to_the_grid_and_start_anew_after_a_stall() {
        let mut pacer = Pacer::new(0.02, 2.0);
        let (first, second) = (pacer.open(), pacer.open());
        assert_eq!(second - first, Duration::from_millis(10));
        pacer.stand_still(Duration::from_millis(40));
        assert_eq!(pacer.open() - second, Duration::from_millis(50));
        pacer.next -= Duration::from_secs(5);
        assert!(pacer.open() > Instant::now());
        let late = pacer.lateness().spread();
        assert!(late.max.unwrap() > 4.0 && late.p99 == late.max && late.p50.unwrap() < 1.0, "{late:?}");
    }
}
