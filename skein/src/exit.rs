//! Every exit code, and what leads to it.
//!
//! | code | when |
//! |---|---|
//! | 0 | the mission reached its goal and every invariant held |
//! | 1 | the goal was not reached: the mission's time ran out |
//! | 2 | bad usage or a bad scenario; nothing was started |
//! | 3 | the environment failed: shared memory, limits, a process that could not be started, a killed world |
//! | 4 | an invariant was broken |
//! | 130, 143 | interrupted by SIGINT or SIGTERM, after a clean shutdown |
//!
//! Where several hold: 130 and 143 before 3, before 4, before 1.

use std::process::ExitCode;

/// An exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// 0.
    Reached,
    /// 1.
    NotReached,
    /// 2.
    Usage,
    /// 3.
    Environment,
    /// 4.
    Unsafe,
    /// 128 and the signal's number.
    Interrupted(i32),
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        match exit {
            Exit::Reached => Self::from(0),
            Exit::NotReached => Self::from(1),
            Exit::Usage => Self::from(2),
            Exit::Environment => Self::from(3),
            Exit::Unsafe => Self::from(4),
            Exit::Interrupted(signal) => Self::from(128u8.wrapping_add(signal.unsigned_abs() as u8)),
        }
    }
}

/// Why a command ends early: a message for people, and an exit code.
pub struct Failure {
    /// The code.
    pub exit: Exit,
    /// What to show.
    report: Report,
}

enum Report {
    Text(String),
    Diagnostic(Box<dyn miette::Diagnostic + Send + Sync>),
}

impl Failure {
    /// Bad usage or bad input.
    pub fn usage(message: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Usage, report: Report::Text(message.to_string()) }
    }

    /// The environment failed.
    pub fn environment(message: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Environment, report: Report::Text(message.to_string()) }
    }

    /// Bad input that can be shown in its place.
    pub fn diagnostic(diagnostic: impl miette::Diagnostic + Send + Sync + 'static) -> Self {
        Self { exit: Exit::Usage, report: Report::Diagnostic(Box::new(diagnostic)) }
    }

    /// Shows it on stderr: with the place in the file on a terminal, else one line an error.
    pub fn print(&self) {
        use std::io::IsTerminal;
        match &self.report {
            Report::Text(text) => eprintln!("skein: {text}"),
            Report::Diagnostic(diagnostic) if std::io::stderr().is_terminal() => {
                let theme = match std::env::var_os("NO_COLOR") {
                    None => miette::GraphicalTheme::unicode(),
                    Some(_) => miette::GraphicalTheme::unicode_nocolor(),
                };
                let mut shown = String::new();
                let handler = miette::GraphicalReportHandler::new_themed(theme).with_wrap_lines(false);
                match handler.render_report(&mut shown, diagnostic.as_ref()) {
                    Ok(()) => eprint!("{shown}"),
                    Err(_) => eprintln!("skein: {diagnostic}"),
                }
            }
            Report::Diagnostic(diagnostic) => eprintln!("skein: {diagnostic}"),
        }
    }
}
