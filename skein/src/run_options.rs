//! Options of `run` that are about one way to fly, and are refused with another one: they would be ignored.

use crate::cli::RunArgs;
use crate::exit::Failure;
use crate::options::RuntimeChoice;
use skein_runtime::Clock;

/// Refuses options that have no meaning with the runtime and the clock.
pub(crate) fn check(args: &RunArgs) -> Result<(), Failure> {
    let (inline, needed) = (args.runtime == RuntimeChoice::Inline, "--runtime processes");
    let many_threads = args.threads.get() > 1;
    let options = [
        ("--threads", many_threads && !inline, "--runtime inline"),
        ("--patience", args.patience.is_some() && inline, needed),
        ("--patience", args.patience.is_some() && args.clock != Clock::Lockstep, "--clock lockstep"),
        ("--drones-per-process", args.drones_per_process.is_some() && inline, needed),
        ("--pin", args.pin.is_some() && inline, needed),
        ("--wait", args.wait.is_some() && inline, needed),
    ];
    let ignored = options.into_iter().find(|(_, ignored, _)| *ignored).map(|(option, _, needed)| (option, needed));
    let network = args.network.given().filter(|_| inline).map(|option| (option, needed));
    match ignored.or(network) {
        Some((option, needed)) => Err(Failure::usage(format!("{option}: expected {needed} beside it"))),
        None => Ok(()),
    }
}
