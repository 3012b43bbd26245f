//! The keys of `[[host]]`: which drones fly on which machine.

use crate::limits::MAX_DRONES;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A machine that flies drones. `skein run` uses it if it is told where the machine is, by `connect` or by `--connect`.
/// Otherwise the drones fly on the launcher's machine, with the same digest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HostKeys {
    /// Name of the host, as given to `skein host --name`. At most 64 letters, digits, `.`, `_` and `-`.
    #[schemars(length(min = 1, max = 64))]
    pub name: String,
    /// Number of drones that fly there.
    #[schemars(range(min = 1, max = MAX_DRONES))]
    pub drones: u32,
    /// Where the host can be reached: a Zenoh endpoint, such as `tls/10.0.0.2:7447`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1, max = 256))]
    pub connect: Option<String>,
}
