//! A pilot for missions in any of the four directions.

use crate::params::PilotParams;
use crate::swarm_pilot::SwarmPilot;
use skein_pilot::{Command, Inbox, Motion, Out, Pilot};
use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, SensedShape, Senses};
use skein_protocol::turned::{depends_on_frame, turn_to_world};
use skein_protocol::{Course, Message, MessageRef, SimTime, horizontal, raised};

/// A [`SwarmPilot`] that senses, hears, commands and says everything in the world frame, and flies in the frame of its course. So a mission
/// along +y flies exactly as the same mission along +x.
#[derive(Clone, Debug)]
pub struct CoursePilot {
    course: Course,
    pilot: SwarmPilot,
}

impl CoursePilot {
    /// A drone that has just started. `params` are in the frame of the course.
    #[must_use]
    pub fn new(course: Course, params: PilotParams) -> Self {
        Self { course, pilot: SwarmPilot::new(params) }
    }

    /// A vector in the frame of the course.
    fn to_course(&self, v: [f64; 3]) -> [f64; 3] {
        raised(self.course.from_world(horizontal(v)), v[2])
    }

    /// A vector in the world frame.
    fn to_world(&self, v: [f64; 3]) -> [f64; 3] {
        raised(self.course.to_world(horizontal(v)), v[2])
    }

    /// A message as it reads in the frame of the course; `None` if it is the same in both frames.
    fn turned(&self, message: MessageRef<'_>) -> Option<Message> {
        depends_on_frame(&message).then(|| {
            let mut turned = message.to_message();
            turn_to_world(&mut turned, self.course.inverse());
            turned
        })
    }

    /// The obstacles that the drone senses, with their outlines.
    fn obstacles(&self, senses: &Senses<'_>) -> (Vec<SensedObstacle>, Vec<SensedShape>) {
        let sensed = senses.obstacles.iter().filter_map(|obstacle| Some((obstacle, senses.shape(obstacle)?)));
        let turned = (0..).zip(sensed).map(|(number, (obstacle, outline))| {
            let nearest_m = self.to_course(obstacle.nearest_m);
            let shape = outline.shape.to_world(self.course.inverse());
            (SensedObstacle { nearest_m, shape: number, ..*obstacle }, SensedShape { shape, ..*outline })
        });
        turned.unzip()
    }

    fn neighbours(&self, senses: &Senses<'_>) -> Vec<SensedNeighbour> {
        let turned = |neighbour: &SensedNeighbour| SensedNeighbour {
            position_m: self.to_course(neighbour.position_m),
            velocity_mps: self.to_course(neighbour.velocity_mps),
            ..*neighbour
        };
        senses.neighbours.iter().map(turned).collect()
    }

    fn step_turned(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let (obstacles, shapes) = self.obstacles(senses);
        let neighbours = self.neighbours(senses);
        let motion = (self.to_course(senses.position_m), self.to_course(senses.velocity_mps));
        let mut turned = Senses::new((senses.tick, senses.now), motion, &obstacles, &neighbours, &shapes);
        (turned.extra_reaction_s, turned.broken) = (senses.extra_reaction_s, senses.broken);
        let messages: Vec<_> = inbox.heard().iter().map(|heard| self.turned(heard.message)).collect();
        let mut heard = inbox.heard().to_vec();
        for (heard, turned) in heard.iter_mut().zip(&messages) {
            heard.message = turned.as_ref().map_or(heard.message, MessageRef::from);
        }
        let command = self.pilot.step(&turned, &Inbox::new(&heard), out);
        for message in out.messages_mut() {
            turn_to_world(message, self.course);
        }
        self.commanded(&command)
    }

    /// A command in the world frame.
    fn commanded(&self, command: &Command) -> Command {
        let turned = match command.motion() {
            Motion::Acceleration(mps2) => Command::acceleration(self.to_world(mps2)),
            Motion::Velocity(mps) => Command::velocity(self.to_world(mps)),
        };
        turned.with_status(*command.status())
    }
}

impl Pilot for CoursePilot {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        match self.course {
            Course::East => self.pilot.step(senses, inbox, out),
            _ => self.step_turned(senses, inbox, out),
        }
    }

    fn begin_step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) {
        if self.course == Course::East {
            self.pilot.begin_step(senses, inbox, out);
        }
    }

    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        self.pilot.pose_ages_s(now, ages);
    }
}
