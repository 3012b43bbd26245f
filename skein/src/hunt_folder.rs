//! The folder of a hunt. It is made before the first flight, so that a long hunt does not end at a folder that cannot be written.

use crate::exit::Failure;
use skein_report::{ReportError, WorkFolder};
use skein_sweep::hunt::Finding;
use std::path::{Path, PathBuf};

/// The folder in which folders without a name of their own are made.
const HUNTS: &str = "hunts";

/// The folder of a hunt.
pub(crate) struct HuntFolder {
    work: WorkFolder,
    /// Whether this process has made it.
    new: bool,
}

impl HuntFolder {
    /// Makes the folder `path`. An existing one is refused, unless `force` is set and it is empty or a hunt's.
    pub(crate) fn at(path: &Path, force: bool) -> Result<Self, Failure> {
        if !force && path.symlink_metadata().is_ok() {
            return Err(exists(path));
        }
        let (work, new) = WorkFolder::make(path).map_err(Failure::report)?;
        // Another process may have made it since.
        if !new && !force {
            return Err(exists(path));
        }
        let names = work.names().map_err(Failure::report)?;
        if !names.is_empty() && !names.iter().any(|name| is_finding(name)) {
            let path = path.display();
            return Err(Failure::usage(format!("{path}: is not the folder of a hunt; name another --out")));
        }
        Self { work, new }.checked()
    }

    /// Makes `hunts/<name>-<number>` with the first free number.
    pub(crate) fn numbered(name: &str) -> Result<Self, Failure> {
        for number in 1..u32::MAX {
            match WorkFolder::make(&Path::new(HUNTS).join(format!("{name}-{number}"))) {
                Ok((work, true)) => return Self { work, new: true }.checked(),
                // Another hunt has it.
                Ok((_, false)) | Err(ReportError::InUse(_) | ReportError::Foreign { .. }) => {}
                Err(error) => return Err(Failure::report(error)),
            }
        }
        Err(Failure::usage(format!("{HUNTS}: every number is taken; name a folder with --out")))
    }

    /// Writes one scenario file for each finding, in place of those of an earlier hunt. Returns their paths.
    pub(crate) fn write(&self, findings: &[Finding]) -> Result<Vec<PathBuf>, Failure> {
        for name in self.work.names().map_err(Failure::report)?.iter().filter(|name| is_finding(name)) {
            self.work.remove(name).map_err(Failure::report)?;
        }
        let files = findings.iter().zip(1..).map(|(finding, number)| {
            let (name, text) = (file_name(number), text(finding));
            self.work.write(&name, text.as_bytes()).map(|()| self.work.path().join(name)).map_err(Failure::report)
        });
        files.collect()
    }

    /// Removes the folder if this process has made it and nothing is in it.
    pub(crate) fn remove_if_empty(self) {
        if self.new {
            // It fails if findings are in it.
            let _ = std::fs::remove_dir(self.work.path());
        }
    }

    /// The folder, if a file can be written into it.
    fn checked(self) -> Result<Self, Failure> {
        let probe = file_name(0);
        match self.work.begin(&probe) {
            Ok(_) => {
                self.work.give_up(&probe);
                Ok(self)
            }
            Err(error) => {
                self.remove_if_empty();
                Err(Failure::report(error))
            }
        }
    }
}

fn file_name(number: usize) -> String {
    format!("finding-{number}.toml")
}

fn is_finding(name: &str) -> bool {
    let number = name.strip_prefix("finding-").and_then(|rest| rest.strip_suffix(".toml"));
    number.is_some_and(|number| number.parse::<usize>().is_ok())
}

/// The scenario of a finding, with what fails in its first line.
fn text(finding: &Finding) -> String {
    let failure = finding.failure;
    let value =
        if failure.value > 0.0 { format!(": {:.3} of the distance to keep", failure.value) } else { String::new() };
    format!("# {}{value}.\n{}", failure.kind.words(), finding.toml)
}

fn exists(path: &Path) -> Failure {
    let path = path.display();
    Failure::usage(format!("{path}: exists; name another --out, or replace the findings in it with --force"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_sweep::hunt::{Failure as Found, FailureKind};

    fn finding(toml: &str) -> Finding {
        let failure = Found { kind: FailureKind::Separation, value: 0.5 };
        Finding { failure, toml: toml.to_owned(), command: None }
    }

    #[test]
    fn only_an_empty_folder_or_that_of_a_hunt_is_replaced() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("deep/out");
        let text = |error: Option<Failure>| error.map(|error| error.to_string()).unwrap_or_default();
        let folder = HuntFolder::at(&path, false).ok().unwrap();
        folder.write(&[finding("a = 1"), finding("b = 1")]).ok().unwrap();
        drop(folder);
        assert!(text(HuntFolder::at(&path, false).err()).contains("out: exists"));
        let folder = HuntFolder::at(&path, true).ok().unwrap();
        let files = folder.write(&[finding("c = 1")]).ok().unwrap();
        assert_eq!(files, [path.join("finding-1.toml")]);
        assert_eq!(folder.work.names().ok(), Some(vec!["finding-1.toml".to_owned()]));
        let read = std::fs::read_to_string(&files[0]).unwrap();
        assert_eq!(read, "# two drones are too close: 0.500 of the distance to keep.\nc = 1");
        std::fs::write(root.path().join("mine.txt"), "").unwrap();
        assert!(text(HuntFolder::at(root.path(), true).err()).contains("is not the folder of a hunt"));
    }

    #[test]
    fn a_folder_without_findings_does_not_stay() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("out");
        HuntFolder::at(&path, false).ok().unwrap().remove_if_empty();
        assert!(!path.exists());
    }
}
