//! Faults that a scenario asks for: what happens to whom, and when. The plan is here; [`engine`] carries it out tick by
//! tick, by the world's truth and by what drones say of themselves, so that it is the same in every runtime.

pub(crate) mod chance;
pub(crate) mod engine;
pub(crate) mod moments;
pub(crate) mod targets;

use skein_protocol::record::FaultKind;
use skein_protocol::{DroneId, GroupId, Vec2};

/// All faults of a mission.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Key of random targets, noise and gusts.
    pub seed: u64,
    /// In the scenario's order, in which those due in the same tick begin.
    pub faults: Vec<Fault>,
}

/// One fault. It happens once.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// What happens.
    pub effect: FaultEffect,
    /// When.
    pub time: FaultTime,
    /// To whom.
    pub targets: FaultTargets,
    /// For how long, s; infinite: to the end of the mission. No part of [`FaultEffect::Kill`].
    pub for_s: f64,
}

/// What a fault does.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultEffect {
    /// The process is killed.
    Kill,
    /// The process is stopped, and continued in the end.
    Freeze,
    /// The process is killed, and a new one started in the end.
    Restart,
    /// The drone reacts so much later, s.
    Slow(f64),
    /// The drone hears nobody.
    Deaf,
    /// Nobody hears the drone.
    Mute,
    /// No frame passes between drones on different sides. `Fault::targets` means nothing.
    Partition(Vec<Vec<DroneId>>),
    /// Sensors tell nothing.
    Blind {
        /// Of obstacles.
        obstacles: bool,
        /// Of neighbours.
        ranging: bool,
    },
    /// The drone is told a wrong position and velocity of its own.
    Noise(Noise),
    /// The drone is blown about.
    Wind(Wind),
}

/// How wrong a drone's own state is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Added to the position, m.
    pub position_bias_m: Vec2,
    /// Standard deviation of what is added to each coordinate in each tick, m.
    pub position_std_m: f64,
    /// Added to the velocity, m/s.
    pub velocity_bias_mps: Vec2,
    /// As `position_std_m`, m/s.
    pub velocity_std_mps: f64,
}

/// An acceleration that nobody commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wind {
    /// Always, m/s².
    pub acceleration_mps2: Vec2,
    /// Standard deviation of each coordinate of what comes on top, m/s²: drawn for each drone and gust.
    pub gust_mps2: f64,
    /// How long a gust lasts, s.
    pub gust_s: f64,
}

/// When a fault happens: in the first tick at or after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultTime {
    /// At this time, s.
    At(f64),
    /// After an event.
    On {
        /// Which.
        event: FaultTrigger,
        /// Of which obstacle set, from 0, in flight order; of elections, which one, from 0.
        stage: usize,
        /// How long after it, s.
        after_s: f64,
    },
}

/// What a fault waits for: seen by the world at the beginning of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultTrigger {
    /// A living drone senses the obstacle set for the first time.
    Detected,
    /// A drone obeys a plan to avoid the set: one that it did not obey when the set was detected.
    Grouped,
    /// A drone has a place in a queue past the set.
    Queued,
    /// The first living drone is past the mean centre abscissa of the set.
    Gate,
    /// The last one is.
    Passed,
    /// A drone past the set obeys a plan to re-form.
    Reforming,
    /// A drone takes up leading a group.
    LeaderElected,
    /// A drone takes up leading a subgroup.
    GroupLeaderElected,
}

/// Whom a fault meets: settled when it happens. A role that nobody has then is waited for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultTargets {
    /// These, as far as they live.
    Drones(Vec<DroneId>),
    /// Who leads most: the shallowest group, then the highest ballot, then the lowest number.
    Leader,
    /// Who leads this group.
    GroupLeader(GroupId),
    /// Who has the lowest rank in a queue; of several, the one farthest along the flight.
    FirstInQueue,
    /// Who has the highest rank in a queue; of several, the one least far along the flight.
    LastInQueue,
    /// The lowest number among those who lead nobody.
    Member,
    /// Anybody living, by the seed.
    Random,
    /// All who live.
    All,
}

/// What a runtime has to do to a drone's process before the tick goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessCommand {
    /// Kill it.
    Kill(DroneId),
    /// Stop it: it hears and answers nothing until it is resumed.
    Freeze(DroneId),
    /// Continue it: this tick is the first that it hears and answers.
    Resume(DroneId),
    /// Start a new one of this incarnation: this tick is its first.
    Restart(DroneId, u32),
}

impl FaultEffect {
    /// What it is called.
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
            Self::Noise(_) => FaultKind::Noise,
            Self::Wind(_) => FaultKind::Wind,
        }
    }

    /// What it does, for people.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::Kill => "killed".to_owned(),
            Self::Freeze => "stopped".to_owned(),
            Self::Restart => "killed, a new process follows".to_owned(),
            Self::Slow(extra_s) => format!("reacts {extra_s} s later"),
            Self::Deaf => "hears nobody".to_owned(),
            Self::Mute => "is heard by nobody".to_owned(),
            Self::Partition(sides) => {
                let side = |side: &Vec<DroneId>| side.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                format!("no frame passes between {}", sides.iter().map(side).collect::<Vec<_>>().join(" | "))
            }
            Self::Blind { obstacles, ranging } => match (obstacles, ranging) {
                (true, true) => "senses neither obstacles nor neighbours".to_owned(),
                (true, false) => "senses no obstacles".to_owned(),
                _ => "senses no neighbours".to_owned(),
            },
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
