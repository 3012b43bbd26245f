//! Drones that keep a mission from its goal when its time is over.

use crate::ids::DroneId;
use crate::wire::Phase;
use serde::{Deserialize, Serialize};

/// What a drone still had to do when the time of the mission was over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lack {
    /// It has never been past all obstacles, and the mission asks for that.
    Pass,
    /// It is in no slot of the formation that is not taken.
    Slot,
    /// It is in its slot and too fast.
    Stop,
    /// Its pilot does not say that the mission is done, and the mission asks for that.
    Done,
}

/// A living drone that kept the mission from its goal when the time was over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnfinishedDrone {
    /// The drone.
    pub drone: DroneId,
    /// What it still had to do.
    pub lack: Lack,
    /// Distance from the slot that is left for it, m; `None` if the goal has no slots.
    pub slot_distance_m: Option<f64>,
    /// How long it had not moved, s.
    pub still_s: f64,
    /// The first obstacle set whose middle is ahead of it, from 0, in flight order.
    pub stage: Option<u32>,
    /// The drone's group.
    pub group: String,
    /// The drone whose plan it obeys.
    pub leader: Option<DroneId>,
    /// Phase of that plan.
    pub phase: Phase,
    /// Its route past the obstacle set, 0 = rightmost; `None` if it has none.
    pub route: Option<u16>,
    /// Its place in the queue of that route, 0 = first; `None` if it has no route.
    pub rank: Option<u16>,
}

#[cfg(test)]
mod tests {
    use crate::record::{EventKind, RunEvent, Totals};

    #[test]
    fn an_end_that_was_recorded_before_names_no_unfinished_drones() {
        let totals = serde_json::to_string(&Totals::default()).unwrap();
        let line = format!(r#"{{"t_s":9.0,"event":"end","outcome":"timeout","reason":"over","totals":{totals}}}"#);
        let event: RunEvent = serde_json::from_str(&line).unwrap();
        let EventKind::End { unfinished, standstill_s: None, .. } = event.what else { panic!("{event:?}") };
        assert_eq!(unfinished, []);
    }
}
