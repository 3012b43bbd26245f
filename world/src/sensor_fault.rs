//! How a drone's senses differ from the truth.

use crate::fault_plan::FaultEffect;
use crate::sensor_errors::RangingErrors;
use skein_protocol::Vec2;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::wire::BrokenSensors;

/// What the faults in force do to one drone's senses and radio.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SensorFault {
    /// Its radio.
    pub(crate) link_faults: LinkFaults,
    /// Added to its reaction time, s.
    pub(crate) extra_reaction_s: f64,
    /// It senses no obstacles.
    pub(crate) no_obstacles: bool,
    /// It senses no neighbours.
    pub(crate) no_ranging: bool,
    /// What it ranges is as bad as this, or worse.
    pub(crate) ranging: RangingErrors,
    /// Added to the position that it reads of itself, m, with the outlines that it senses.
    pub(crate) gnss_error_m: Vec2,
    /// What its clock is ahead, in addition to the error of every clock, s.
    pub(crate) clock_error_s: f64,
    /// Added to the position that it reads of itself, m. What it measures relative to itself stays right.
    pub(crate) position_error_m: Vec2,
    /// Added to the velocity that it reads of itself, m/s.
    pub(crate) velocity_error_mps: Vec2,
}

impl SensorFault {
    /// Adds an effect that lasts and is the same in each tick, other than a partition.
    pub(crate) fn add(&mut self, effect: &FaultEffect) {
        match effect {
            FaultEffect::Slow(extra_s) => self.extra_reaction_s += extra_s,
            FaultEffect::Deaf => self.link_faults.deaf = 1,
            FaultEffect::Mute => self.link_faults.mute = 1,
            FaultEffect::Blind { obstacles, ranging } => {
                self.no_obstacles |= obstacles;
                self.no_ranging |= ranging;
            }
            FaultEffect::Ranging(errors) => self.ranging = self.ranging.or_worse(errors),
            FaultEffect::Kill
            | FaultEffect::Freeze
            | FaultEffect::Restart
            | FaultEffect::Partition(_)
            | FaultEffect::Gnss(_)
            | FaultEffect::Clock(_)
            | FaultEffect::Noise(_)
            | FaultEffect::Wind(_) => {}
        }
    }

    /// The broken sensors. A ranging sensor that the drone does not have is not broken.
    pub(crate) fn broken(&self, has_ranging: bool) -> BrokenSensors {
        BrokenSensors { obstacles: self.no_obstacles, ranging: self.no_ranging && has_ranging }
    }
}
