//! The scene in Foxglove's primitives.

use crate::facts::RunFacts;
use crate::geometry::outline;
use crate::group_order::GroupOrder;
use crate::mcap::foxglove::{
    ArrowPrimitive, Color, CylinderPrimitive, LINE_LIST, LINE_LOOP, LINE_STRIP, LinePrimitive, Pose, SceneEntity,
    SceneUpdate, SpherePrimitive, TextPrimitive, Time, TriangleListPrimitive, Vector3,
};
use crate::scene::{Sample, State, rounded};
use skein_protocol::shape::ConvexShape;

/// How far above its place a drone is drawn, m: above its slot and its danger zone.
const LIFT_M: f64 = 2.0;
/// Length of the arrow of a drone, m.
const ARROW_LENGTH_M: f64 = 7.0;
/// Width of the arrow of a drone, m.
const ARROW_WIDTH_M: f64 = 3.0;
/// Width of the line of a radio link, pixels.
const LINK_PX: f64 = 1.0;
/// Diameter of a pilot's mark, m.
const MARK_M: f64 = 2.0;
/// Width of a pilot's line, pixels.
const MARK_PX: f64 = 2.0;
const GREY: (u8, u8, u8) = (140, 140, 140);
const RED: (u8, u8, u8) = (204, 30, 20);
const BLUE: (u8, u8, u8) = (0, 114, 178);

fn colour((r, g, b): (u8, u8, u8), a: f64) -> Color {
    let part = |value: u8| rounded(f64::from(value) / 255.0);
    Color { r: part(r), g: part(g), b: part(b), a }
}

fn point([x, y]: [f64; 2], z: f64) -> Vector3 {
    Vector3 { x: rounded(x), y: rounded(y), z }
}

fn line(kind: u8, points: Vec<Vector3>, color: Color, thickness: f64) -> LinePrimitive {
    let pose = Pose::new(0.0, 0.0, 0.0, 0.0);
    let (colors, indices) = (Vec::new(), Vec::new());
    LinePrimitive { r#type: kind, pose, thickness, scale_invariant: true, points, color, colors, indices }
}

/// The parts of the scene that never change: obstacles, hulls, routes.
pub(super) fn static_scene(facts: &RunFacts) -> SceneUpdate {
    let mut obstacles = SceneEntity::new("obstacles", Time::default());
    for shape in &facts.obstacles {
        // An obstacle without a floor stands on the ground. One without a top is drawn as its footprint.
        obstacles.triangles.push(face(shape, shape.floor_m.max(0.0)));
        obstacles.triangles.extend(shape.top_m.is_finite().then(|| face(shape, shape.top_m)));
    }
    let (mut hulls, mut routes) =
        (SceneEntity::new("hulls", Time::default()), SceneEntity::new("routes", Time::default()));
    let points = |corners: &[[f64; 2]]| corners.iter().map(|&corner| point(corner, 0.1)).collect::<Vec<_>>();
    for set in &facts.scene.sets {
        let outlined = set.hulls_m.iter().map(|hull| line(LINE_LOOP, points(hull), colour(GREY, 0.8), 1.0));
        hulls.lines.extend(outlined);
        let polylines = set.routes_m.iter().map(|route| line(LINE_STRIP, points(route), colour(BLUE, 0.6), 2.0));
        routes.lines.extend(polylines);
    }
    SceneUpdate { deletions: Vec::new(), entities: vec![obstacles, hulls, routes] }
}

/// The outline of an obstacle, filled, at this altitude.
fn face(shape: &ConvexShape, z_m: f64) -> TriangleListPrimitive {
    let points: Vec<Vector3> = outline(shape).into_iter().map(|(x, y)| point([x, y], z_m)).collect();
    let indices = (1..points.len().saturating_sub(1) as u32).flat_map(|i| [0, i, i + 1]).collect();
    let pose = Pose::new(0.0, 0.0, 0.0, 0.0);
    TriangleListPrimitive { pose, points, color: colour(GREY, 1.0), colors: Vec::new(), indices }
}

/// The parts of the scene that move: danger zones, slots, radio links.
pub(super) fn moving_scene(facts: &RunFacts, sample: &Sample, at: Time) -> SceneUpdate {
    let state = &sample.state;
    SceneUpdate { deletions: Vec::new(), entities: vec![zones(facts, state, at), slots(state, at), links(sample, at)] }
}

/// What the look of a drone depends on.
#[derive(Clone, PartialEq, Eq)]
struct Look {
    group: String,
    leads: Option<String>,
    alive: u8,
}

/// Draws the drones. Each drone is an entity in its own frame, which `/tf` moves. The entity is sent again only if the
/// look of the drone changes.
#[derive(Default)]
pub(super) struct Drones {
    looks: Vec<Option<Look>>,
    colours: GroupOrder,
    /// Whether marks were sent that are still there.
    marked: bool,
}

impl Drones {
    /// The drones whose look changed; `None` if no look changed.
    pub(crate) fn changed(&mut self, state: &State, at: Time) -> Option<SceneUpdate> {
        self.looks.resize(state.x_m.len(), None);
        self.colours.note(&state.group);
        let mut entities = Vec::new();
        for (drone, known) in self.looks.iter_mut().enumerate() {
            let (group, leads, alive) = (&state.group[drone], &state.leads[drone], state.alive[drone]);
            let unchanged = |known: &Look| known.group == *group && known.leads == *leads && known.alive == alive;
            if !known.as_ref().is_some_and(unchanged) {
                *known = Some(Look { group: group.clone(), leads: leads.clone(), alive });
                entities.push(arrow(state, drone, at, &mut self.colours));
            }
        }
        (!entities.is_empty()).then(|| SceneUpdate { deletions: Vec::new(), entities })
    }

    /// The marks and lines of pilots, in the colours of the drones; once without any when there are none any more. `None` if
    /// nothing has to be sent.
    pub(crate) fn marks(&mut self, sample: &Sample, at: Time) -> Option<SceneUpdate> {
        let (shown, state) = (&sample.shown, &sample.state);
        let marked = std::mem::replace(&mut self.marked, !shown.is_empty());
        if !marked && shown.is_empty() {
            return None;
        }
        let mut shade = |drone: u32| state.group.get(drone as usize).map_or(GREY, |group| self.colours.colour(group));
        let mut entity = SceneEntity::new("marks", at);
        for mark in &shown.marks {
            let [x, y, z] = mark.at_m;
            let (pose, color) = (Pose::new(x, y, z, 0.0), colour(shade(mark.drone), 1.0));
            let size = Vector3 { x: MARK_M, y: MARK_M, z: MARK_M };
            entity.spheres.push(SpherePrimitive { pose, size, color });
            entity.texts.extend(label(&mark.label, [x, y, z], color));
        }
        for shown in &shown.lines {
            let ([x, y, z], [u, v, w]) = (shown.from_m, shown.to_m);
            let color = colour(shade(shown.drone), 1.0);
            let ends = vec![Vector3 { x, y, z }, Vector3 { x: u, y: v, z: w }];
            entity.lines.push(line(LINE_STRIP, ends, color, MARK_PX));
            entity.texts.extend(label(&shown.label, [(x + u) / 2.0, (y + v) / 2.0, (z + w) / 2.0], color));
        }
        Some(SceneUpdate { deletions: Vec::new(), entities: vec![entity] })
    }
}

/// The label of a mark beside this place; `None` without one.
fn label(text: &str, [x, y, z]: [f64; 3], color: Color) -> Option<TextPrimitive> {
    let pose = Pose::new(x, y + MARK_M, z, 0.0);
    let text = (!text.is_empty()).then(|| text.to_owned())?;
    Some(TextPrimitive { pose, billboard: true, font_size: 10.0, scale_invariant: true, color, text })
}

/// Position of a drone, m.
fn position(state: &State, drone: usize) -> Vector3 {
    Vector3 { x: state.x_m[drone], y: state.y_m[drone], z: state.z_m[drone] }
}

/// The numbers of the living drones.
fn living(state: &State) -> impl Iterator<Item = usize> + '_ {
    (0..state.x_m.len()).filter(|&drone| state.alive[drone] == 1)
}

/// The entity of a drone: an arrow and its number.
fn arrow(state: &State, drone: usize, at: Time, colours: &mut GroupOrder) -> SceneEntity {
    let alive = state.alive[drone] == 1;
    let shade = if alive { colours.colour(&state.group[drone]) } else { GREY };
    let mut entity = SceneEntity::new(&format!("drone {drone}"), at);
    entity.frame_id = format!("drone_{drone}");
    entity.frame_locked = true;
    entity.arrows.push(ArrowPrimitive {
        pose: Pose::new(0.0, 0.0, LIFT_M, 0.0),
        shaft_length: ARROW_LENGTH_M / 2.0,
        shaft_diameter: ARROW_WIDTH_M / 2.0,
        head_length: ARROW_LENGTH_M / 2.0,
        head_diameter: ARROW_WIDTH_M,
        color: colour(shade, 1.0),
    });
    let leads = state.leads[drone].as_ref().map_or(String::new(), |group| format!(" leads {group}"));
    entity.texts.push(TextPrimitive {
        pose: Pose::new(0.0, 5.0, LIFT_M, 0.0),
        billboard: true,
        font_size: 12.0,
        scale_invariant: true,
        color: colour(shade, 1.0),
        text: if alive { format!("{drone}{leads}") } else { format!("{drone} dead") },
    });
    entity
}

/// A flat disc at the altitude of its centre.
fn disc(centre: Vector3, radius_m: f64, color: Color) -> CylinderPrimitive {
    let size = Vector3 { x: rounded(2.0 * radius_m), y: rounded(2.0 * radius_m), z: 0.05 };
    CylinderPrimitive {
        pose: Pose::new(centre.x, centre.y, centre.z, 0.0),
        size,
        bottom_scale: 1.0,
        top_scale: 1.0,
        color,
    }
}

fn zones(facts: &RunFacts, state: &State, at: Time) -> SceneEntity {
    let mut entity = SceneEntity::new("danger zones", at);
    entity.cylinders.extend(living(state).map(|drone| {
        let speed = state.vx_mps[drone].hypot(state.vy_mps[drone]);
        disc(position(state, drone), facts.scene.danger_zone_m(speed), colour(RED, 0.08))
    }));
    entity
}

fn slots(state: &State, at: Time) -> SceneEntity {
    let mut entity = SceneEntity::new("slots", at);
    let slots = state.slot_m.iter().zip(&state.z_m).filter_map(|(slot, &z)| Some(point((*slot)?, z)));
    entity.cylinders.extend(slots.map(|slot| disc(slot, 1.5, colour(BLUE, 0.5))));
    entity
}

/// Where the body of a drone at this place is drawn.
fn lifted(place: Vector3) -> Vector3 {
    Vector3 { z: place.z + LIFT_M, ..place }
}

/// Lines from each leader to its followers, and red lines for frames that were dropped although the receiver was in
/// range.
fn links(sample: &Sample, at: Time) -> SceneEntity {
    let state = &sample.state;
    let mut followed = Vec::new();
    for drone in living(state) {
        let leader = state.leader[drone].map(|leader| leader as usize);
        if let Some(leader) = leader.filter(|&leader| leader != drone && leader < state.x_m.len()) {
            followed.extend([position(state, leader), position(state, drone)].map(lifted));
        }
    }
    let mut dropped_frames = Vec::new();
    for frame in sample.radio.frames.iter().filter(|_| sample.radio.receiver.is_none()) {
        let dropped = frame.deliveries.chars().enumerate().filter(|(_, delivery)| !['h', '-', 'r'].contains(delivery));
        for (receiver, _) in dropped.filter(|&(receiver, _)| receiver < state.x_m.len()) {
            let ends = [position(state, frame.source as usize), position(state, receiver)];
            dropped_frames.extend(ends.map(lifted));
        }
    }
    let mut entity = SceneEntity::new("radio links", at);
    entity.lines.push(line(LINE_LIST, followed, colour(GREY, 0.6), LINK_PX));
    entity.lines.push(line(LINE_LIST, dropped_frames, colour(RED, 0.6), LINK_PX));
    entity
}
