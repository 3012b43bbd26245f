//! When a drone leaves its planned route, and when it returns to it.
//!
//! A drone leaves the route if a known obstacle blocks it, and returns once the route is free. Whether it is free depends on where the
//! drone is. So it may be free from where the detour leads, and blocked again from where the route leads from there: without memory the
//! drone turns to and fro for ever. The rule against it is that of Bug algorithms (Lumelsky and Stepanov, 1987): a drone that
//! comes to a second block without progress keeps to its detour until less of the route is left than at the first one.

use skein_protocol::Vec2;

/// Where the drone left its route.
#[derive(Clone, Copy, Debug)]
struct Departure {
    /// The end of the route, world frame, m.
    end: Vec2,
    /// Length of the route that was left, m.
    route_m: f64,
    /// Whether the drone has come back and left the route again without progress.
    again: bool,
}

/// What a drone on its route knows at a look ahead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RouteView {
    /// The end of the route, world frame, m.
    pub(crate) end: Vec2,
    /// Length of the route that is left, m.
    pub(crate) route_m: f64,
    /// Whether a known obstacle blocks it.
    pub(crate) blocked: bool,
}

/// The detour of a drone.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Detour {
    to: Option<Vec2>,
    departure: Option<Departure>,
}

impl Detour {
    /// Where the detour leads, world frame, m: the end of the route. `None` on the route.
    pub(crate) fn to(&self) -> Option<Vec2> {
        self.to
    }

    /// Looks at the route. `None`: there is none. `is_better` says whether a detour is to be kept although the route is free. Progress of
    /// less than `progress_m` does not count.
    pub(crate) fn look(&mut self, route: Option<RouteView>, progress_m: f64, is_better: impl FnOnce() -> bool) {
        let Some(route) = route else {
            *self = Self::default();
            return;
        };
        let under_way = self.to == Some(route.end);
        self.departure = self.departure.filter(|departure| departure.end == route.end);
        let is_late = |departure: &Departure| route.route_m > departure.route_m - progress_m;
        if route.blocked && !under_way {
            let again = self.departure.filter(is_late).map(|departure| Departure { again: true, ..departure });
            let new = Departure { end: route.end, route_m: route.route_m, again: false };
            self.departure = Some(again.unwrap_or(new));
        }
        let kept = || self.departure.is_some_and(|departure| departure.again && is_late(&departure));
        let detours = route.blocked || (under_way && (kept() || is_better()));
        self.to = detours.then_some(route.end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const END: Vec2 = Vec2::new(400.0, 0.0);

    /// Looks once. Gives whether the drone detours.
    fn look(detour: &mut Detour, route_m: f64, blocked: bool) -> bool {
        detour.look(Some(RouteView { end: END, route_m, blocked }), 1.0, || false);
        detour.to().is_some()
    }

    #[test]
    fn a_drone_returns_to_a_route_that_is_free() {
        let mut detour = Detour::default();
        assert!(!look(&mut detour, 500.0, false));
        assert!(look(&mut detour, 490.0, true));
        assert!(!look(&mut detour, 495.0, false));
        detour.look(None, 1.0, || true);
        assert_eq!(detour.to(), None);
    }

    #[test]
    fn a_drone_that_comes_back_without_progress_keeps_to_its_detour() {
        let mut detour = Detour::default();
        look(&mut detour, 490.0, true);
        look(&mut detour, 495.0, false);
        assert!(look(&mut detour, 489.5, true));
        assert!(look(&mut detour, 495.0, false), "it would come back a third time");
        assert!(look(&mut detour, 800.0, false), "the way round may be long");
        assert!(!look(&mut detour, 450.0, false), "less is left than where it began");
    }

    #[test]
    fn blocks_with_progress_between_them_are_new() {
        let mut detour = Detour::default();
        for route_m in [490.0, 480.0, 470.0] {
            assert!(look(&mut detour, route_m, true));
            assert!(!look(&mut detour, route_m + 5.0, false));
        }
    }

    #[test]
    fn a_route_with_another_end_begins_anew() {
        let mut detour = Detour::default();
        look(&mut detour, 490.0, true);
        look(&mut detour, 495.0, false);
        let other = RouteView { end: Vec2::new(600.0, 0.0), route_m: 700.0, blocked: true };
        detour.look(Some(other), 1.0, || false);
        detour.look(Some(RouteView { blocked: false, ..other }), 1.0, || false);
        assert_eq!(detour.to(), None);
    }
}
