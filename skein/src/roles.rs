//! `skein world` and `skein drone`: the process roles, started by `skein run`.

use crate::cli::{self, DroneArgs, WorldArgs};
use crate::exit::{Exit, Failure};
use skein_protocol::DroneId;
use skein_runtime::{ChildArgs, DroneRange, PilotRegistry, RuntimeError, drone_process, world_process};

/// Runs the world process.
pub(crate) fn world(args: &WorldArgs) -> Result<Exit, Failure> {
    let run = world_process::run(&child(&args.child), args.clock, args.patience);
    run.map(|()| Exit::Reached).map_err(|error| Failure::environment(format!("world: {error}")))
}

/// Runs a drone process, which may carry several drones.
pub(crate) fn drone(args: &DroneArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    let DroneArgs { id, count, incarnation, first_tick, .. } = *args;
    let range = DroneRange { first: DroneId(id), count, incarnation, first_tick };
    let run = drone_process::run(&child(&args.child), range, pilots);
    run.map(|()| Exit::Reached).map_err(|error| {
        let message = format!("drone {}: {error}", args.id);
        if matches!(error, RuntimeError::Pilot(_)) { Failure::usage(message) } else { Failure::environment(message) }
    })
}

fn child(args: &cli::ChildArgs) -> ChildArgs {
    ChildArgs { domain: args.domain.clone(), control: args.control, parent: args.parent, pin: args.pin.into() }
}
