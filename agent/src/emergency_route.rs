//! A drone's own route past an obstacle set that no leader has planned for.

use skein_leader::cost::{Flight, shortest, trips};
use skein_leader::routes::Routes;
use skein_protocol::payload::set_tag;
use skein_protocol::{ObstacleId, Vec2};

/// A set, the routes past it, and the one that is taken.
#[derive(Clone, Debug)]
pub struct EmergencyRoute {
    ids: Vec<ObstacleId>,
    set: u32,
    routes: Routes,
    route: usize,
}

impl EmergencyRoute {
    /// The shortest route past `routes` from `position` (world frame, m); `None` if the drone is past the set. `ids`: the obstacles of the
    /// set.
    #[must_use]
    pub fn shortest(ids: &[ObstacleId], routes: Routes, position: Vec2, flight: &Flight) -> Option<Self> {
        if position.x >= routes.exit_x_m() {
            return None;
        }
        let route = shortest(&trips(&[], &routes, position, flight));
        Some(Self { ids: ids.to_vec(), set: set_tag(ids), routes, route })
    }

    /// Whether one of these obstacles is in the set.
    #[must_use]
    pub fn has_any_of(&self, ids: &[ObstacleId]) -> bool {
        ids.iter().any(|id| self.ids.contains(id))
    }

    /// Tag of the set.
    #[must_use]
    pub fn set(&self) -> u32 {
        self.set
    }

    /// The routes past the set.
    #[must_use]
    pub fn routes(&self) -> &Routes {
        &self.routes
    }

    /// The route that is taken, from right to left.
    #[must_use]
    pub fn route(&self) -> usize {
        self.route
    }

    /// Changes to another route.
    pub fn change_to(&mut self, route: usize) {
        self.route = route;
    }
}
