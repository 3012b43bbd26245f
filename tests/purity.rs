//! What a crate may depend on: pure crates know no clock, thread, file or iceoryx2, and dependencies run one way.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use cargo_metadata::{DependencyKind, MetadataCommand, Package};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PURE: [&str; 6] = ["protocol", "leader", "pilot", "agent", "world", "scenario"];

/// The workspace packages that each package may depend on.
const DIRECTIONS: [(&str, &[&str]); 14] = [
    ("skein-protocol", &[]),
    ("skein-leader", &["skein-protocol"]),
    ("skein-pilot", &["skein-protocol"]),
    ("skein-agent", &["skein-leader", "skein-pilot", "skein-protocol"]),
    ("skein-world", &["skein-protocol"]),
    ("skein-scenario", &["skein-protocol", "skein-leader", "skein-agent", "skein-world"]),
    ("skein-bus", &["skein-protocol"]),
    ("skein-report", &["skein-protocol"]),
    (
        "skein-runtime",
        &[
            "skein-protocol",
            "skein-leader",
            "skein-pilot",
            "skein-agent",
            "skein-world",
            "skein-scenario",
            "skein-bus",
            "skein-report",
        ],
    ),
    (
        "skein-sweep",
        &["skein-protocol", "skein-leader", "skein-scenario", "skein-bus", "skein-report", "skein-runtime"],
    ),
    ("skein-reproduce", &["skein-protocol", "skein-scenario", "skein-report", "skein-runtime", "skein-sweep"]),
    (
        "skein-bench",
        &["skein-protocol", "skein-leader", "skein-scenario", "skein-bus", "skein-report", "skein-runtime"],
    ),
    ("skein-hosts", &["skein-protocol", "skein-scenario", "skein-bus", "skein-runtime"]),
    (
        "skein",
        &[
            "skein-protocol",
            "skein-leader",
            "skein-pilot",
            "skein-agent",
            "skein-world",
            "skein-scenario",
            "skein-bus",
            "skein-report",
            "skein-runtime",
            "skein-sweep",
            "skein-reproduce",
            "skein-bench",
        ],
    ),
];

/// Packages that give access to processes, threads, files, clocks, sockets or the system's randomness.
const IMPURE: [&str; 24] = [
    "async-std",
    "chrono",
    "crossbeam",
    "crossbeam-channel",
    "crossbeam-deque",
    "crossbeam-utils",
    "getrandom",
    "ahash",
    "instant",
    "mio",
    "nix",
    "parking_lot",
    "polling",
    "rand",
    "rand_os",
    "rayon",
    "rustix",
    "signal-hook",
    "socket2",
    "tempfile",
    "thread_local",
    "threadpool",
    "tokio",
    "web-time",
];

/// Words that the sources of a pure crate must not contain.
const FORBIDDEN: [&str; 21] = [
    "Instant",
    "SystemTime",
    "UNIX_EPOCH",
    "HashMap",
    "HashSet",
    "RandomState",
    "thread_local!",
    "println!",
    "eprintln!",
    "print!",
    "dbg!",
    "std::thread",
    "std::fs",
    "std::net",
    "std::env",
    "std::process",
    "std::os",
    "File::",
    "iceoryx2",
    "stdout()",
    "stdin()",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The packages of the workspace, examples included.
fn all_packages() -> Vec<Package> {
    let mut command = MetadataCommand::new();
    command.manifest_path(root().join("Cargo.toml")).no_deps().exec().unwrap().packages
}

/// The packages that are published.
fn packages() -> Vec<Package> {
    all_packages().into_iter().filter(|package| package.publish.is_none()).collect()
}

/// All packages that one of ours needs at run time, with its own features only. Procedural macros run in the compiler and do
/// not count.
fn needs(package: &str) -> BTreeSet<String> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["tree", "-p", package, "--all-features", "-e", "normal,no-proc-macro", "--prefix", "none"]);
    let output = command.args(["--format", "{p}", "--locked", "--offline"]).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

#[test]
fn pure_crates_need_nothing_impure() {
    for pure in PURE {
        let all = needs(&format!("skein-{pure}"));
        let impure: Vec<_> = all.iter().filter(|n| n.starts_with("iceoryx2") || IMPURE.contains(&n.as_str())).collect();
        assert!(impure.is_empty(), "{pure} needs {impure:?}");
    }
    // The check finds impure packages where there are some.
    let bus = needs("skein-bus");
    assert!(bus.contains("iceoryx2") && bus.contains("rustix"), "{bus:?}");
}

#[test]
fn dependencies_run_one_way() {
    let packages = packages();
    let members: BTreeSet<&str> = packages.iter().map(|package| package.name.as_str()).collect();
    assert_eq!(members, DIRECTIONS.iter().map(|(name, _)| *name).collect());
    for (of, allowed) in DIRECTIONS {
        let package = packages.iter().find(|package| *package.name == of).unwrap();
        let normal = package.dependencies.iter().filter(|dep| dep.kind == DependencyKind::Normal);
        for dep in normal.filter(|dep| members.contains(dep.name.as_str())) {
            assert!(allowed.contains(&dep.name.as_str()), "{of} names {}", dep.name);
        }
    }
}

/// The example that is made from parts of Skein's own pilot, and the pure crates that it may name for them.
const MADE_OF_PARTS: (&str, [&str; 4]) =
    ("skein-example-antipodal", ["skein-agent", "skein-leader", "skein-protocol", "skein-scenario"]);

#[test]
fn examples_need_nothing_of_skein_but_the_application() {
    let examples: Vec<Package> = all_packages().into_iter().filter(|package| package.publish.is_some()).collect();
    assert!(!examples.is_empty());
    for example in examples {
        let normal = example.dependencies.iter().filter(|dep| dep.kind == DependencyKind::Normal);
        let mut inner: Vec<&str> =
            normal.map(|dep| dep.name.as_str()).filter(|name| name.starts_with("skein-")).collect();
        let (name, parts) = MADE_OF_PARTS;
        inner.retain(|dep| *example.name != name || !parts.contains(dep));
        assert!(inner.is_empty(), "{} names {inner:?}", example.name);
    }
}

#[test]
fn only_the_bus_names_iceoryx2() {
    for package in packages() {
        let names_it = package.dependencies.iter().any(|dep| dep.name.starts_with("iceoryx2"));
        assert_eq!(names_it, *package.name == "skein-bus", "{}", package.name);
    }
}

#[test]
fn the_default_features_are_lean() {
    for package in packages() {
        let default = package.features.get("default").map_or(0, Vec::len);
        assert_eq!(default, 0, "{}: {:?}", package.name, package.features);
    }
}

#[test]
fn every_pure_crate_forbids_what_is_impure_by_clippy() {
    for pure in PURE {
        let path = root().join(pure).join("clippy.toml");
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        for ty in ["collections::HashMap", "collections::HashSet", "time::Instant", "time::SystemTime", "fs::File"] {
            assert!(text.contains(&format!("\"std::{ty}\"")), "{}: std::{ty} is not disallowed", path.display());
        }
        for method in ["thread::spawn", "thread::sleep"] {
            assert!(text.contains(&format!("\"std::{method}\"")), "{}: std::{method}", path.display());
        }
    }
}

/// The code of a source file without comments, and without the tests at its end.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().take_while(|(_, line)| line.trim() != "#[cfg(test)]");
    lines.map(|(number, line)| (number + 1, line.split("//").next().unwrap_or_default()))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let test = path.file_stem().is_some_and(|stem| stem == "tests" || stem == "testing");
        if path.is_dir() {
            sources(&path, found);
        } else if !test && path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn sources_of_pure_crates_name_nothing_impure() {
    for pure in PURE {
        let mut files = Vec::new();
        sources(&root().join(pure).join("src"), &mut files);
        assert!(files.len() > 3, "{pure}: {files:?}");
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            for (number, line) in code(&text) {
                let found = FORBIDDEN.iter().find(|word| line.contains(**word));
                assert!(found.is_none(), "{}:{number}: {}: {line}", file.display(), found.unwrap_or(&""));
            }
        }
    }
}
