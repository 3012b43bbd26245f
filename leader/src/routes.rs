//! Routes past a set of obstacles (paper, Algorithm 4 and E5: k obstacles have k + 1 routes).
//!
//! Obstacles with too narrow a gap between them are merged into one envelope. A route is a list of constraint points:
//! corners of the inflated obstacles that the path has to pass on a given side.

use crate::geometry::{hull, inflate, inscribed, lower_chain, nearest, separation, upper_chain};
use crate::tuning::{ROUNDING_M, RUN_OUT_M};
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{ObstacleId, Vec2};

/// Clearances of routes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteParams {
    /// r_obs: least distance of a drone's centre from an obstacle, m.
    pub clearance_m: f64,
    /// Least distance of a route from an obstacle, m: half the width of the narrowest passable gap, at least `clearance_m`.
    pub half_gap_m: f64,
    /// r_plan: distance at which paths are planned, m; at least `half_gap_m`.
    pub planning_distance_m: f64,
    /// How small the swarm is.
    pub scale: Scale,
}

/// The side on which a path has to pass a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// To the left of it: at a higher or equal y.
    Above,
    /// To the right of it: at a lower or equal y.
    Below,
}

/// A point that a path has to pass on one side. World frame, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constraint {
    /// Abscissa, along the flight.
    pub x_m: f64,
    /// Ordinate, to the left of the flight.
    pub y_m: f64,
    /// The side on which the path passes.
    pub side: Side,
    /// From this abscissa on, a drone that keeps the clearance is behind the obstacle, m; at most `x_m`.
    pub clear_x_m: f64,
}

impl Constraint {
    /// The same point, for a path that passes this much farther away from the obstacle in y, m.
    pub(crate) fn beside(self, lane_m: f64) -> Self {
        let y_m = match self.side {
            Side::Above => self.y_m + lane_m,
            Side::Below => self.y_m - lane_m,
        };
        Self { y_m, ..self }
    }

    /// Whether a drone at `position` (world frame, m) is behind the obstacle and on the wrong side of the point, so that it need not pass the
    /// point any more: it is in the strip behind the obstacle that paths avoid and drones may enter. A path past the point would lead back.
    #[must_use]
    pub fn is_behind(&self, position: Vec2) -> bool {
        let off_m = match self.side {
            Side::Above => self.y_m - position.y,
            Side::Below => position.y - self.y_m,
        };
        position.x >= self.clear_x_m && off_m > 0.0
    }
}

/// A disc that is not an obstacle of the set, such as a dead drone that hovers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Its centre, world frame, m.
    pub centre_m: Vec2,
    /// Distance that a path keeps from the centre, m.
    pub radius_m: f64,
}

impl Body {
    /// The body as a wall, for a path on this side of it.
    pub(crate) fn wall(&self, side: Side) -> Wall {
        Wall { side, outline: inflate(&[self.centre_m], self.radius_m), strip_m: 0.0 }
    }
}

/// An inflated obstacle beside a route.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// The side of the obstacle on which the path passes.
    pub side: Side,
    /// The inflated obstacle: the area that no path may enter, m.
    pub outline: Vec<Vec2>,
    /// How much of what it is inflated by drones may enter, m.
    pub strip_m: f64,
}

impl Wall {
    /// The corners on the path's side, by x.
    pub fn constraints(&self) -> impl Iterator<Item = Constraint> + use<> {
        let side = self.side;
        let rear_x_m = self.outline.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max) - self.strip_m;
        let chain = match side {
            Side::Above => upper_chain(&self.outline),
            Side::Below => lower_chain(&self.outline),
        };
        let clear_x_m = move |p: Vec2| p.x.min(rear_x_m);
        chain.into_iter().map(move |p| Constraint { x_m: p.x, y_m: p.y, side, clear_x_m: clear_x_m(p) })
    }

    /// Distance of a point to the outline, m; 0 inside.
    #[must_use]
    pub fn distance_m(&self, point: Vec2) -> f64 {
        (nearest(&self.outline, point) - point).norm()
    }
}

/// One route past a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Route {
    walls: Vec<Wall>,
    constraints: Vec<Constraint>,
}

impl Route {
    fn new(walls: Vec<Wall>) -> Self {
        let mut constraints: Vec<Constraint> = walls.iter().flat_map(Wall::constraints).collect();
        sort(&mut constraints);
        Self { walls, constraints }
    }

    /// The inflated obstacles, from right to left.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// The points to pass, by x.
    #[must_use]
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }
}

/// Orders constraints by x; ties by side and y, so that the order of the obstacles does not matter.
pub(crate) fn sort(constraints: &mut [Constraint]) {
    constraints.sort_by(|a, b| a.x_m.total_cmp(&b.x_m).then(a.side.cmp(&b.side)).then(a.y_m.total_cmp(&b.y_m)));
}

/// All routes past one set, from right to left.
#[derive(Clone, Debug, PartialEq)]
pub struct Routes {
    routes: Vec<Route>,
    /// The index of each route in `routes`, by its number. After outlines have grown, obstacles may be merged, and several numbers may stand for
    /// one route.
    numbers: Vec<usize>,
    /// The obstacles of each envelope, from right to left.
    order: Vec<Vec<ObstacleId>>,
    gate_x_m: f64,
    exit_x_m: f64,
    /// The lowest ordinate of a path on the rightmost route, and the highest of one on the leftmost route, m.
    sides_m: (f64, f64),
    scale: Scale,
    /// The obstacles inflated by r_obs, by envelope, from right to left.
    blocks: Vec<Vec<Block>>,
    /// The least and the greatest abscissa of a point of them, m.
    abreast_m: (f64, f64),
}

impl Routes {
    /// The routes past these obstacles. The order of the obstacles does not matter. Shapes that fail
    /// [`ConvexShape::check`] are left out. Without obstacles there is one free route, with gate and exit at x = 0.
    #[must_use]
    pub fn new(obstacles: &[(ObstacleId, ConvexShape)], params: &RouteParams) -> Self {
        Self::past(&ordered(merged(obstacles, params), params, Envelope::lateral_m), params)
    }

    /// The same routes, past obstacles whose outlines have grown. A number stands for the route with the same obstacles on its right as before,
    /// as far as there is one: the order of obstacles does not change because more of one has been seen.
    #[must_use]
    pub fn redrawn(&self, obstacles: &[(ObstacleId, ConvexShape)], params: &RouteParams) -> Self {
        let place = |id: &ObstacleId| self.order.iter().position(|envelope| envelope.contains(id));
        let mean = |places: Vec<usize>| places.iter().sum::<usize>() as f64 / places.len().max(1) as f64;
        let before = |envelope: &Envelope| mean(envelope.ids.iter().filter_map(place).collect());
        let mut new = Self::past(&ordered(merged(obstacles, params), params, before), params);
        new.numbers = (0..self.count()).map(|number| new.like(self, number)).collect();
        new
    }

    /// The route that has most obstacles on the same side as a route of `other`.
    pub(crate) fn like(&self, other: &Self, number: usize) -> usize {
        let was_right: Vec<&ObstacleId> = other.order.iter().take(other.index(number)).flatten().collect();
        let ids = |envelopes: &[Vec<ObstacleId>]| envelopes.iter().flatten().copied().collect::<Vec<_>>();
        let moved = |&route: &usize| {
            let (right, left) = self.order.split_at(route.min(self.order.len()));
            let missed = ids(right).iter().filter(|id| !was_right.contains(id)).count();
            missed + ids(left).iter().filter(|id| was_right.contains(id)).count()
        };
        (0..self.routes.len()).min_by_key(moved).unwrap_or(0)
    }

    /// Whether a point is in an envelope of several obstacles: among obstacles without a passable gap between them. World frame, m.
    pub(crate) fn enclose(obstacles: &[(ObstacleId, ConvexShape)], params: &RouteParams, point: Vec2) -> bool {
        let holds = |e: &Envelope| e.ids.len() > 1 && (nearest(&e.core, point) - point).norm() <= e.radius_m;
        merged(obstacles, params).iter().any(holds)
    }

    /// The routes past these envelopes, which are ordered from right to left.
    fn past(envelopes: &[Envelope], params: &RouteParams) -> Self {
        if envelopes.is_empty() {
            return Self {
                routes: vec![Route::default()],
                numbers: vec![0],
                order: Vec::new(),
                gate_x_m: 0.0,
                exit_x_m: 0.0,
                sides_m: (0.0, 0.0),
                scale: params.scale,
                blocks: Vec::new(),
                abreast_m: (f64::INFINITY, f64::NEG_INFINITY),
            };
        }
        let routes: Vec<Route> =
            (0..=envelopes.len()).map(|route| Route::new(walls(envelopes, route, params))).collect();
        let centres = envelopes.iter().map(|envelope| (envelope.low.x + envelope.high.x) / 2.0);
        let rear_m = envelopes.iter().map(|envelope| envelope.high.x).fold(f64::NEG_INFINITY, f64::max);
        let ordinates = |route: usize| routes[route].constraints.iter().map(|point| point.y_m);
        let sides_m =
            (ordinates(0).fold(f64::INFINITY, f64::min), ordinates(routes.len() - 1).fold(f64::NEG_INFINITY, f64::max));
        Self {
            sides_m,
            numbers: (0..routes.len()).collect(),
            order: envelopes.iter().map(|envelope| envelope.ids.clone()).collect(),
            routes,
            gate_x_m: centres.sum::<f64>() / envelopes.len() as f64,
            exit_x_m: rear_m + params.planning_distance_m,
            scale: params.scale,
            abreast_m: range(envelopes.iter().flat_map(|envelope| &envelope.blocks).flat_map(Block::abscissas_m)),
            blocks: envelopes.iter().map(|envelope| envelope.blocks.clone()).collect(),
        }
    }

    /// Whether a drone at `position` (world frame, m) can still take a route: no obstacle abreast of it lies between it and
    /// the route.
    #[must_use]
    pub fn is_open(&self, route: usize, position: Vec2) -> bool {
        // In each tick, most drones are not abreast of any obstacle.
        if !(self.abreast_m.0..=self.abreast_m.1).contains(&position.x) {
            return true;
        }
        let (right, left) = self.blocks.split_at(self.index(route).min(self.blocks.len()));
        let above = |block: &Block| block.extent(position.x).is_some_and(|(low, _)| position.y < low);
        let below = |block: &Block| block.extent(position.x).is_some_and(|(_, high)| position.y > high);
        !right.iter().flatten().any(above) && !left.iter().flatten().any(below)
    }

    /// Whether bodies ahead of a drone at `position` (world frame, m) bar a route: they leave no gap between the walls on its
    /// right and those on its left.
    #[must_use]
    pub fn is_barred(&self, route: usize, position: Vec2, bodies: &[Body]) -> bool {
        if bodies.is_empty() {
            return false;
        }
        let mut ahead: Vec<&Body> = bodies.iter().filter(|body| body.centre_m.x > position.x).collect();
        let walls = self.route(route).walls();
        let touches = |body: &Body, side: Side| {
            walls.iter().any(|wall| wall.side == side && wall.distance_m(body.centre_m) < body.radius_m)
        };
        // Bodies that are connected to the walls on the right.
        let mut reached: Vec<&Body> = Vec::new();
        let near = |a: &Body, b: &Body| (a.centre_m - b.centre_m).norm() < a.radius_m + b.radius_m;
        while let Some(i) =
            ahead.iter().position(|body| touches(body, Side::Above) || reached.iter().any(|other| near(body, other)))
        {
            reached.push(ahead.swap_remove(i));
        }
        reached.iter().any(|body| touches(body, Side::Below))
    }

    /// Number of routes: number of envelopes plus one (paper, E5).
    #[must_use]
    pub fn count(&self) -> usize {
        self.numbers.len()
    }

    /// The index of a route, by its number. A number beyond the last is that of the leftmost route.
    fn index(&self, number: usize) -> usize {
        self.numbers.get(number).copied().unwrap_or(self.routes.len() - 1)
    }

    /// Whether a route leads between two obstacles. The first and the last one have nothing on their outer side.
    #[must_use]
    pub fn is_between(&self, route: usize) -> bool {
        let index = self.index(route);
        index > 0 && index + 1 < self.routes.len()
    }

    /// How far from the walls a drone of a crowd passes on an outermost route, m. `y_m`: the drone's ordinate, in the world frame, m.
    /// `squeeze`: the least distance of two drones as a share of their distance in formation, at most 1.
    ///
    /// The drones in front of the obstacles need room beside them. Each drone makes way: one that flies at u from the middle of
    /// obstacles of half-width w passes at w + u·squeeze, or at u if that is more. So no two drones come closer than the least distance, and
    /// their order does not change.
    #[must_use]
    pub fn lane_m(&self, route: usize, y_m: f64, squeeze: f64) -> f64 {
        let (right_m, left_m) = self.sides_m;
        let (middle_m, half_m) = ((right_m + left_m) / 2.0, (left_m - right_m) / 2.0);
        let from_middle_m = if self.index(route) == 0 { middle_m - y_m } else { y_m - middle_m };
        let lane_m = (from_middle_m * squeeze).max(from_middle_m - half_m);
        if self.is_between(route) { 0.0 } else { lane_m.max(0.0) }
    }

    /// A route, 0 = rightmost. An index beyond the last gives the leftmost.
    #[must_use]
    pub fn route(&self, index: usize) -> &Route {
        &self.routes[self.index(index)]
    }

    /// The obstacles from right to left, those without a passable gap between them together. A route leads past each of them.
    #[must_use]
    pub fn envelopes(&self) -> &[Vec<ObstacleId>] {
        &self.order
    }

    /// The gate: abscissa at which the set counts as passed (paper, C1). It is the mean of the envelopes' centres, m.
    #[must_use]
    pub fn gate_x_m(&self) -> f64 {
        self.gate_x_m
    }

    /// The exit: abscissa past which the set does not matter any more. It is the rear edge plus the planning distance, m.
    #[must_use]
    pub fn exit_x_m(&self) -> f64 {
        self.exit_x_m
    }

    /// Distance behind the exit at which a path past the set ends on the course line, m.
    #[must_use]
    pub fn run_out_m(&self) -> f64 {
        self.scale.length(RUN_OUT_M)
    }

    /// How small the swarm is.
    pub(crate) fn scale(&self) -> Scale {
        self.scale
    }
}

/// An envelope of one or several obstacles: all points within `radius_m` of `core`.
#[derive(Clone, Debug)]
struct Envelope {
    /// Its obstacles, ascending.
    ids: Vec<ObstacleId>,
    core: Vec<Vec2>,
    radius_m: f64,
    low: Vec2,
    high: Vec2,
    blocks: Vec<Block>,
}

/// An obstacle inflated by r_obs, as its right and left side along x.
#[derive(Clone, Debug, PartialEq)]
struct Block {
    lower: Vec<Vec2>,
    upper: Vec<Vec2>,
}

impl Block {
    fn new(outline: &[Vec2]) -> Self {
        Self { lower: lower_chain(outline), upper: upper_chain(outline) }
    }

    /// The abscissas of its points, m.
    fn abscissas_m(&self) -> impl Iterator<Item = f64> {
        self.lower.iter().chain(&self.upper).map(|point| point.x)
    }

    /// Its lowest and highest ordinate at an abscissa, m.
    fn extent(&self, x_m: f64) -> Option<(f64, f64)> {
        Some((height(&self.lower, x_m)?, height(&self.upper, x_m)?))
    }
}

/// The least and the greatest of these values.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// Ordinate of a chain at an abscissa, m. `None` beyond its ends.
fn height(chain: &[Vec2], x_m: f64) -> Option<f64> {
    let legs = chain.iter().zip(chain.iter().skip(1));
    let (a, b) = legs.clone().find(|(a, b)| (a.x..=b.x).contains(&x_m))?;
    Some(a.y + (b.y - a.y) * (x_m - a.x) / (b.x - a.x))
}

impl Envelope {
    fn new(ids: Vec<ObstacleId>, core: Vec<Vec2>, radius_m: f64) -> Self {
        let margin = Vec2::repeat(radius_m);
        let low = core.iter().fold(Vec2::repeat(f64::INFINITY), |low, p| low.inf(p)) - margin;
        let high = core.iter().fold(Vec2::repeat(f64::NEG_INFINITY), |high, p| high.sup(p)) + margin;
        Self { ids, core, radius_m, low, high, blocks: Vec::new() }
    }

    /// The ordinate of its middle, m.
    fn lateral_m(&self) -> f64 {
        (self.low.y + self.high.y) / 2.0
    }

    /// The shortest vector between the cores, and the gap between the outlines, m.
    fn gap(&self, other: &Self) -> (Vec2, f64) {
        let between = separation(&self.core, &other.core);
        (between, (between.norm() - self.radius_m - other.radius_m).max(0.0))
    }

    /// Whether the bounding boxes are within `reach_m` of each other on both axes.
    fn is_near(&self, other: &Self, reach_m: f64) -> bool {
        let apart = (other.low - self.high).sup(&(self.low - other.high));
        apart.x <= reach_m && apart.y <= reach_m
    }

    /// The convex hull of both. The smaller radius is kept exactly; the rest of the larger one becomes a polygon.
    fn merged_with(&self, other: &Self) -> Self {
        let radius_m = self.radius_m.min(other.radius_m);
        let mut points = inflate(&self.core, self.radius_m - radius_m);
        points.extend(inflate(&other.core, other.radius_m - radius_m));
        let blocks = self.blocks.iter().chain(&other.blocks).cloned().collect();
        let mut ids = [self.ids.as_slice(), &other.ids].concat();
        ids.sort_unstable();
        Self { blocks, ..Self::new(ids, hull(&points), radius_m) }
    }
}

/// Merges obstacles without a passable gap between them, until all remaining gaps are passable.
fn merged(obstacles: &[(ObstacleId, ConvexShape)], params: &RouteParams) -> Vec<Envelope> {
    let valid = obstacles.iter().filter(|(_, shape)| shape.check().is_ok());
    let envelope = |(id, shape): &(ObstacleId, ConvexShape)| {
        let core = hull(&shape.vertices().collect::<Vec<_>>());
        let block = Block::new(&inflate(&core, shape.radius_m + params.clearance_m));
        Envelope { blocks: vec![block], ..Envelope::new(vec![*id], core, shape.radius_m) }
    };
    let mut envelopes: Vec<Envelope> = valid.map(envelope).collect();
    envelopes.sort_by(|a, b| a.ids.cmp(&b.ids));
    let least_m = 2.0 * params.half_gap_m;
    let closed = |a: &Envelope, b: &Envelope| a.is_near(b, least_m) && a.gap(b).1 <= least_m;
    let pair = |envelopes: &[Envelope]| {
        (0..envelopes.len())
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .find(|&(i, j)| closed(&envelopes[i], &envelopes[j]))
    };
    while let Some((i, j)) = pair(&envelopes) {
        let other = envelopes.remove(i);
        envelopes[j] = envelopes[j].merged_with(&other);
    }
    envelopes
}

/// The envelopes from right to left, by a key, such as their lateral position. If a line across the flight can meet two of them, the one that
/// lies to the right on that line comes first, so that there is a route between them. Ranks from the right and from the
/// left count alike, so that a mirrored set has the reverse order. Two of them that are exactly behind each other are ordered
/// by the key alone: the sign of a rounding error is not mirrored.
fn ordered(envelopes: Vec<Envelope>, params: &RouteParams, key: impl Fn(&Envelope) -> f64) -> Vec<Envelope> {
    let reach_m = 2.0 * params.planning_distance_m;
    let right_of = |a: &Envelope, b: &Envelope| {
        let apart_m = (b.low.x - a.high.x).max(a.low.x - b.high.x);
        apart_m < reach_m && a.gap(b).0.y > ROUNDING_M
    };
    let keys: Vec<f64> = envelopes.iter().map(key).collect();
    let right: Vec<Vec<bool>> = envelopes.iter().map(|a| envelopes.iter().map(|b| right_of(a, b)).collect()).collect();
    let from_right = ranks(&keys, |i, j| right[i][j]);
    let from_left = ranks(&keys.iter().map(|key| -key).collect::<Vec<_>>(), |i, j| right[j][i]);
    let mut sorted: Vec<(usize, Envelope)> = envelopes.into_iter().enumerate().collect();
    let place = |i: usize| from_right[i] as i64 - from_left[i] as i64;
    sorted.sort_by(|(a, _), (b, _)| place(*a).cmp(&place(*b)).then(keys[*a].total_cmp(&keys[*b])).then(a.cmp(b)));
    sorted.into_iter().map(|(_, envelope)| envelope).collect()
}

/// Ranks by key, except that an element that is `before` another has the lower rank.
fn ranks(keys: &[f64], before: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let mut open: Vec<usize> = (0..keys.len()).collect();
    open.sort_by(|&a, &b| keys[a].total_cmp(&keys[b]).then(a.cmp(&b)));
    let mut ranks = vec![0; keys.len()];
    for rank in 0..keys.len() {
        let free = |&at: &usize| !open.iter().any(|&other| before(other, open[at]));
        let next = (0..open.len()).find(free).unwrap_or(0);
        ranks[open.remove(next)] = rank;
    }
    ranks
}

/// The envelopes beside a route, inflated by r_plan. Where the gap across the route is less than twice that, they are
/// inflated by half of the gap, reduced by what the corners of the inflation stick out, so that walls never overlap. The
/// least inflation is half the narrowest passable gap.
fn walls(envelopes: &[Envelope], route: usize, params: &RouteParams) -> Vec<Wall> {
    let (right, left) = envelopes.split_at(route);
    let wall = |envelope: &Envelope, across: &[Envelope], side: Side| {
        let half_gap_m = across.iter().map(|other| envelope.gap(other).1 / 2.0).fold(f64::INFINITY, f64::min);
        let inscribed_m = (envelope.radius_m + half_gap_m) * inscribed() - envelope.radius_m;
        let reach_m = params.planning_distance_m.min(inscribed_m.max(params.half_gap_m));
        let strip_m = reach_m - params.clearance_m;
        Wall { side, outline: inflate(&envelope.core, envelope.radius_m + reach_m), strip_m }
    };
    let right_walls = right.iter().map(|envelope| wall(envelope, left, Side::Above));
    right_walls.chain(left.iter().map(|envelope| wall(envelope, right, Side::Below))).collect()
}
