//! Names of the strategies, geometries and scenarios that are flown, and the seeds of jittered starts.

/// The strategy that follows the paper's rule: the default.
pub const PAPER: &str = "congestion-aware-paper";
/// The strategy that the paper compares with.
pub const SHORTEST: &str = "shortest-path";
/// The strategy in which the leader looks ahead by simulation.
pub const LOOK_AHEAD: &str = "congestion-aware";
/// These three, in the order of the tables.
pub(crate) const STRATEGIES: [&str; 3] = [PAPER, LOOK_AHEAD, SHORTEST];
/// The geometries, which were found by search because the paper gives none.
pub(crate) const GEOMETRIES: [&str; 3] = ["s1", "s2", "s3b"];
/// Where the obstacle is, seen in the direction of flight.
pub(crate) const PLACEMENTS: [&str; 3] = ["centred", "left", "right"];
/// Number of drones in the missions with one obstacle.
pub(crate) const DRONES: u32 = 8;

/// The strategy that sends `left` drones past the left side.
pub(crate) fn fixed(left: u32) -> String {
    format!("fixed:{left}/{}", DRONES.saturating_sub(left))
}

/// Seeds of the flights with jittered starts.
pub(crate) fn seeds(quick: bool) -> std::ops::RangeInclusive<u64> {
    1..=if quick { 8 } else { 30 }
}

/// Scenarios that are flown from jittered starts. S1 has no room for jitter: its slots are 35 m apart, and its safe
/// distance is 33 m.
pub(crate) fn jittered(quick: bool) -> &'static [&'static str] {
    if quick { &["s2-right", "forest"] } else { &["s2-right", "forest", "s3b-right"] }
}

/// A geometry's or scenario's name in words: `S2`, `S2-right`.
pub(crate) fn title(name: &str) -> String {
    name.strip_prefix('s').map_or_else(|| name.to_owned(), |rest| format!("S{rest}"))
}
