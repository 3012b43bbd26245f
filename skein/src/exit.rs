//! The exit codes.
//!
//! | code | when |
//! |---|---|
//! | 0 | the mission reached its goal and every invariant held |
//! | 1 | the goal was not reached: the mission's time ran out, or some drone has no way there |
//! | 2 | bad usage or a bad scenario; nothing was started |
//! | 3 | the environment failed: shared memory, limits, a process that could not be started, a killed world, a pilot that ended an inline run |
//! | 4 | an invariant was broken |
//! | 129, 130, 143 | interrupted by SIGHUP, SIGINT or SIGTERM, after a clean shutdown |
//!
//! If several apply: these come before 3, 3 before 4, 4 before 1.

use crate::colour;
use crate::complaint::complain;
use skein_report::text::printable;
use std::borrow::Cow;
use std::fmt;

/// An exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// 0: the goal was reached.
    Reached,
    /// 1: the goal was not reached.
    NotReached,
    /// 2: bad usage or a bad scenario.
    Usage,
    /// 3: the environment failed.
    Environment,
    /// 4: an invariant was broken.
    Unsafe,
    /// 128 plus the number of the signal that interrupted it.
    Interrupted(i32),
}

impl Exit {
    /// The number that the process returns.
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Reached => 0,
            Self::NotReached => 1,
            Self::Usage => 2,
            Self::Environment => 3,
            Self::Unsafe => 4,
            Self::Interrupted(signal) => 128u8.wrapping_add(signal.unsigned_abs() as u8),
        }
    }
}

/// Why a command failed: an exit code and a message.
pub(crate) struct Failure {
    /// The exit code.
    pub(crate) exit: Exit,
    /// The message.
    report: Report,
}

enum Report {
    Text(String),
    Diagnostic(Box<dyn miette::Diagnostic + Send + Sync>),
}

impl Failure {
    /// A failure because of bad usage or bad input.
    pub(crate) fn usage(message: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Usage, report: Report::Text(message.to_string()) }
    }

    /// A failure of the environment.
    pub(crate) fn environment(message: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Environment, report: Report::Text(message.to_string()) }
    }

    /// A failure with a run's folder.
    pub(crate) fn report(error: skein_report::ReportError) -> Self {
        if error.is_usage() { Self::usage(error) } else { Self::environment(error) }
    }

    /// A failure because of bad input, which can be shown in its file.
    pub(crate) fn diagnostic(diagnostic: impl miette::Diagnostic + Send + Sync + 'static) -> Self {
        Self { exit: Exit::Usage, report: Report::Diagnostic(Box::new(diagnostic)) }
    }

    /// Prints the message to stderr. On a terminal it shows the place in the file; otherwise one line per error.
    pub(crate) fn print(&self) {
        use std::io::{IsTerminal, Write};
        match &self.report {
            Report::Diagnostic(diagnostic) if std::io::stderr().is_terminal() => {
                let plain = rendered(diagnostic.as_ref(), miette::GraphicalTheme::unicode_nocolor());
                let shown = match printable(&plain) {
                    // The file holds control characters, which must not reach the terminal.
                    Cow::Owned(harmless) => harmless,
                    Cow::Borrowed(_) if colour::wanted(true) => {
                        rendered(diagnostic.as_ref(), miette::GraphicalTheme::unicode())
                    }
                    Cow::Borrowed(_) => plain,
                };
                // If this fails, no one is there to be told.
                let _ = write!(std::io::stderr().lock(), "{shown}");
            }
            Report::Text(_) | Report::Diagnostic(_) => complain(self),
        }
    }
}

/// The diagnostic with its place in the file.
fn rendered(diagnostic: &dyn miette::Diagnostic, theme: miette::GraphicalTheme) -> String {
    let mut shown = String::new();
    let handler = miette::GraphicalReportHandler::new_themed(theme).with_wrap_lines(false).with_links(false);
    match handler.render_report(&mut shown, diagnostic) {
        Ok(()) => shown,
        Err(_) => format!("skein: {diagnostic}\n"),
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.report {
            Report::Text(text) => f.write_str(text),
            Report::Diagnostic(diagnostic) => write!(f, "{diagnostic}"),
        }
    }
}
