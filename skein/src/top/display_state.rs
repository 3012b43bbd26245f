//! What the user has selected with the keys.

/// What the user has selected with the keys.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DisplayState {
    /// Index of the swarm whose groups are shown.
    pub(crate) chosen: usize,
    /// Whether its drones are shown.
    pub(crate) drones: bool,
    /// Whether the display is paused.
    pub(crate) paused: bool,
}
