//! A program that plays the roles of a run.

use crate::error::RuntimeError;
use skein_protocol::digest::Digest;
use skein_scenario::Scenario;
use std::ffi::OsString;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A program that answers to Skein's commands, `world` and `drone` included: its words, to which a command is appended.
#[derive(Debug)]
pub struct Program {
    words: Vec<OsString>,
    hash: OnceLock<String>,
}

impl Program {
    /// A program by its words: an executable and its first arguments.
    #[must_use]
    pub fn new(words: Vec<OsString>) -> Self {
        Self { words, hash: OnceLock::new() }
    }

    /// The executable of this process.
    ///
    /// # Errors
    /// [`RuntimeError::System`] if the system does not know it.
    pub fn current() -> Result<Self, RuntimeError> {
        let executable = std::env::current_exe().map_err(RuntimeError::system("finding this executable"))?;
        Ok(Self::new(vec![executable.into()]))
    }

    /// The program of a pilot's `command`.
    #[must_use]
    pub fn of_command(words: &[String]) -> Self {
        Self::new(words.iter().map(OsString::from).collect())
    }

    /// Its words. A word that is no Unicode is shown with replacement characters.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        self.words.iter().map(|word| word.to_string_lossy().into_owned()).collect()
    }

    /// A command that starts it. Arguments follow.
    #[must_use]
    pub fn command(&self) -> Command {
        let mut words = self.words.iter();
        let mut command = Command::new(words.next().cloned().unwrap_or_default());
        command.args(words);
        command
    }

    /// XXH3 over the contents of its files, 16 hex digits. The files are the words that name one; the first word counts only if it
    /// is the only one, so that another version of an interpreter is not another program.
    ///
    /// # Errors
    /// [`RuntimeError::System`] if no word names a file that can be read.
    pub fn hash(&self) -> Result<String, RuntimeError> {
        if let Some(hash) = self.hash.get() {
            return Ok(hash.clone());
        }
        let mut digest = Digest::default();
        for file in self.files() {
            hash_file(&file, &mut digest).map_err(RuntimeError::system(format!("reading {}", file.display())))?;
        }
        Ok(self.hash.get_or_init(|| format!("{:016x}", digest.value())).clone())
    }

    /// Whether its executable is a file: the one that its first word names, or one in the search path.
    pub(crate) fn is_there(&self) -> bool {
        self.words.first().is_some_and(|word| in_path(Path::new(word)).is_file())
    }

    fn files(&self) -> Vec<PathBuf> {
        let behind = self.words.iter().skip(1).map(PathBuf::from).filter(|path| path.is_file());
        let files: Vec<PathBuf> = behind.collect();
        if !files.is_empty() {
            return files;
        }
        self.words.first().map(|word| in_path(Path::new(word))).into_iter().collect()
    }
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words().join(" "))
    }
}

fn hash_file(path: &Path, digest: &mut Digest) -> std::io::Result<()> {
    let (mut file, mut buffer) = (std::fs::File::open(path)?, vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(()),
            read => _ = digest.bytes(&buffer[..read]),
        }
    }
}

/// The file that the shell's search path gives for a word without a folder; otherwise the word itself.
fn in_path(word: &Path) -> PathBuf {
    if word.components().count() == 1 {
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let found = std::env::split_paths(&folders).map(|folder| folder.join(word)).find(|path| path.is_file());
        return found.unwrap_or_else(|| word.to_owned());
    }
    word.to_owned()
}

/// Gives the files that pilots' commands name their absolute paths. `folder`: the folder of the scenario file. The first word is
/// the program; without a `/` it is looked up in the search path.
pub fn resolve_commands(scenario: &mut Scenario, folder: &Path) {
    for pilot in &mut scenario.pilots {
        for (place, word) in pilot.command.iter_mut().flatten().enumerate() {
            let path = folder.join(&*word);
            if (place > 0 || word.contains('/')) && path.is_file() {
                let absolute = std::path::absolute(&path).unwrap_or(path);
                *word = absolute.to_string_lossy().into_owned();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_the_script_and_not_of_its_interpreter() {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("boids.py");
        let hash = |text: &str, first: &str| {
            std::fs::write(&script, text).unwrap();
            Program::new(vec![first.into(), script.clone().into(), "--fast".into()]).hash().unwrap()
        };
        assert_eq!(hash("a", "/bin/sh"), hash("a", "/bin/true"));
        assert_ne!(hash("a", "/bin/sh"), hash("b", "/bin/sh"));
        let absent = Program::new(vec!["no-such-program".into()]);
        assert!(absent.hash().is_err() && !absent.is_there());
        assert_eq!(Program::new(vec!["sh".into()]).hash().unwrap().len(), 16);
    }
}
