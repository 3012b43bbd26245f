//! `skein schema`, `skein completions`, `skein man`.

use crate::cli::{Cli, SchemaOf};
use crate::exit::{Exit, Failure};
use crate::output;
use clap::CommandFactory;

/// Prints a JSON schema.
pub(crate) fn schema(of: SchemaOf) -> Result<Exit, Failure> {
    let schema = match of {
        SchemaOf::Summary => skein_report::schema_summary(),
        SchemaOf::Scenario => skein_scenario::schema(),
    };
    let text = serde_json::to_string_pretty(&schema).map_err(Failure::environment)?;
    print(format!("{text}\n"))
}

/// Prints completions for a shell.
pub(crate) fn completions(shell: clap_complete::Shell) -> Result<Exit, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "skein", &mut text);
    print(&text)
}

/// Prints the manual page.
pub(crate) fn man() -> Result<Exit, Failure> {
    let mut text = Vec::new();
    clap_mangen::Man::new(Cli::command()).render(&mut text).map_err(Failure::environment)?;
    print(&text)
}

fn print(text: impl AsRef<[u8]>) -> Result<Exit, Failure> {
    output::print(text).map(|_| Exit::Reached)
}
