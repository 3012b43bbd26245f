//! A line of commands that take effect some ticks after they were given.

use std::collections::VecDeque;

/// Holds commands back for a number of ticks, which may change.
#[derive(Clone, Debug, Default)]
pub struct CommandDelay<T> {
    /// Commands that have been given and have not taken effect, the oldest first.
    pending: VecDeque<T>,
    /// The command that took effect last.
    last: T,
}

impl<T: Copy> CommandDelay<T> {
    /// Delays commands by this many ticks from now on. When the delay grows, the last command is repeated; when it shrinks,
    /// the oldest commands are skipped.
    pub fn set_ticks(&mut self, ticks: usize) {
        while self.pending.len() > ticks {
            self.pending.pop_front();
        }
        while self.pending.len() < ticks {
            self.pending.push_front(self.last);
        }
    }

    /// The delay, in ticks.
    #[must_use]
    pub fn ticks(&self) -> usize {
        self.pending.len()
    }

    /// Commands that have not taken effect, the oldest first.
    pub fn pending(&self) -> impl Iterator<Item = &T> {
        self.pending.iter()
    }

    /// Replaces the commands that have not taken effect: each by what `next` returns, the oldest first.
    pub fn replace(&mut self, mut next: impl FnMut() -> T) {
        self.pending.iter_mut().for_each(|command| *command = next());
    }

    /// Accepts a command and returns the one that takes effect now.
    pub fn push(&mut self, command: T) -> T {
        self.last = match self.pending.pop_front() {
            Some(oldest) => {
                self.pending.push_back(command);
                oldest
            }
            None => command,
        };
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longer_delay_repeats_the_last_command_and_a_shorter_one_skips_the_oldest() {
        let mut delay = CommandDelay::default();
        assert_eq!([1, 2].map(|command| delay.push(command)), [1, 2]);
        delay.set_ticks(2);
        assert_eq!([3, 4, 5].map(|command| delay.push(command)), [2, 2, 3]);
        delay.set_ticks(1);
        assert_eq!((delay.ticks(), delay.push(6)), (1, 5));
    }
}
