//! The `skein` binary: parses the command line, calls the libraries and prints.
#![allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "the doc comments of options are their help texts, not Markdown"
)]

mod bench;
mod check;
mod clean;
mod cli;
mod complaint;
mod doctor;
mod exit;
mod hunt;
mod input;
mod interrupt;
mod missing;
mod options;
mod output;
mod progress;
mod replay;
mod report;
mod reproduce;
mod roles;
mod run;
mod run_folder;
mod schema;
mod sweep;
mod tap;
mod top;
mod topic;
mod view;

use clap::Parser;
use cli::{Cli, Command};
use exit::{Exit, Failure};

fn main() -> std::process::ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(mut error) => {
            cli::suggest(&mut error);
            // clap prints help to stdout and errors to stderr. A closed pipe is not an error.
            let printed = error.print().is_ok_and(|()| std::io::Write::flush(&mut std::io::stdout()).is_ok());
            return match (error.use_stderr(), printed) {
                (true, _) => Exit::Usage.into(),
                (false, true) => Exit::Reached.into(),
                (false, false) => Exit::Environment.into(),
            };
        }
    };
    start_logging();
    match dispatch(cli.command) {
        Ok(exit) => exit.into(),
        Err(failure) => {
            failure.print();
            failure.exit.into()
        }
    }
}

fn dispatch(command: Command) -> Result<Exit, Failure> {
    match command {
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Sweep(args) => sweep::sweep(&args),
        Command::Hunt(args) => hunt::hunt(&args),
        Command::Reproduce(args) => reproduce::reproduce(&args),
        Command::Scene(args) => sweep::scene(&args),
        Command::Report(args) => report::report(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::View(args) => view::view(&args),
        Command::Top(args) => top::top(&args),
        Command::Topic(args) => topic::topic(&args),
        Command::Bench { of } => bench::bench(of.as_ref()),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Clean => clean::clean(),
        Command::Schema { of } => schema::schema(of),
        Command::Completions { shell } => schema::completions(shell),
        Command::Man { command } => schema::man(&command),
        Command::World(args) => roles::world(&args),
        Command::Drone(args) => roles::drone(&args),
        Command::BaselinePeer(args) => bench::peer(&args),
    }
}

/// Logs to stderr: warnings and errors, unless `SKEIN_LOG` sets another filter. Coloured on a terminal.
fn start_logging() {
    use std::io::IsTerminal;
    use tracing_subscriber::EnvFilter;
    let filter = EnvFilter::builder()
        .with_env_var("SKEIN_LOG")
        .with_default_directive(tracing::Level::WARN.into())
        .from_env_lossy();
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(colour)
        .log_internal_errors(false)
        .init();
}
