//! The faults that a scenario schedules: what happens to which drones, and when.

use crate::sensor_errors::RangingErrors;
use skein_protocol::record::FaultKind;
use skein_protocol::{DroneId, GroupId, Vec2};
use std::f64::consts::TAU;

/// All faults of a mission.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Key of random targets, noise and gusts.
    pub seed: u64,
    /// The faults in the scenario's order. Those that are due in the same tick begin in this order.
    pub faults: Vec<Fault>,
}

impl FaultPlan {
    /// The number of a partition among the plan's partitions, from 0. `place` is its index in the plan.
    pub(crate) fn partition_number(&self, place: usize) -> usize {
        self.faults[..place].iter().filter(|fault| matches!(fault.effect, FaultEffect::Partition(_))).count()
    }

    /// The greatest latency of a fault of ranging, s.
    pub(crate) fn ranging_latency_max_s(&self) -> f64 {
        let latency_s = |fault: &Fault| match &fault.effect {
            FaultEffect::Ranging(errors) => errors.latency_s,
            _ => 0.0,
        };
        self.faults.iter().map(latency_s).fold(0.0, f64::max)
    }
}

/// One fault. It happens once.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// What happens.
    pub effect: FaultEffect,
    /// When it begins.
    pub time: FaultTime,
    /// Which drones it affects.
    pub targets: FaultTargets,
    /// How long it lasts, s; infinite: to the end of the mission. [`FaultEffect::Kill`] ignores it.
    pub for_s: f64,
}

/// What a fault does.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultEffect {
    /// The process is killed.
    Kill,
    /// The process is stopped, and continued at the end of the fault.
    Freeze,
    /// The process is killed, and a new one is started at the end of the fault.
    Restart,
    /// The drone's reaction time is longer by this, s.
    Slow(f64),
    /// The drone receives no frames.
    Deaf,
    /// No drone receives this drone's frames.
    Mute,
    /// No frame passes between drones on different sides. Each list is one side. [`Fault::targets`] is ignored.
    Partition(Vec<Vec<DroneId>>),
    /// Sensors measure nothing.
    Blind {
        /// The obstacle sensor.
        obstacles: bool,
        /// The ranging sensor, which measures neighbours.
        ranging: bool,
    },
    /// What the drone ranges of its neighbours is as bad as this, or worse.
    Ranging(RangingErrors),
    /// The position that the drone reads of itself is biased, or drifts.
    Gnss(PositionDrift),
    /// The drone's clock jumps, or drifts.
    Clock(ClockDrift),
    /// The drone reads a wrong position and velocity of itself.
    Noise(Noise),
    /// Wind accelerates the drone.
    Wind(Wind),
}

/// The error of the position and velocity that a drone reads of itself. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Constant error of the position, m.
    pub position_bias_m: Vec2,
    /// Standard deviation of each coordinate of the position, m. The error is drawn anew in each tick.
    pub position_std_m: f64,
    /// Constant error of the velocity, m/s.
    pub velocity_bias_mps: Vec2,
    /// Standard deviation of each coordinate of the velocity, m/s. The error is drawn anew in each tick.
    pub velocity_std_mps: f64,
}

/// An error of the position that a drone reads of itself. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionDrift {
    /// The error when the fault begins, m.
    pub bias_m: Vec2,
    /// What is added in each second, m/s.
    pub drift_mps: Vec2,
    /// Greatest length of the error, m; may be infinite.
    pub max_m: f64,
}

impl PositionDrift {
    /// The error this long after the fault has begun, m.
    pub(crate) fn after_m(&self, seconds: f64) -> Vec2 {
        (self.bias_m + self.drift_mps * seconds).cap_magnitude(self.max_m)
    }
}

/// An error of a drone's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockDrift {
    /// What the clock jumps ahead when the fault begins, s.
    pub offset_s: f64,
    /// What it gains from then on, in millionths.
    pub drift_ppm: f64,
}

impl ClockDrift {
    /// The error this long after the fault has begun, s.
    pub(crate) fn after_s(&self, seconds: f64) -> f64 {
        self.offset_s + self.drift_ppm * 1e-6 * seconds
    }
}

/// An acceleration that is added to the commanded one. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wind {
    /// The constant part, m/s².
    pub acceleration_mps2: Vec2,
    /// Standard deviation of each coordinate of the gusts, m/s². Each drone and gust has a draw of its own.
    pub gust_mps2: f64,
    /// Duration of one gust, s.
    pub gust_s: f64,
}

/// When a fault begins: in the first tick at or after this time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultTime {
    /// A time since the start of the mission, s.
    At(f64),
    /// A time after an event.
    On {
        /// The event.
        event: FaultTrigger,
        /// Which obstacle set the event is about, from 0, in flight order. For elections: which election, from 0.
        stage: usize,
        /// The delay after the event, s.
        after_s: f64,
    },
}

/// An event that starts a fault. The world looks for it at the beginning of each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultTrigger {
    /// A living drone senses the obstacle set for the first time.
    Detected,
    /// A drone obeys a plan to avoid the set. A plan that it already obeyed at the detection does not count.
    Grouped,
    /// A drone has a place in a queue past the set.
    Queued,
    /// The first living drone is past the mean centre abscissa of the set.
    Gate,
    /// The last living drone is past the mean centre abscissa of the set.
    Passed,
    /// A drone past the set obeys a plan to re-form.
    Reforming,
    /// A drone begins to lead a group.
    LeaderElected,
    /// A drone begins to lead a subgroup.
    GroupLeaderElected,
}

/// Which drones a fault affects. Roles are resolved when the fault begins. A fault whose role no drone has then waits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultTargets {
    /// These drones. Those that are dead are skipped.
    Drones(Vec<DroneId>),
    /// The leader of the shallowest group; of several the one with the highest ballot, then with the lowest id.
    Leader,
    /// The leader of this group.
    GroupLeader(GroupId),
    /// The drone with the lowest rank in a queue; of several the one farthest along the flight.
    FirstInQueue,
    /// The drone with the highest rank in a queue; of several the one least far along the flight.
    LastInQueue,
    /// The drone with the lowest id among those that lead no group.
    Member,
    /// One living drone, chosen by the seed.
    Random,
    /// All living drones.
    All,
}

/// What a runtime has to do to a drone's process before the tick goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessCommand {
    /// Kill it.
    Kill(DroneId),
    /// Stop it: it receives and answers nothing until it is resumed.
    Freeze(DroneId),
    /// Continue it: this tick is the first that it receives and answers.
    Resume(DroneId),
    /// Start a new process of this incarnation: this tick is its first.
    Restart(DroneId, u32),
}

impl FaultEffect {
    /// The kind that the record shows.
    #[must_use]
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Kill => FaultKind::Kill,
            Self::Freeze => FaultKind::Freeze,
            Self::Restart => FaultKind::Restart,
            Self::Slow(_) => FaultKind::Slow,
            Self::Deaf => FaultKind::Deaf,
            Self::Mute => FaultKind::Mute,
            Self::Partition(_) => FaultKind::Partition,
            Self::Blind { .. } => FaultKind::Blind,
            Self::Ranging(_) => FaultKind::Ranging,
            Self::Gnss(_) => FaultKind::Gnss,
            Self::Clock(_) => FaultKind::Clock,
            Self::Noise(_) => FaultKind::Noise,
            Self::Wind(_) => FaultKind::Wind,
        }
    }

    /// A description for people, used in the events.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::Kill => "killed".to_owned(),
            Self::Freeze => "stopped".to_owned(),
            Self::Restart => "killed, a new process follows".to_owned(),
            Self::Slow(extra_s) => format!("reacts {extra_s} s later"),
            Self::Deaf => "hears no other drone".to_owned(),
            Self::Mute => "is heard by no other drone".to_owned(),
            Self::Partition(sides) => {
                let side = |side: &Vec<DroneId>| side.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                format!("no frame passes between {}", sides.iter().map(side).collect::<Vec<_>>().join(" | "))
            }
            Self::Blind { obstacles, ranging } => match (obstacles, ranging) {
                (true, true) => "senses neither obstacles nor neighbours".to_owned(),
                (true, false) => "senses no obstacles".to_owned(),
                _ => "senses no neighbours".to_owned(),
            },
            Self::Ranging(errors) => ranging_words(errors),
            Self::Gnss(g) => {
                let most = if g.max_m.is_finite() { format!(", {} m at most", g.max_m) } else { String::new() };
                let (bias, drift) = (g.bias_m, g.drift_mps);
                format!("position wrong by [{}, {}] m and [{}, {}] m/s{most}", bias.x, bias.y, drift.x, drift.y)
            }
            Self::Clock(c) => format!("clock wrong by {} s and {} ppm", c.offset_s, c.drift_ppm),
            Self::Noise(n) => format!(
                "position wrong by [{}, {}] m ± {} m, velocity by [{}, {}] m/s ± {} m/s",
                n.position_bias_m.x,
                n.position_bias_m.y,
                n.position_std_m,
                n.velocity_bias_mps.x,
                n.velocity_bias_mps.y,
                n.velocity_std_mps
            ),
            Self::Wind(w) => {
                format!("wind of [{}, {}] m/s² ± {} m/s²", w.acceleration_mps2.x, w.acceleration_mps2.y, w.gust_mps2)
            }
        }
    }
}

/// A description of a fault of ranging.
fn ranging_words(r: &RangingErrors) -> String {
    let mut words = format!(
        "ranges with a share of {} missing and {} too long by {} m, ± {} m, ± {} rad, ± {} m/s",
        r.dropout_share, r.outlier_share, r.outlier_m, r.std_m, r.bearing_std_rad, r.velocity_std_mps
    );
    if r.latency_s > 0.0 {
        words += &format!(", {} s late", r.latency_s);
    }
    if r.field_rad < TAU {
        words += &format!(", in a field of {} rad", r.field_rad);
    }
    if r.occlusion {
        words += ", not past obstacles";
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_ranging_is_described_as_far_as_it_goes() {
        let noisy = RangingErrors { std_m: 2.0, ..RangingErrors::default() };
        let text = "ranges with a share of 0 missing and 0 too long by 0 m, ± 2 m, ± 0 rad, ± 0 m/s";
        assert_eq!(FaultEffect::Ranging(noisy).words(), text);
        let worse = RangingErrors { latency_s: 0.5, field_rad: 1.5, occlusion: true, ..noisy };
        let more = format!("{text}, 0.5 s late, in a field of 1.5 rad, not past obstacles");
        assert_eq!(FaultEffect::Ranging(worse).words(), more);
    }
}
