//! Bounds on the errors of what a drone knows of itself and of obstacles. `docs/safety.md`, "Real sensors", says what each adds.

/// Bounds that hold for all drones. The default is no error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensingErrors {
    /// Greatest error of the position that a drone reads of itself, m.
    pub position_m: f64,
    /// Greatest displacement of an outline that a drone senses, relative to the drone, m.
    pub obstacle_m: f64,
    /// Greatest difference between a drone's clock and the time of the mission, s.
    pub clock_s: f64,
    /// Whether a drone senses only the part of an outline that it has in view.
    pub partial_outlines: bool,
}

impl SensingErrors {
    /// Greatest displacement of an outline that a drone remembers or that another drone has sensed, m. It is in the frame of the
    /// position that one drone read then, and is compared with the position that this drone reads now.
    #[must_use]
    pub fn remembered_obstacle_m(&self) -> f64 {
        self.obstacle_m + 2.0 * self.position_m
    }
}
