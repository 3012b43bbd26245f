//! A drone's reaction time t_c: what it decides takes effect so much later.

use skein_protocol::Vec2;
use std::collections::VecDeque;

/// Commands on their way to the actuators.
#[derive(Clone, Debug)]
pub(crate) struct Reaction {
    own_s: f64,
    dt_s: f64,
    line: VecDeque<Vec2>,
    /// What takes effect now, m/s².
    last: Vec2,
}

impl Reaction {
    /// With a reaction time, s, and ticks of `dt_s`.
    pub fn new(reaction_time_s: f64, dt_s: f64) -> Self {
        let line = VecDeque::from(vec![Vec2::zeros(); ticks(reaction_time_s, dt_s)]);
        Self { own_s: reaction_time_s, dt_s, line, last: Vec2::zeros() }
    }

    /// Makes the reaction time longer than its own by this, s, and gives it: while the line gets longer the last command
    /// goes on, when it gets shorter the oldest ones are left out.
    pub fn slow_down(&mut self, extra_s: f64) -> f64 {
        let wanted = ticks(self.own_s + extra_s, self.dt_s);
        while self.line.len() > wanted {
            self.line.pop_front();
        }
        while self.line.len() < wanted {
            self.line.push_front(self.last);
        }
        self.own_s + extra_s
    }

    /// How long a command that is given now takes to take effect, s.
    pub fn span_s(&self) -> f64 {
        self.line.len() as f64 * self.dt_s
    }

    /// How far the drone will have flown, m, and its velocity, m/s, when a command that is given now takes effect: what is
    /// on its way to the actuators is known.
    pub fn foresee(&self, velocity: Vec2) -> (Vec2, Vec2) {
        let fly = |(offset, velocity): (Vec2, Vec2), command: &Vec2| {
            let next = velocity + command * self.dt_s;
            (offset + (velocity + next) * (self.dt_s / 2.0), next)
        };
        self.line.iter().fold((Vec2::zeros(), velocity), fly)
    }

    /// Takes a command in, m/s², and gives the one that takes effect now.
    pub fn delay(&mut self, command: Vec2) -> Vec2 {
        self.line.push_back(command);
        self.last = self.line.pop_front().unwrap_or(command);
        self.last
    }
}

fn ticks(span_s: f64, dt_s: f64) -> usize {
    (span_s / dt_s).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_on_its_way_is_foreseen() {
        let mut reaction = Reaction::new(0.1, 0.02);
        let (mut position, mut velocity) = (Vec2::zeros(), Vec2::new(10.0, 0.0));
        let commands: Vec<Vec2> = (0..20).map(|i| Vec2::new(f64::from(i % 7) - 3.0, f64::from(i % 3))).collect();
        let mut foreseen = Vec::new();
        for command in commands {
            let (offset, then) = reaction.foresee(velocity);
            foreseen.push((position + offset, then));
            let next = velocity + reaction.delay(command) * 0.02;
            position += (velocity + next) * 0.01;
            velocity = next;
            if foreseen.len() >= 5 {
                let (p, v) = foreseen[foreseen.len() - 5];
                assert!((p - position).norm() < 1e-12 && (v - velocity).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn the_line_is_lengthened_and_shortened() {
        let mut reaction = Reaction::new(0.04, 0.02);
        let mut said = Vec::new();
        for (tick, extra_s) in [0.0, 0.0, 0.0, 0.04, 0.04, 0.04, 0.0, 0.0].into_iter().enumerate() {
            assert_eq!(reaction.slow_down(extra_s), 0.04 + extra_s);
            said.push(reaction.delay(Vec2::new(1.0 + tick as f64, 0.0)).x);
        }
        // Two ticks late; then command 1 goes on until the line is four ticks long; then two are left out.
        assert_eq!(said, [0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 5.0, 6.0]);
    }
}
