//! The direction in which a mission flies. Formations, obstacle sets and routes are the same for each of the four directions: a pilot turns
//! what it senses and hears so that its course leads east, and turns back what it commands and says.

use crate::Vec2;
use serde::{Deserialize, Serialize};

/// One of the four directions along an axis of the world frame. The frame of a course has the same origin as the world frame, x along the
/// course and y to its left. A turn by a quarter is exact: it exchanges coordinates and changes signs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Course {
    /// Along +x.
    #[default]
    East,
    /// Along +y.
    North,
    /// Along −x.
    West,
    /// Along −y.
    South,
}

impl Course {
    /// All courses, each a quarter turn to the left of the one before.
    pub const ALL: [Self; 4] = [Self::East, Self::North, Self::West, Self::South];

    /// The course nearest to this way, m. Of two that are equally near, the one along x.
    #[must_use]
    pub fn along_way(way: Vec2) -> Self {
        match (way.y.abs() > way.x.abs(), way.x < 0.0, way.y < 0.0) {
            (false, false, _) => Self::East,
            (false, true, _) => Self::West,
            (true, _, false) => Self::North,
            (true, _, true) => Self::South,
        }
    }

    /// Number of quarter turns to the left from +x, 0 to 3.
    #[must_use]
    pub const fn quarters(self) -> u32 {
        self as u32
    }

    /// The course so many quarter turns to the left of +x. Whole turns have no effect.
    #[must_use]
    pub const fn from_quarters(quarters: u32) -> Self {
        Self::ALL[(quarters % 4) as usize]
    }

    /// The course that turns back what this one turns.
    #[must_use]
    pub const fn inverse(self) -> Self {
        Self::from_quarters(4 - self.quarters())
    }

    /// The direction of the course in the world frame, of length 1.
    #[must_use]
    pub fn direction(self) -> Vec2 {
        self.to_world(Vec2::x())
    }

    /// A point or vector of the course's frame, in the world frame.
    #[must_use]
    pub fn to_world(self, v: Vec2) -> Vec2 {
        // A difference from 0 has no negative zero, whose angle would be another one than that of zero.
        match self {
            Self::East => v,
            Self::North => Vec2::new(0.0 - v.y, v.x),
            Self::West => Vec2::new(0.0 - v.x, 0.0 - v.y),
            Self::South => Vec2::new(v.y, 0.0 - v.x),
        }
    }

    /// A point or vector of the world frame, in the course's frame.
    #[must_use]
    pub fn from_world(self, v: Vec2) -> Vec2 {
        self.inverse().to_world(v)
    }

    /// How far along the course a point of the world frame is, m.
    #[must_use]
    pub fn along(self, point: Vec2) -> f64 {
        self.from_world(point).x
    }

    /// The extent along the course of a box with these lower left and upper right corners (world frame, m): where it begins and where it
    /// ends, m.
    #[must_use]
    pub fn extent(self, (low, high): (Vec2, Vec2)) -> (f64, f64) {
        let (a, b) = (self.along(low), self.along(high));
        (a.min(b), a.max(b))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_is_the_nearest_axis() {
        let course = |x, y| Course::along_way(Vec2::new(x, y));
        assert_eq!([course(9.0, 8.0), course(8.0, 9.0)], [Course::East, Course::North]);
        assert_eq!([course(-9.0, -8.0), course(-8.0, -9.0)], [Course::West, Course::South]);
        assert_eq!([course(5.0, 5.0), course(-5.0, 5.0), course(0.0, 0.0)], [Course::East, Course::West, Course::East]);
    }

    #[test]
    fn turns_are_exact_and_have_an_inverse() {
        let point = Vec2::new(0.1, -7.3);
        for (course, direction) in Course::ALL.into_iter().zip([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) {
            assert_eq!(course.direction(), Vec2::from(direction));
            assert_eq!(course.from_world(course.to_world(point)), point);
            assert_eq!(Course::along_way(course.direction()), course);
            assert_eq!(course.along(course.to_world(point)), 0.1);
            assert!(course.to_world(Vec2::zeros()).iter().all(|zero| zero.is_sign_positive()));
        }
    }

    #[test]
    fn a_box_has_an_extent_along_each_course() {
        let corners = (Vec2::new(2.0, 10.0), Vec2::new(3.0, 30.0));
        let extents = Course::ALL.map(|course| course.extent(corners));
        assert_eq!(extents, [(2.0, 3.0), (10.0, 30.0), (-3.0, -2.0), (-30.0, -10.0)]);
    }
}
