//! What the recording and the page draw beside the drones.

use serde::{Deserialize, Serialize};
use skein_protocol::radio::Radio;

/// What a picture of the run needs and no figure of the summary depends on. World frame, SI units.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneFacts {
    /// Altitude of the formation, m. The page names the altitude of drones that are elsewhere.
    pub altitude_m: f64,
    /// The radio model, from which it follows which drone receives which frame.
    pub radio: Radio,
    /// Distance at which drones sense obstacles, m.
    pub detection_range_m: f64,
    /// Coefficients of the radius of a drone's danger zone at speed v in m/s: `[0] + [1]·v + [2]·v²`, m.
    pub danger_m: [f64; 3],
    /// The obstacle sets as a leader with complete knowledge sees them, in flight order.
    pub sets: Vec<SetOutline>,
}

impl SceneFacts {
    /// Radius of the danger zone at this speed, m.
    #[must_use]
    pub fn danger_zone_m(&self, speed_mps: f64) -> f64 {
        self.danger_m[0] + speed_mps * (self.danger_m[1] + speed_mps * self.danger_m[2])
    }
}

/// The inflated obstacles of a set, and the routes past it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetOutline {
    /// The ids of its obstacles.
    pub obstacles: Vec<u32>,
    /// How far along the course its gate is, m.
    pub gate_x_m: f64,
    /// Outlines of the inflated obstacles, m. Obstacles without a passable gap between them have one outline.
    pub hulls_m: Vec<Vec<[f64; 2]>>,
    /// A polyline for each route, m, from the rightmost route to the leftmost.
    pub routes_m: Vec<Vec<[f64; 2]>>,
    /// The obstacles from right to left, those without a passable gap between them together.
    #[serde(default)]
    pub envelopes: Vec<Vec<u32>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_danger_zone_grows_with_the_square_of_speed() {
        let scene = SceneFacts { danger_m: [15.0, 1.0, 0.2], ..SceneFacts::default() };
        assert_eq!((scene.danger_zone_m(0.0), scene.danger_zone_m(10.0)), (15.0, 45.0));
    }
}
