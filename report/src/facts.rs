//! What is known of a run before it starts and is not in its record.

use crate::obstacle_set::ObstacleSet;
use crate::pilot_entry::PilotEntry;
use crate::scene_facts::SceneFacts;
use crate::topic_schema::TopicSchema;
use serde::{Deserialize, Serialize};
use skein_protocol::formation::Shape;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Course, Vec2};

/// A run as it was ordered. SI units, world frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    /// The scenario's name; names the run's folder.
    pub scenario: String,
    /// The strategy by which drones are grouped, as on the command line.
    pub strategy: String,
    /// Seed of all random values.
    pub seed: u64,
    /// `processes` or `inline`.
    pub runtime: String,
    /// `lockstep`, `realtime` or `realtime:SPEED`.
    pub clock: String,
    /// Number of drones at the start.
    pub drones: u32,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// The target shape of the formation.
    pub shape: Shape,
    /// Spacing of the formation, m.
    pub spacing_m: f64,
    /// Where the mission ends.
    pub end: MissionEnd,
    /// The direction in which the mission flies. The formation faces it.
    #[serde(default)]
    pub course: Course,
    /// Distance of the line along which the formation's front slot flies from the origin, to the left of the course, m.
    pub course_y_m: f64,
    /// Least distance that two bodies must keep, m.
    pub safe_distance_m: f64,
    /// Least distance that a body must keep to an obstacle, m.
    pub clearance_m: f64,
    /// Distance that paths keep from obstacles, m. Obstacles closer than twice this in flight direction are one set.
    pub planning_distance_m: f64,
    /// Largest slot error of a closed formation, m.
    pub arrival_error_m: f64,
    /// Radio range, m; `None` if it has no limit.
    pub radio_range_m: Option<f64>,
    /// The obstacles; the id of an obstacle is its index.
    #[serde(with = "outlines")]
    pub obstacles: Vec<ConvexShape>,
    /// The pilots, and the drones that they fly.
    #[serde(default)]
    pub pilots: Vec<PilotEntry>,
    /// The schemas of topics that pilots define.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<TopicSchema>,
    /// What the recording and the page draw beside the drones.
    #[serde(default)]
    pub scene: SceneFacts,
}

/// Where a mission ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MissionEnd {
    /// At the place where the formation closes again.
    Hold,
    /// In fixed slots.
    Goal {
        /// Position of the front slot, m.
        front_m: [f64; 2],
    },
    /// After a while, wherever the drones are.
    Time,
    /// When the pilots say so.
    Pilots,
}

impl RunFacts {
    /// The obstacle sets in flight order: obstacles clustered by their extents in flight direction.
    pub(crate) fn sets(&self) -> Vec<ObstacleSet> {
        let extents: Vec<(f64, f64)> = self.obstacles.iter().map(|shape| shape.extent(self.course)).collect();
        let mut order: Vec<usize> = (0..extents.len()).collect();
        order.sort_by(|&a, &b| extents[a].0.total_cmp(&extents[b].0));
        let mut sets: Vec<Vec<usize>> = Vec::new();
        let mut reach = f64::NEG_INFINITY;
        for obstacle in order {
            let (front, rear) = extents[obstacle];
            match sets.last_mut() {
                Some(set) if front - reach < 2.0 * self.planning_distance_m => set.push(obstacle),
                _ => sets.push(vec![obstacle]),
            }
            reach = reach.max(rear);
        }
        sets.into_iter().map(|set| self.set_of(set)).collect()
    }

    /// How far along the course the last obstacle set's gate is, m; `None` without obstacles.
    #[must_use]
    pub fn last_gate_x_m(&self) -> Option<f64> {
        self.sets().last().map(|set| set.gate_x_m)
    }

    fn set_of(&self, mut set: Vec<usize>) -> ObstacleSet {
        set.sort_unstable();
        let sum: f64 = set.iter().map(|&o| self.course.along(self.obstacles[o].centre())).sum();
        ObstacleSet { gate_x_m: sum / set.len() as f64, obstacles: set.into_iter().map(|o| o as u32).collect() }
    }
}

/// JSON form of the obstacles: vertices and a rounding radius.
mod outlines {
    use super::{ConvexShape, Vec2};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Outline {
        vertices_m: Vec<[f64; 2]>,
        radius_m: f64,
        /// Absent if the obstacle stands on the ground.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        floor_m: Option<f64>,
        /// Absent if it reaches to the sky.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        top_m: Option<f64>,
    }

    pub(crate) fn serialize<S: Serializer>(shapes: &[ConvexShape], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(shapes.iter().map(|shape| Outline {
            vertices_m: shape.vertices().map(Into::into).collect(),
            radius_m: shape.radius_m,
            floor_m: Some(shape.floor_m).filter(|m| m.is_finite()),
            top_m: Some(shape.top_m).filter(|m| m.is_finite()),
        }))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<ConvexShape>, D::Error> {
        let shape = |outline: Outline| {
            let vertices: Vec<Vec2> = outline.vertices_m.into_iter().map(Vec2::from).collect();
            let (floor_m, top_m) = (outline.floor_m, outline.top_m);
            ConvexShape::new(&vertices, outline.radius_m)
                .and_then(|shape| shape.between(floor_m.unwrap_or(f64::NEG_INFINITY), top_m.unwrap_or(f64::INFINITY)))
                .map_err(D::Error::custom)
        };
        Vec::<Outline>::deserialize(from)?.into_iter().map(shape).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    fn block(x: f64, y: f64) -> ConvexShape {
        ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(10.0, 15.0), 0.0).unwrap()
    }

    #[test]
    fn sets_are_clustered_in_flight_order() {
        let facts = RunFacts {
            obstacles: vec![block(640.0, 45.0), block(320.0, 0.0), block(640.0, -45.0), block(381.0, 0.0)],
            planning_distance_m: 20.0,
            ..facts(8)
        };
        let sets = facts.sets();
        let ids: Vec<_> = sets.iter().map(|set| set.obstacles.clone()).collect();
        assert_eq!(ids, [vec![1], vec![3], vec![0, 2]]);
        assert_eq!(sets[2].gate_x_m, 640.0);
        let wider = RunFacts { planning_distance_m: 21.0, ..facts };
        assert_eq!(wider.sets()[0], ObstacleSet { obstacles: vec![1, 3], gate_x_m: 350.5 });
    }

    #[test]
    fn facts_survive_json_and_invalid_outlines_are_refused() {
        let facts = RunFacts { obstacles: vec![block(1.0, 2.0)], ..facts(3) };
        let json = serde_json::to_string(&facts).unwrap();
        assert_eq!(serde_json::from_str::<RunFacts>(&json).unwrap(), facts);
        let bad = json.replace("\"radius_m\":0.0", "\"radius_m\":-1.0");
        let error = serde_json::from_str::<RunFacts>(&bad).unwrap_err().to_string();
        assert!(error.contains("finite"), "{error}");
    }
}
