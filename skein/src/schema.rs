//! `skein schema`, `skein completions`, `skein man`.

use crate::cli::{Cli, SchemaOf};
use crate::exit::{Exit, Failure};
use crate::output;
use clap::CommandFactory;
use skein_scenario::nearest;

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

/// Prints the manual page of a command, named by its words; without words, of the whole program.
pub(crate) fn man(words: &[String]) -> Result<Exit, Failure> {
    let mut command = Cli::command();
    command.build();
    let mut name = command.get_name().to_owned();
    for word in words {
        let Some(found) = command.find_subcommand(word) else { return Err(unknown(&command, &name, word)) };
        name = format!("{name}-{}", found.get_name());
        command = found.clone();
    }
    let mut text = Vec::new();
    let page = clap_mangen::Man::new(command).title(&name);
    page.render(&mut text).map_err(Failure::environment)?;
    print(&text)
}

/// The failure for a word that is no command of `command`.
fn unknown(command: &clap::Command, name: &str, word: &str) -> Failure {
    let known: Vec<&str> =
        command.get_subcommands().filter(|sub| !sub.is_hide_set()).map(clap::Command::get_name).collect();
    let hint = match (nearest(word, known.iter().copied()), known.is_empty()) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, false) => format!("expected one of {}", known.join(", ")),
        (None, true) => "it has no commands of its own".to_owned(),
    };
    Failure::usage(format!("`{}` has no command `{word}`; {hint}", name.replace('-', " ")))
}

fn print(text: impl AsRef<[u8]>) -> Result<Exit, Failure> {
    output::print(text).map(|_| Exit::Reached)
}
