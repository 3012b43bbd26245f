//! `skein-hosts`: flies one swarm over several machines. `skein host` and `skein run --hosts` start it, and so do `skein share` and
//! commands that look at swarms of other machines.
//!
//! The world stays on the launcher's machine. There, a [`relay`] takes the place of the drones of one host: in each tick it sends
//! what they sense in one message and gets their answers in one. On the host, a [`host`] offers drones, and each [`flight`] of
//! drones has processes, services and a barrier of its own. Zenoh carries the messages. docs/hosts.md shows how it is used.
//!
//! A [`share`] lets `skein view`, `top` and `topic` on other machines look at the swarms of this one; there, [`look`] fetches what
//! they ask for.

mod ask;
mod begin;
mod changed_words;
mod cli;
mod down;
mod downlink_part;
mod error;
mod feed_thread;
mod flight;
mod host;
mod keys;
mod lateness;
mod look;
mod names;
mod network;
mod outbox;
mod reader;
mod relay;
mod say;
mod seat;
mod share;
mod signals;
mod up;

use clap::Parser;
use cli::{Cli, Command};
use error::HostsError;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    start_logging();
    let done = match Cli::parse().command {
        Command::Host(args) => host::run(&args),
        Command::Relay(args) => relay::run(&args).map(|()| 0),
        Command::Share(args) => share::run(&args),
        Command::Look(args) => Ok(look::run(&args)),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(if matches!(error, HostsError::Usage(_) | HostsError::Refused { .. }) { 2 } else { 3 })
        }
    }
}

/// Logs to stderr: warnings and errors, unless `SKEIN_LOG` sets another filter. Of Zenoh only errors: it warns of each lost connection,
/// which this program reports itself.
fn start_logging() {
    let filter = std::env::var("SKEIN_LOG")
        .unwrap_or_else(|_| "warn,zenoh=error,zenoh_transport=error,zenoh_link=error".to_owned());
    let logging = tracing_subscriber::fmt().with_env_filter(EnvFilter::new(filter)).with_writer(std::io::stderr);
    logging.with_ansi(false).init();
}
