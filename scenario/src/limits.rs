//! How large a scenario may be.

/// Greatest number of drones.
pub const MAX_DRONES: u32 = 10_000;

/// Greatest number of obstacles.
pub const MAX_OBSTACLES: usize = 1024;

/// Greatest number of pilot tables.
pub const MAX_PILOTS: usize = 256;

/// Greatest number of faults.
pub const MAX_FAULTS: usize = 1024;

/// Greatest number of hosts.
pub const MAX_HOSTS: usize = 256;
