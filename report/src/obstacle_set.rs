//! Obstacles that a swarm passes together.

/// Obstacles that the swarm passes together: one stage of the mission.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ObstacleSet {
    /// The ids of its obstacles, ascending.
    pub obstacles: Vec<u32>,
    /// Mean of the obstacles' centres along the course, m. A drone beyond it has passed the set.
    pub gate_x_m: f64,
}
