//! Whether output is coloured: one rule for all commands. It is if it goes to a terminal that is not `dumb`, and `NO_COLOR` is unset or empty.

use std::ffi::OsStr;

/// Whether what is printed to a stream is coloured. `is_terminal`: whether the stream is a terminal.
pub(crate) fn wanted(is_terminal: bool) -> bool {
    let variable = |name| std::env::var_os(name);
    is_terminal && allowed(variable("NO_COLOR").as_deref(), variable("TERM").as_deref())
}

/// Whether the environment allows colour.
fn allowed(no_color: Option<&OsStr>, term: Option<&OsStr>) -> bool {
    no_color.is_none_or(OsStr::is_empty) && term.is_none_or(|term| term != "dumb")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_color_and_a_dumb_terminal_forbid_colour() {
        let allowed = |no_color: Option<&'static str>, term: Option<&'static str>| {
            allowed(no_color.map(OsStr::new), term.map(OsStr::new))
        };
        assert!(allowed(None, None) && allowed(None, Some("xterm")) && allowed(Some(""), Some("xterm")));
        assert!(!allowed(Some("0"), Some("xterm")) && !allowed(None, Some("dumb")) && !allowed(Some("1"), None));
    }
}
