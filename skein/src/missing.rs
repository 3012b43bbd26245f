//! What to say of a file or folder that does not exist: which part of its path is missing, and what similar there is.

use skein_scenario::nearest;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Folders in which a file is looked for by its name alone.
const KNOWN: [&str; 4] = ["scenarios", "experiments", "runs", "sweeps"];
/// Depth to which they are searched.
const DEPTH: usize = 3;

/// Describes what is missing of this path, and names something similar; `None` if it exists. `expected` says what belongs
/// there.
pub(crate) fn missing(path: &Path, expected: &str) -> Option<String> {
    let absent = first_absent(path)?;
    let mut text = match absent == path {
        true => format!("{} does not exist", path.display()),
        false => format!("{}: the folder {} does not exist", path.display(), absent.display()),
    };
    let found = similar(path).or_else(|| by_name(path));
    // Writing to a String cannot fail.
    let _ = match found {
        Some(found) => write!(text, "; did you mean {}?", found.display()),
        None => write!(text, "; {expected}"),
    };
    Some(text)
}

/// The shortest beginning of the path that does not exist.
fn first_absent(path: &Path) -> Option<&Path> {
    let mut beginnings: Vec<&Path> = path.ancestors().filter(|part| !part.as_os_str().is_empty()).collect();
    beginnings.reverse();
    beginnings.into_iter().find(|part| part.symlink_metadata().is_err())
}

/// The path with each missing part replaced by the most similar name in its folder.
fn similar(path: &Path) -> Option<PathBuf> {
    let mut found = PathBuf::new();
    for part in path.components() {
        let next = found.join(part);
        if next.symlink_metadata().is_ok() {
            found = next;
            continue;
        }
        let names = names(&found);
        found.push(nearest(part.as_os_str().to_str()?, names.iter().map(String::as_str))?);
    }
    Some(found)
}

/// A file or folder of this name in one of the known folders, with or without its extension.
fn by_name(path: &Path) -> Option<PathBuf> {
    let stem = path.file_stem()?;
    KNOWN.iter().find_map(|folder| find(Path::new(folder), stem, DEPTH))
}

fn find(folder: &Path, stem: &std::ffi::OsStr, depth: usize) -> Option<PathBuf> {
    let paths: Vec<PathBuf> = names(folder).into_iter().map(|name| folder.join(name)).collect();
    let here = paths.iter().find(|path| path.file_stem() == Some(stem)).cloned();
    here.or_else(|| match depth {
        0 => None,
        // Links are not followed: they may lead in circles.
        _ => {
            paths.iter().filter(|path| path.is_dir() && !path.is_symlink()).find_map(|path| find(path, stem, depth - 1))
        }
    })
}

/// The names in a folder, sorted; none if it cannot be read.
fn names(folder: &Path) -> Vec<String> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort_unstable();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_path_is_answered_by_a_similar_one() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("scenarios/paper")).unwrap();
        std::fs::write(at("scenarios/paper/s2-right.toml"), "").unwrap();
        assert_eq!(missing(&at("scenarios/paper/s2-right.toml"), "expected a file"), None);
        for wrong in ["scenarios/paper/s2-rihgt.toml", "scenario/paper/s2-right.toml"] {
            let text = missing(&at(wrong), "expected a file").unwrap();
            assert!(text.contains("does not exist; did you mean"), "{text}");
            assert!(text.ends_with(&format!("{}?", at("scenarios/paper/s2-right.toml").display())), "{text}");
        }
        let text = missing(&at("scenario/paper/s2-right.toml"), "").unwrap();
        assert!(text.contains(&format!("the folder {} does not exist", at("scenario").display())), "{text}");
        let text = missing(&at("quite-another"), "expected a file").unwrap();
        assert!(text.ends_with("quite-another does not exist; expected a file"), "{text}");
    }
}
