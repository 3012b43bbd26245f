//! The funnel algorithm: the shortest path past constraint points, with x never decreasing.

use crate::routes::{Body, Constraint, Routes, Side, Wall, sort};
use crate::tuning::{LOOK_AHEAD_M, RUN_OUT_M};
use skein_protocol::Vec2;
use skein_protocol::scale::Scale;

/// Constraint points that are less than this ahead count as passed, m.
const PASSED_M: f64 = 1e-6;

/// The corridor past one or several obstacle sets and back to the course line. It is made once; the shortest path through
/// it is computed in every tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Corridor {
    constraints: Vec<Constraint>,
    target: Vec2,
    scale: Scale,
}

/// How a path passes one set.
#[derive(Clone, Copy, Debug)]
pub struct Passage<'a> {
    /// The routes past the set.
    pub routes: &'a Routes,
    /// The one taken, 0 = rightmost.
    pub route: usize,
    /// How far the path keeps away from the walls in y, m: see [`Routes::lane_m`].
    pub lane_m: f64,
}

impl Passage<'_> {
    fn constraints(&self) -> impl Iterator<Item = Constraint> {
        self.routes.route(self.route).constraints().iter().map(|point| point.beside(self.lane_m))
    }
}

/// The shortest path through a corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    /// Unit vector of the first leg.
    pub direction: Vec2,
    /// Length to the gate, m. Past the gate: the negative difference in x. If the gate is beyond the target, the path goes
    /// straight on.
    pub to_gate_m: f64,
    /// Length to the target, m.
    pub total_m: f64,
}

impl Corridor {
    /// A corridor past these sets, each with the route taken past it (0 = rightmost), to a target on the course line
    /// (world frame, m), usually [`Routes::run_out_m`] past the last exit.
    ///
    /// A body that leaves no gap between itself and a wall of the routes becomes part of that wall, of the nearest one if
    /// there are several. Any other body stays on the side on which the path from the course line passes its centre.
    #[must_use]
    pub fn new(passages: &[(&Routes, usize)], bodies: &[Body], target: Vec2) -> Self {
        let passages: Vec<_> = passages.iter().map(|&(routes, route)| Passage { routes, route, lane_m: 0.0 }).collect();
        Self::in_lanes(&passages, bodies, target)
    }

    /// As [`Self::new`], for a path that keeps away from the walls.
    #[must_use]
    pub fn in_lanes(passages: &[Passage<'_>], bodies: &[Body], target: Vec2) -> Self {
        let taken = || passages.iter().map(|passage| passage.routes.route(passage.route));
        let constraints = passages.iter().flat_map(Passage::constraints).collect();
        let scale = passages.first().map_or(Scale::FULL, |passage| passage.routes.scale());
        let mut corridor = Self { constraints, target, scale };
        sort(&mut corridor.constraints);
        if !bodies.is_empty() {
            corridor.evade(bodies, taken().flat_map(|route| route.walls().iter().cloned()).collect());
        }
        corridor
    }

    /// Where the path ends, world frame, m.
    #[must_use]
    pub fn target(&self) -> Vec2 {
        self.target
    }

    /// The shortest path from a position (world frame, m, finite), measured up to the abscissa `gate_x_m`. Does not
    /// allocate. The result is finite wherever the drone is; a drone inside a wall is led out of it.
    #[must_use]
    pub fn pull(&self, position: Vec2, gate_x_m: f64) -> Steering {
        let past_m = position.x - gate_x_m;
        let mut to_gate_m = (past_m >= 0.0).then_some(-past_m);
        let (mut direction, mut total_m, mut end) = (None, 0.0, position);
        self.visit_legs(position, |a, b| {
            let leg_m = (b - a).norm();
            direction = direction.or(Some((b - a) / leg_m));
            if b.x >= gate_x_m && to_gate_m.is_none() {
                to_gate_m = Some(total_m + leg_m * (gate_x_m - a.x) / (b.x - a.x));
            }
            total_m += leg_m;
            end = b;
        });
        let to_gate_m = to_gate_m.unwrap_or(total_m + gate_x_m - end.x);
        Steering { direction: direction.unwrap_or(Vec2::x()), to_gate_m, total_m }
    }

    /// Visits the legs of the shortest path, each at least `PASSED_M` long in x.
    pub fn visit_legs(&self, position: Vec2, mut leg: impl FnMut(Vec2, Vec2)) {
        let end = Vec2::new(self.target.x.max(position.x + self.scale.length(LOOK_AHEAD_M)), self.target.y);
        let ahead = &self.constraints[..self.constraints.partition_point(|c| c.x_m < end.x)];
        let mut from = position;
        let mut next = ahead.partition_point(|c| c.x_m <= from.x + PASSED_M);
        let is_behind = |c: &Constraint| c.is_behind(position);
        while let Some(bend) = first_bend(from, &ahead[next..], end, is_behind) {
            let to = Vec2::new(ahead[next + bend].x_m, ahead[next + bend].y_m);
            leg(from, to);
            from = to;
            next += bend + ahead[next + bend..].partition_point(|c| c.x_m <= from.x + PASSED_M);
        }
        leg(from, end);
    }

    /// Ordinate at an abscissa of the path that comes along the course line, m.
    fn height_m(&self, x_m: f64) -> f64 {
        let first_x_m = self.constraints.first().map_or(x_m, |c| c.x_m.min(x_m));
        let start = Vec2::new(first_x_m - self.scale.length(RUN_OUT_M), self.target.y);
        let mut y_m = self.target.y;
        self.visit_legs(start, |a, b| {
            if a.x < x_m && x_m <= b.x {
                y_m = a.y + (b.y - a.y) * (x_m - a.x) / (b.x - a.x);
            }
        });
        y_m
    }

    /// Adds bodies: first those that leave no gap to a wall, or to such a body; then the free ones.
    fn evade(&mut self, bodies: &[Body], mut walls: Vec<Wall>) {
        let usable = |b: &&Body| b.radius_m > 0.0 && (b.centre_m.x + b.centre_m.y + b.radius_m).is_finite();
        let mut free: Vec<&Body> = bodies.iter().filter(usable).collect();
        let first_new = walls.len();
        while let Some((i, side)) = free.iter().enumerate().find_map(|(i, body)| Some((i, closed_side(&walls, body)?)))
        {
            walls.push(free.remove(i).wall(side));
        }
        self.constraints.extend(walls[first_new..].iter().flat_map(Wall::constraints));
        sort(&mut self.constraints);
        for body in free {
            let above = self.height_m(body.centre_m.x) >= body.centre_m.y;
            self.constraints.extend(body.wall(if above { Side::Above } else { Side::Below }).constraints());
            sort(&mut self.constraints);
        }
    }
}

/// The side of the nearest wall, if there is no gap between it and a body.
fn closed_side(walls: &[Wall], body: &Body) -> Option<Side> {
    let distances = walls.iter().map(|wall| (wall.distance_m(body.centre_m), wall.side));
    let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 < body.radius_m).then_some(nearest.1)
}

/// Index of the point at which the path from `from` to `end` first bends; `None` if it is straight. The funnel of
/// directions narrows point by point until a point, or the end, is outside of it. All points must be ahead of `from`. Those that
/// `is_behind` names are left out.
fn first_bend(from: Vec2, points: &[Constraint], end: Vec2, is_behind: impl Fn(&Constraint) -> bool) -> Option<usize> {
    let slope = |x_m: f64, y_m: f64| (y_m - from.y) / (x_m - from.x);
    let (mut low, mut high) = ((f64::NEG_INFINITY, None), (f64::INFINITY, None));
    for (i, point) in points.iter().enumerate().filter(|(_, point)| !is_behind(point)) {
        let slope = slope(point.x_m, point.y_m);
        match point.side {
            Side::Above if slope > high.0 => return high.1,
            Side::Above if slope > low.0 => low = (slope, Some(i)),
            Side::Below if slope < low.0 => return low.1,
            Side::Below if slope < high.0 => high = (slope, Some(i)),
            _ => {}
        }
    }
    let slope = slope(end.x, end.y);
    if slope > high.0 {
        high.1
    } else if slope < low.0 {
        low.1
    } else {
        None
    }
}
