//! The channel that drones near each other share, as far as a drone has to know it to say no more than its part.

/// The shared channel. The default has no limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelParams {
    /// Bandwidth that drones near each other share, bytes/s; infinite if it is no limit.
    pub bandwidth_bytes_per_s: f64,
    /// Distance within which drones share the bandwidth, m; infinite if all do.
    pub carrier_sense_m: f64,
    /// The greatest number of drones within that distance of one drone, itself included, as long as they are in formation.
    pub drones: u32,
}

impl ChannelParams {
    /// One drone's part of the bandwidth if so many share it, bytes/s.
    #[must_use]
    pub(crate) fn part_bytes_per_s(&self, drones: u32) -> f64 {
        self.bandwidth_bytes_per_s / f64::from(drones.max(1))
    }
}

impl Default for ChannelParams {
    fn default() -> Self {
        Self { bandwidth_bytes_per_s: f64::INFINITY, carrier_sense_m: f64::INFINITY, drones: 1 }
    }
}
