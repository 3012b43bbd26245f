//! The application: commands, and the pilots that they fly.

use crate::cli::{self, Cli, Command};
use crate::colour;
use crate::exit::{Exit, Failure};
use crate::output::{self, KeptStdout};
use crate::run::OnFolder;
use crate::{
    bench, check, clean, doctor, hosts, hunt, replay, report, reproduce, roles, run, schema, sweep, top, topic, view,
};
use clap::Parser;
use skein_pilot::{Birth, Pilot, PilotError};
use skein_protocol::TopicName;
use skein_report::TopicSchema;
use skein_runtime::{PilotRegistry, Program};
use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

/// An application with pilots of its own. It answers to every command of `skein`.
///
/// ```
/// let app = skein::App::new();
/// assert_eq!(app.run(["completions", "bash", "--no-such-option"]), 2);
/// ```
#[derive(Default)]
pub struct App {
    pilots: Vec<(String, Box<Make>)>,
    topics: Vec<(String, String)>,
    program: Option<Vec<OsString>>,
    on_folder: Option<Box<OnFolder>>,
}

type Make = dyn Fn(&Birth) -> Result<Box<dyn Pilot>, PilotError> + Send + Sync;

impl App {
    /// An application with the built-in pilots `paper` and `cruise`.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a pilot. `make` makes one for each start of a drone. A pilot that is given the name of a built-in one replaces it.
    #[must_use]
    pub fn pilot(self, name: &str, make: impl Fn(&Birth) -> Box<dyn Pilot> + Send + Sync + 'static) -> Self {
        self.try_pilot(name, move |birth| Ok(make(birth)))
    }

    /// Adds a pilot that can be refused, usually for a parameter. Each table of a scenario is tried before anything is started.
    #[must_use]
    pub fn try_pilot(
        mut self,
        name: &str,
        make: impl Fn(&Birth) -> Result<Box<dyn Pilot>, PilotError> + Send + Sync + 'static,
    ) -> Self {
        self.pilots.push((name.to_owned(), Box::new(make)));
        self
    }

    /// Says that pilots say JSON objects under this topic, and gives their JSON schema as text. `run.mcap` then has a channel
    /// `/pilots/TOPIC/DRONE` for each drone, with the schema, which Foxglove can plot. If the topic is no name of a topic, or the
    /// text is no JSON, every command ends with exit code 2.
    #[must_use]
    pub fn json_topic(mut self, topic: &str, schema: &str) -> Self {
        self.topics.push((topic.to_owned(), schema.to_owned()));
        self
    }

    /// Sets the words that start this application in another process, such as an interpreter and a script. The default is the
    /// executable of this process.
    #[must_use]
    pub fn program(self, words: impl IntoIterator<Item = OsString>) -> Self {
        Self { program: Some(words.into_iter().collect()), ..self }
    }

    /// Calls `tell` with the folder of a run, which is then empty, before its pilots and processes are started. Pilots that are
    /// written in another language keep what is said of their mistakes there.
    #[must_use]
    pub fn on_folder(self, tell: impl Fn(&Path) + Send + Sync + 'static) -> Self {
        Self { on_folder: Some(Box::new(tell)), ..self }
    }

    /// Does what the arguments of this process say.
    #[must_use]
    pub fn main(self) -> ExitCode {
        ExitCode::from(self.run(std::env::args_os().skip(1)))
    }

    /// Does what these arguments say, such as `run scenario.toml`, and returns the exit code.
    #[must_use]
    pub fn run(self, arguments: impl IntoIterator<Item = impl Into<OsString>>) -> u8 {
        let words = [OsString::from("skein")].into_iter().chain(arguments.into_iter().map(Into::into));
        let exit = match Cli::try_parse_from(words) {
            Ok(cli) => self.do_command(cli.command),
            Err(mut error) => {
                cli::suggest(&mut error);
                print_parsed(&error)
            }
        };
        exit.code()
    }

    fn do_command(mut self, command: Command) -> Exit {
        start_logging();
        let on_folder = self.on_folder.take();
        let done = self.registry().and_then(|pilots| dispatch(command, &pilots, on_folder.as_deref()));
        done.unwrap_or_else(|failure| {
            failure.print();
            failure.exit
        })
    }

    fn registry(self) -> Result<PilotRegistry, Failure> {
        let program = match self.program {
            Some(words) => Program::new(words),
            None => Program::current().map_err(Failure::environment)?,
        };
        let mut registry = PilotRegistry::new(program);
        for (name, make) in self.pilots {
            registry.register(&name, make);
        }
        for (topic, text) in self.topics {
            TopicName::new(&topic).map_err(Failure::usage)?;
            let wrong = |error| Failure::usage(format!("topic {topic}: the schema is no JSON: {error}"));
            let schema = serde_json::from_str(&text).map_err(wrong)?;
            registry.describe_topic(TopicSchema { topic, schema });
        }
        Ok(registry)
    }
}

fn dispatch(command: Command, pilots: &PilotRegistry, on_folder: Option<&OnFolder>) -> Result<Exit, Failure> {
    use Command::{Bench, Check, Hunt, Replay, Run, Sweep};
    let flies = matches!(command, Run(_) | Check(_) | Sweep(_) | Hunt(_) | Replay(_) | Bench { .. });
    // What a pilot prints in this process must not get between the data on stdout.
    let _kept = (flies && !pilots.own_names().is_empty())
        .then(KeptStdout::take)
        .transpose()
        .map_err(|error| Failure::environment(format!("stdout: {error}")))?;
    match command {
        Command::Run(args) => run::run(&args, pilots, on_folder),
        Command::Host(args) => hosts::host(&args, pilots),
        Command::Share(args) => hosts::share(&args),
        Command::Check(args) => check::check(&args, pilots),
        Command::Sweep(args) => sweep::sweep(&args, pilots),
        Command::Hunt(args) => hunt::hunt(&args, pilots),
        Command::Reproduce(args) => reproduce::reproduce(&args),
        Command::Scene(args) => sweep::scene(&args),
        Command::Report(args) => report::report(&args),
        Command::Replay(args) => replay::replay(&args, pilots),
        Command::View(args) => view::view(&args),
        Command::Top(args) => top::top(&args),
        Command::Topic(args) => topic::topic(&args),
        Command::Bench { of } => bench::bench(of.as_ref(), pilots),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Clean => clean::clean(),
        Command::Schema { of } => schema::schema(of),
        Command::Completions { shell } => schema::completions(shell),
        Command::Man { command } => schema::man(&command),
        Command::World(args) => roles::world(&args),
        Command::Drone(args) => roles::drone(&args, pilots),
        Command::BaselinePeer(args) => bench::peer(&args),
    }
}

/// Prints the help, the version or the error in which the parsing of arguments ended: help to stdout, errors to stderr.
fn print_parsed(parsed: &clap::Error) -> Exit {
    let text = |colour: bool| if colour { parsed.render().ansi().to_string() } else { parsed.render().to_string() };
    if parsed.use_stderr() {
        // If this fails, no one is there to be told.
        let _ = write!(std::io::stderr().lock(), "{}", text(colour::wanted(std::io::stderr().is_terminal())));
        return Exit::Usage;
    }
    match output::print(text(colour::wanted(output::is_terminal()))) {
        Ok(_) => Exit::Reached,
        Err(failure) => {
            failure.print();
            failure.exit
        }
    }
}

/// Logs to stderr: warnings and errors, unless `SKEIN_LOG` sets another filter. Coloured on a terminal.
fn start_logging() {
    use tracing_subscriber::EnvFilter;
    let filter = EnvFilter::builder()
        .with_env_var("SKEIN_LOG")
        .with_default_directive(tracing::Level::WARN.into())
        .from_env_lossy();
    let logging = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(colour::wanted(std::io::stderr().is_terminal()))
        .log_internal_errors(false);
    // A program that has its own logging keeps it.
    let _ = logging.try_init();
}
