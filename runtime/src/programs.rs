//! Which program each process of a run is started from.

use crate::program::Program;
use skein_protocol::DroneId;
use skein_scenario::Scenario;

/// The launcher's program, and those of pilots that are programs of their own.
pub(crate) struct Programs<'l> {
    launcher: &'l Program,
    /// One entry per table of pilots.
    commands: Vec<Option<Program>>,
    /// The table of each drone's pilot.
    tables: Vec<Option<usize>>,
}

impl<'l> Programs<'l> {
    pub(crate) fn new(scenario: &Scenario, launcher: &'l Program) -> Self {
        let commands = scenario.pilots.iter().map(|table| table.command.as_deref().map(Program::of_command));
        Self { launcher, commands: commands.collect(), tables: scenario.pilot_tables() }
    }

    /// The program of the launcher and of the world.
    pub(crate) fn launcher(&self) -> &Program {
        self.launcher
    }

    /// The program that flies a drone.
    pub(crate) fn of(&self, drone: DroneId) -> &Program {
        self.command_of(drone).and_then(|table| self.commands[table].as_ref()).unwrap_or(self.launcher)
    }

    /// Whether one process can fly both drones.
    pub(crate) fn share(&self, one: DroneId, other: DroneId) -> bool {
        self.command_of(one) == self.command_of(other)
    }

    /// The table of the drone's pilot, if that is a program of its own.
    fn command_of(&self, drone: DroneId) -> Option<usize> {
        let table = self.tables.get(drone.index()).copied().flatten();
        table.filter(|&number| self.commands.get(number).is_some_and(Option::is_some))
    }
}
