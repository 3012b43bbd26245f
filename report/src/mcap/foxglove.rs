//! The message types of Foxglove that a swarm in two dimensions needs. All fields are as published at docs.foxglove.dev, so
//! that Foxglove and Lichtblick show the recording without configuration.

use crate::scene::rounded;
use schemars::JsonSchema;
use serde::Serialize;
use skein_protocol::SimTime;

/// Name of the world frame.
pub(super) const WORLD: &str = "world";

/// A time or a duration.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub(super) struct Time {
    pub sec: u32,
    pub nsec: u32,
}

impl From<SimTime> for Time {
    fn from(time: SimTime) -> Self {
        let ns = time.0.max(0);
        Self { sec: (ns / 1_000_000_000) as u32, nsec: (ns % 1_000_000_000) as u32 }
    }
}

#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub(super) struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub(super) struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Quaternion {
    /// A rotation about the vertical axis, counter-clockwise.
    pub(crate) fn yaw(rad: f64) -> Self {
        let (z, w) = (rad / 2.0).sin_cos();
        Self { x: 0.0, y: 0.0, z: rounded(z), w: rounded(w) }
    }
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub(super) struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

impl Pose {
    pub(crate) fn new(x: f64, y: f64, z: f64, yaw_rad: f64) -> Self {
        Self { position: Vector3 { x, y, z }, orientation: Quaternion::yaw(yaw_rad) }
    }
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub(super) struct Color {
    pub r: f64,
    pub g: f64,
    pub b: f64,
    pub a: f64,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct FrameTransform {
    pub timestamp: Time,
    pub parent_frame_id: String,
    pub child_frame_id: String,
    pub translation: Vector3,
    pub rotation: Quaternion,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct FrameTransforms {
    pub transforms: Vec<FrameTransform>,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct PosesInFrame {
    pub timestamp: Time,
    pub frame_id: String,
    pub poses: Vec<Pose>,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Log {
    pub timestamp: Time,
    /// 1 debug, 2 info, 3 warning, 4 error, 5 fatal.
    pub level: u8,
    pub message: String,
    pub name: String,
    pub file: String,
    pub line: u32,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct KeyValuePair {
    pub key: String,
    pub value: String,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct ArrowPrimitive {
    pub pose: Pose,
    pub shaft_length: f64,
    pub shaft_diameter: f64,
    pub head_length: f64,
    pub head_diameter: f64,
    pub color: Color,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct CylinderPrimitive {
    pub pose: Pose,
    pub size: Vector3,
    pub bottom_scale: f64,
    pub top_scale: f64,
    pub color: Color,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct SpherePrimitive {
    pub pose: Pose,
    pub size: Vector3,
    pub color: Color,
}

/// [`LinePrimitive::r#type`]: a closed line.
pub(super) const LINE_LOOP: u8 = 1;
/// [`LinePrimitive::r#type`]: an open line.
pub(super) const LINE_STRIP: u8 = 0;
/// [`LinePrimitive::r#type`]: a separate line for each pair of points.
pub(super) const LINE_LIST: u8 = 2;

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct LinePrimitive {
    pub r#type: u8,
    pub pose: Pose,
    pub thickness: f64,
    pub scale_invariant: bool,
    pub points: Vec<Vector3>,
    pub color: Color,
    pub colors: Vec<Color>,
    pub indices: Vec<u32>,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct TriangleListPrimitive {
    pub pose: Pose,
    pub points: Vec<Vector3>,
    pub color: Color,
    pub colors: Vec<Color>,
    pub indices: Vec<u32>,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct TextPrimitive {
    pub pose: Pose,
    pub billboard: bool,
    pub font_size: f64,
    pub scale_invariant: bool,
    pub color: Color,
    pub text: String,
}

/// Primitives that the recording does not use.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Unused {}

#[derive(Debug, Default, Serialize, JsonSchema)]
pub(super) struct SceneEntity {
    pub timestamp: Time,
    pub frame_id: String,
    pub id: String,
    pub lifetime: Time,
    pub frame_locked: bool,
    pub metadata: Vec<KeyValuePair>,
    pub arrows: Vec<ArrowPrimitive>,
    pub cubes: Vec<Unused>,
    pub spheres: Vec<SpherePrimitive>,
    pub cylinders: Vec<CylinderPrimitive>,
    pub lines: Vec<LinePrimitive>,
    pub triangles: Vec<TriangleListPrimitive>,
    pub texts: Vec<TextPrimitive>,
    pub models: Vec<Unused>,
}

impl SceneEntity {
    /// An entity without primitives. It stays until another entity with this id replaces it.
    pub(crate) fn new(id: &str, timestamp: Time) -> Self {
        Self { timestamp, frame_id: WORLD.to_owned(), id: id.to_owned(), ..Self::default() }
    }
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct SceneEntityDeletion {
    pub timestamp: Time,
    pub r#type: u8,
    pub id: String,
}

#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct SceneUpdate {
    pub deletions: Vec<SceneEntityDeletion>,
    pub entities: Vec<SceneEntity>,
}
