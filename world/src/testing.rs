//! Fixtures for this crate's tests.

use crate::body::Body;
use crate::energy_model::EnergyModel;
use crate::fault_plan::FaultPlan;
use crate::params::{End, Failsafe, PartsRule, WorldParams};
use crate::sensor_errors::SensorErrors;
use crate::world::World;
use skein_protocol::formation::Shape;
use skein_protocol::nearby::Locality;
use skein_protocol::record::{EventKind, RunEvent};
use skein_protocol::shape::ConvexShape;
use skein_protocol::slot::Slot;
use skein_protocol::{Course, DroneId, Vec2, Vec3};

/// The paper's first scene: spacing 35 m, safe distance 33 m, ticks of 20 ms.
pub(crate) fn params() -> WorldParams {
    WorldParams {
        dt_ns: 20_000_000,
        timeout_s: 10.0,
        without_way: Vec::new(),
        speed_max_mps: 20.0,
        acceleration_max_mps2: 5.0,
        braking_mps2: 5.0,
        reaction_time_s: 0.0,
        safe_distance_m: 33.0,
        clearance_m: 15.0,
        planning_distance_m: 20.0,
        detection_range_m: 115.0,
        ranging_m: Some(66.0),
        sensors: SensorErrors::default(),
        channel: None,
        locality: Locality::default(),
        failsafe: Failsafe::Hover,
        end: End::Hold { stop_x_m: 1e9 },
        parts: PartsRule::One,
        arrival_error_m: 0.8,
        hold_speed_mps: 1.0,
        course: Course::East,
        shape: Shape::NestedV,
        spacing_m: 35.0,
        energy: EnergyModel::default(),
        faults: FaultPlan::default(),
        pilots: Vec::new(),
    }
}

/// A nested V of `count` drones with its front above the origin, flying at 10 m/s, 50 m above the ground.
pub(crate) fn starts(count: usize) -> Vec<(Vec3, Vec3)> {
    let slots = Shape::NestedV.slots(count, 35.0).into_iter();
    slots.map(|slot| (Vec3::new(slot.x, slot.y, 50.0), Vec3::new(10.0, 0.0, 0.0))).collect()
}

pub(crate) fn rectangle(x: f64, y: f64, half_x: f64, half_y: f64) -> ConvexShape {
    ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(half_x, half_y), 0.0).unwrap()
}

/// Bodies at rest above these places, 50 m above the ground.
pub(crate) fn bodies(places: &[[f64; 2]]) -> Vec<Body> {
    places.iter().map(|&[x, y]| Body::new(Vec3::new(x, y, 50.0), Vec3::zeros())).collect()
}

/// Lets every drone answer `slot` and advances one tick. Gives its events.
pub(crate) fn tick(world: &mut World, slot: &Slot) -> Vec<RunEvent> {
    let drones = world.downlink().drones.len() as u32;
    for id in 0..drones {
        world.take_slot(DroneId(id), slot);
    }
    world.advance();
    events(world)
}

/// The events of the last record.
pub(crate) fn events(world: &World) -> Vec<RunEvent> {
    world.record().parse_events(|line| serde_json::from_slice(line)).unwrap()
}

/// The events without their times.
pub(crate) fn event_kinds(events: Vec<RunEvent>) -> Vec<EventKind> {
    events.into_iter().map(|event| event.what).collect()
}

/// A slot that commands an acceleration.
pub(crate) fn command(x: f64, y: f64) -> Slot {
    Slot { acceleration_mps2: [x, y, 0.0], ..Slot::default() }
}
