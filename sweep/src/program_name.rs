//! How a program is written in commands.

use skein_runtime::Program;
use std::path::Path;

/// The program with the built-in pilots alone.
pub(crate) const SKEIN: &str = "skein";

/// The program as a shell reads it: the name of an executable without its folder, or all words of a script and its interpreter.
#[must_use]
pub fn program_name(program: &Program) -> String {
    let words = program.words();
    match &words[..] {
        [] => SKEIN.to_owned(),
        [executable] => quoted(&file_name(executable)),
        [interpreter, arguments @ ..] => {
            let arguments = arguments.iter().map(|word| quoted(word));
            std::iter::once(quoted(&file_name(interpreter))).chain(arguments).collect::<Vec<_>>().join(" ")
        }
    }
}

fn file_name(path: &str) -> String {
    Path::new(path).file_name().map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Quotes a word for a shell, if it needs quotes.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_named_as_it_is_started() {
        let name = |words: &[&str]| {
            program_name(&Program::of_command(&words.iter().map(|&w| w.to_owned()).collect::<Vec<_>>()))
        };
        assert_eq!(name(&["/opt/swirl/bin/swirl"]), "swirl");
        assert_eq!(name(&["/usr/bin/python3", "pilots/my boids.py"]), "python3 'pilots/my boids.py'");
        assert_eq!(name(&[]), "skein");
    }
}
