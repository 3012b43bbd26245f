//! The reaction time t_c of a drone: a command takes effect that long after it was given.

use crate::braking_path::BrakingLaw;
use crate::command_delay::CommandDelay;
use skein_protocol::Vec2;

/// Holds commands back for the reaction time.
#[derive(Clone, Debug)]
pub(crate) struct ReactionDelay {
    nominal_s: f64,
    /// Added to the nominal reaction time, s.
    extra_s: f64,
    dt_s: f64,
    /// Commands, m/s².
    commands: CommandDelay<Vec2>,
}

/// How a drone moves until a command that it gives now takes effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PendingMotion {
    /// How far it will have flown, m.
    pub(crate) offset: Vec2,
    /// Its velocity at the end, m/s.
    pub(crate) velocity: Vec2,
}

impl ReactionDelay {
    /// A delay of `reaction_time_s` in ticks of `dt_s`.
    pub(crate) fn new(reaction_time_s: f64, dt_s: f64) -> Self {
        let mut commands = CommandDelay::default();
        commands.set_ticks(ticks(reaction_time_s, dt_s));
        Self { nominal_s: reaction_time_s, extra_s: 0.0, dt_s, commands }
    }

    /// Adds `extra_s` to the nominal reaction time and returns the sum, s. When the delay grows, the last command is
    /// repeated; when it shrinks, the oldest commands are skipped.
    pub(crate) fn set_extra(&mut self, extra_s: f64) -> f64 {
        if extra_s != self.extra_s {
            self.extra_s = extra_s;
            self.commands.set_ticks(ticks(self.nominal_s + extra_s, self.dt_s));
        }
        self.nominal_s + extra_s
    }

    /// The delay, ticks.
    pub(crate) fn ticks(&self) -> usize {
        self.commands.ticks()
    }

    /// The delay in whole ticks, s.
    pub(crate) fn delay_s(&self) -> f64 {
        self.ticks() as f64 * self.dt_s
    }

    /// The motions of a drone with `velocity` (m/s) up to the end of each tick whose command is pending.
    pub(crate) fn pending_motions(&self, velocity: Vec2) -> impl Iterator<Item = PendingMotion> {
        let dt_s = self.dt_s;
        let start = PendingMotion { offset: Vec2::zeros(), velocity };
        self.commands.pending().scan(start, move |motion, command| {
            let next = motion.velocity + command * dt_s;
            motion.offset += (motion.velocity + next) * (dt_s / 2.0);
            motion.velocity = next;
            Some(*motion)
        })
    }

    /// The motion of a drone with `velocity` (m/s) under all pending commands.
    pub(crate) fn pending_motion(&self, velocity: Vec2) -> PendingMotion {
        let none = PendingMotion { offset: Vec2::zeros(), velocity };
        self.pending_motions(velocity).last().unwrap_or(none)
    }

    /// In tick `tick`, replaces all pending commands by full braking from `velocity` (m/s). A drone that missed ticks was braked by its
    /// failsafe, and goes on braking until its next command takes effect. At the start, before the first command of any drone takes
    /// effect, the failsafe flies straight on.
    pub(crate) fn brake(&mut self, tick: u64, mut velocity: Vec2, law: BrakingLaw) {
        let (first, mut ticks) = (self.commands.ticks() as u64, tick..);
        self.commands.replace(|| {
            let braking = if ticks.next() < Some(first) { Vec2::zeros() } else { law.braking(velocity) };
            velocity += braking * law.dt_s;
            braking
        });
    }

    /// Accepts a command and returns the one that takes effect now, m/s².
    pub(crate) fn push(&mut self, command: Vec2) -> Vec2 {
        self.commands.push(command)
    }
}

fn ticks(span_s: f64, dt_s: f64) -> usize {
    (span_s / dt_s).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_under_pending_commands_is_predicted() {
        let mut delay = ReactionDelay::new(0.1, 0.02);
        let (mut position, mut velocity) = (Vec2::zeros(), Vec2::new(10.0, 0.0));
        let commands: Vec<Vec2> = (0..20).map(|i| Vec2::new(f64::from(i % 7) - 3.0, f64::from(i % 3))).collect();
        let mut predicted = Vec::new();
        for command in commands {
            let motion = delay.pending_motion(velocity);
            predicted.push((position + motion.offset, motion.velocity));
            let next = velocity + delay.push(command) * 0.02;
            position += (velocity + next) * 0.01;
            velocity = next;
            if predicted.len() >= 5 {
                let (p, v) = predicted[predicted.len() - 5];
                assert!((p - position).norm() < 1e-12 && (v - velocity).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn a_drone_that_missed_ticks_goes_on_braking() {
        let mut delay = ReactionDelay::new(0.1, 0.02);
        for _ in 0..9 {
            delay.push(Vec2::new(3.0, 0.0));
        }
        let law = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };
        delay.brake(9, Vec2::new(0.0, 1.0), law);
        let motion = delay.pending_motion(Vec2::new(0.0, 1.0));
        assert!((motion.velocity - Vec2::new(0.0, 0.5)).norm() < 1e-12, "{motion:?}");
        delay.brake(9, Vec2::new(0.0, 0.15), law);
        assert!(
            delay.pending_motion(Vec2::new(0.0, 0.15)).velocity.norm() < 1e-12,
            "it stops, and does not turn round"
        );
    }

    #[test]
    fn the_delay_grows_and_shrinks() {
        let mut delay = ReactionDelay::new(0.04, 0.02);
        let mut effective = Vec::new();
        for (tick, extra_s) in [0.0, 0.0, 0.0, 0.04, 0.04, 0.04, 0.0, 0.0].into_iter().enumerate() {
            assert_eq!(delay.set_extra(extra_s), 0.04 + extra_s);
            effective.push(delay.push(Vec2::new(1.0 + tick as f64, 0.0)).x);
        }
        // Two ticks late. Then command 1 repeats until the delay is four ticks. Then two commands are skipped.
        assert_eq!(effective, [0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 5.0, 6.0]);
    }

    #[test]
    fn a_drone_that_missed_ticks_at_the_start_flies_straight_on_at_first() {
        let mut delay = ReactionDelay::new(0.1, 0.02);
        let law = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };
        delay.brake(2, Vec2::new(0.0, 1.0), law);
        let speeds: Vec<f64> = delay.pending_motions(Vec2::new(0.0, 1.0)).map(|motion| motion.velocity.y).collect();
        let expected = [1.0, 1.0, 1.0, 0.9, 0.8];
        assert!(speeds.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{speeds:?}");
    }
}
