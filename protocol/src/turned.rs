//! Messages in the frame of a course and in the world frame.

use crate::course::Course;
use crate::message::{Message, MessageRef};
use crate::space::horizontal;
use crate::{Vec2, raised};

/// Whether the message reads otherwise in another frame. Those that name no place or direction do not, nor do pilots' own messages and
/// separating lines: their angles are from the course, and the frames have one origin.
#[must_use]
pub fn depends_on_frame(message: &MessageRef<'_>) -> bool {
    match message {
        MessageRef::Pose(_)
        | MessageRef::Obstacle(_)
        | MessageRef::Plan(_)
        | MessageRef::Assignment(_)
        | MessageRef::AssignmentList(_)
        | MessageRef::Presence(_) => true,
        MessageRef::Leadership(_)
        | MessageRef::Arrivals(_)
        | MessageRef::Passed(_)
        | MessageRef::Separation(_)
        | MessageRef::User(_) => false,
    }
}

/// The same message of the course's frame, in the world frame. With [`Course::inverse`] it is the other way round.
pub fn turn_to_world(message: &mut Message, course: Course) {
    let plane = |v: &mut [f64; 2]| *v = course.to_world(Vec2::from(*v)).into();
    match message {
        Message::Pose(pose) => {
            for v in [&mut pose.position_m, &mut pose.velocity_mps] {
                *v = raised(course.to_world(horizontal(*v)), v[2]);
            }
        }
        Message::Obstacle(obstacle) => obstacle.shape = obstacle.shape.to_world(course),
        Message::Plan(plan) => {
            plane(&mut plan.anchor_m);
            plane(&mut plan.anchor_mps);
            plan.course = Course::from_quarters(plan.course % 4 + course.quarters()).quarters();
        }
        Message::Assignment(part) => plane(&mut part.slot_m),
        Message::AssignmentList(list) => list.drones.iter_mut().for_each(|listed| plane(&mut listed.slot_m)),
        Message::Presence(presence) => {
            // A turn by a quarter keeps each number, so that no digit is lost.
            let turned = |x: f32, y: f32| course.to_world(Vec2::new(x.into(), y.into())).map(|n| n as f32);
            for present in &mut presence.drones {
                let ([x, y, z], [vx, vy]) = (present.position_m, present.velocity_mps);
                let place = turned(x, y);
                present.position_m = [place.x, place.y, z];
                present.velocity_mps = turned(vx, vy).into();
            }
        }
        Message::Leadership(_)
        | Message::Arrivals(_)
        | Message::Passed(_)
        | Message::Separation(_)
        | Message::User(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload::{Assignment, AssignmentList, Obstacle, Plan, Pose, Presence, Separation};
    use crate::shape::ConvexShape;
    use crate::{DroneId, ObstacleId, SimTime};
    use bytemuck::Zeroable;

    fn messages() -> Vec<Message> {
        let pose = Pose { position_m: [1.0, 2.0, 50.0], velocity_mps: [3.0, -4.0, 0.5], ..Pose::zeroed() };
        let shape = ConvexShape::rectangle(Vec2::new(9.0, 5.0), Vec2::new(2.0, 1.0), 0.3).unwrap();
        let obstacle = Obstacle { shape, id: ObstacleId(3), witness: DroneId(1) };
        let plan = Plan { anchor_m: [7.0, 1.0], anchor_mps: [2.0, 0.5], anchor_stop_x_m: 9.0, ..Plan::zeroed() };
        let part = Assignment { slot_m: [-35.0, 20.0], ..Assignment::zeroed() };
        let mut presence = Presence { count: 1, ..Presence::default() };
        presence.drones[0].position_m = [0.1, 7.7, 3.0];
        presence.drones[0].velocity_mps = [1.3, -0.2];
        vec![
            Message::Pose(pose),
            Message::Obstacle(obstacle),
            Message::Plan(plan),
            Message::Assignment(part),
            Message::AssignmentList(AssignmentList::of(&part)),
            Message::Presence(presence),
        ]
    }

    #[test]
    fn a_message_is_turned_and_turned_back() {
        for course in [Course::North, Course::West, Course::South] {
            for message in messages() {
                let mut turned = message;
                turn_to_world(&mut turned, course);
                assert!(depends_on_frame(&MessageRef::from(&message)) && turned != message, "{course:?} {message:?}");
                turn_to_world(&mut turned, course.inverse());
                assert_eq!(turned, message, "{course:?}");
            }
        }
        let mut lines = Message::Separation(Separation::zeroed());
        turn_to_world(&mut lines, Course::North);
        assert!(!depends_on_frame(&MessageRef::from(&lines)) && lines == Message::Separation(Separation::zeroed()));
    }

    #[test]
    fn places_are_turned_about_the_origin() {
        let mut pose = messages().remove(0);
        turn_to_world(&mut pose, Course::North);
        let Message::Pose(pose) = pose else { panic!("it is a beacon") };
        assert_eq!((pose.position_m, pose.velocity_mps), ([-2.0, 1.0, 50.0], [4.0, 3.0, 0.5]));
    }

    #[test]
    fn the_anchor_of_a_turned_plan_stops_at_the_turned_place() {
        let Message::Plan(plan) = messages().remove(2) else { panic!("it is a plan") };
        for course in Course::ALL {
            let mut turned = Message::Plan(plan);
            turn_to_world(&mut turned, course);
            let Message::Plan(turned) = turned else { panic!("it is a plan") };
            assert_eq!((turned.course(), turned.anchor_stops()), (course, plan.anchor_stops()));
            for now in [0.5, 1.5].map(SimTime::from_secs) {
                let (place, velocity) = plan.anchor_at(now);
                assert_eq!(turned.anchor_at(now), (course.to_world(place), course.to_world(velocity)), "{course:?}");
            }
        }
    }
}
