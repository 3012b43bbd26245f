//! The manifests say what publishing needs, and the dependencies keep the rules of deny.toml: licences, banned crates and
//! sources. `cargo deny` checks these rules too, and more; this test needs neither that program nor the network.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use cargo_metadata::{CargoOpt, Metadata, MetadataCommand, Package};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The only source that deny.toml does not call unknown.
const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn rules() -> toml::Table {
    std::fs::read_to_string(root().join("deny.toml")).unwrap().parse().unwrap()
}

/// The workspace and every package that it needs on this platform.
fn metadata() -> Metadata {
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let options = ["--locked", "--filter-platform", &platform].map(str::to_owned);
    let mut command = MetadataCommand::new();
    command.manifest_path(root().join("Cargo.toml")).features(CargoOpt::AllFeatures).other_options(options);
    command.exec().unwrap()
}

/// Packages from elsewhere.
fn dependencies(metadata: &Metadata) -> impl Iterator<Item = &Package> {
    metadata.packages.iter().filter(|package| !metadata.workspace_members.contains(&package.id))
}

/// The names of all packages that the members of the workspace need, but for what only excluded members need.
fn needed(metadata: &Metadata, excluded: &BTreeSet<&str>) -> BTreeSet<String> {
    let nodes = &metadata.resolve.as_ref().unwrap().nodes;
    let mut open: Vec<_> = metadata.workspace_members.clone();
    let mut found = BTreeSet::new();
    while let Some(id) = open.pop() {
        let name = metadata[&id].name.to_string();
        if !excluded.contains(name.as_str()) && found.insert((id.clone(), name)) {
            open.extend(nodes.iter().find(|node| node.id == id).unwrap().dependencies.iter().cloned());
        }
    }
    found.into_iter().map(|(_, name)| name).collect()
}

/// Whether an SPDX expression permits use under the allowed licences alone. `A/B` is an old form of `A OR B`.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let (allowed, rest) = alternatives(&words, allowed);
    allowed && rest.is_empty()
}

/// Reads `TERM OR TERM …`. Returns whether it is allowed and the words that follow it.
fn alternatives<'w>(words: &'w [&'w str], allowed: &BTreeSet<String>) -> (bool, &'w [&'w str]) {
    let (mut any, mut rest) = all_of(words, allowed);
    while let ["OR", more @ ..] = rest {
        let (next, left) = all_of(more, allowed);
        (any, rest) = (any || next, left);
    }
    (any, rest)
}

/// Reads `LICENCE AND LICENCE …`.
fn all_of<'w>(words: &'w [&'w str], allowed: &BTreeSet<String>) -> (bool, &'w [&'w str]) {
    let (mut all, mut rest) = one(words, allowed);
    while let ["AND", more @ ..] = rest {
        let (next, left) = one(more, allowed);
        (all, rest) = (all && next, left);
    }
    (all, rest)
}

/// Reads a licence, with an exception or without, or an expression in parentheses.
fn one<'w>(words: &'w [&'w str], allowed: &BTreeSet<String>) -> (bool, &'w [&'w str]) {
    match words {
        ["(", inner @ ..] => match alternatives(inner, allowed) {
            (ok, [")", rest @ ..]) => (ok, rest),
            (_, rest) => (false, rest),
        },
        [licence, "WITH", exception, rest @ ..] => (allowed.contains(&format!("{licence} WITH {exception}")), rest),
        [licence, rest @ ..] => (allowed.contains(*licence), rest),
        [] => (false, words),
    }
}

#[test]
fn every_package_says_what_publishing_needs() {
    let metadata = metadata();
    let packages = metadata.workspace_packages();
    let members: BTreeSet<&str> = packages.iter().map(|package| package.name.as_str()).collect();
    // Examples are not published.
    for package in packages.into_iter().filter(|package| package.publish.is_none()) {
        let name = &package.name;
        assert!(package.description.as_ref().is_some_and(|text| text.len() > 20), "{name}: expected a description");
        assert_eq!(package.license.as_deref(), Some("MIT OR Apache-2.0"), "{name}");
        assert!(package.rust_version.is_some(), "{name}: expected the minimum Rust version");
        assert!(package.readme.is_some(), "{name}: expected a readme");
        assert!((1..=5).contains(&package.keywords.len()), "{name}: expected one to five keywords");
        assert!(!package.categories.is_empty(), "{name}: expected a category");
        for dependency in package.dependencies.iter().filter(|dep| members.contains(dep.name.as_str())) {
            assert_ne!(
                dependency.req.to_string(),
                "*",
                "{name}: expected a version of {} beside its path",
                dependency.name
            );
        }
    }
}

#[test]
fn every_dependency_has_an_allowed_licence() {
    let rules = rules();
    let allowed = rules["licenses"]["allow"].as_array().unwrap();
    let allowed: BTreeSet<String> = allowed.iter().map(|licence| licence.as_str().unwrap().to_owned()).collect();
    let metadata = metadata();
    let refused: Vec<String> = dependencies(&metadata)
        .filter(|package| !package.license.as_ref().is_some_and(|licence| is_allowed(licence, &allowed)))
        .map(|package| format!("{} {}: {:?}", package.name, package.version, package.license))
        .collect();
    assert!(refused.is_empty(), "deny.toml allows other licences only: {refused:#?}");
}

#[test]
fn no_dependency_is_banned() {
    let rules = rules();
    let banned: BTreeSet<&str> =
        rules["bans"]["deny"].as_array().unwrap().iter().map(|ban| ban["crate"].as_str().unwrap()).collect();
    let excluded: BTreeSet<&str> =
        rules["graph"]["exclude"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let metadata = metadata();
    let found: Vec<String> = needed(&metadata, &excluded).into_iter().filter(|n| banned.contains(n.as_str())).collect();
    assert!(found.is_empty(), "deny.toml bans {found:?}");
    // The check finds banned packages where there are some.
    let all = needed(&metadata, &BTreeSet::new());
    assert!(
        banned.iter().any(|banned| all.contains(*banned)),
        "deny.toml excludes {excluded:?}, which need nothing banned"
    );
    for package in metadata.workspace_packages() {
        let wildcard = package.dependencies.iter().find(|dep| dep.req.to_string() == "*" && dep.path.is_none());
        assert!(wildcard.is_none(), "{}: expected a version, not `*`: {wildcard:?}", package.name);
    }
}

#[test]
fn every_dependency_comes_from_crates_io() {
    let metadata = metadata();
    for package in dependencies(&metadata) {
        let source = package.source.as_ref().map(ToString::to_string);
        assert_eq!(source.as_deref(), Some(CRATES_IO), "{} {}", package.name, package.version);
    }
}

#[test]
fn expressions_of_licences_are_read_as_spdx_says() {
    let allowed = BTreeSet::from(["MIT", "ISC", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned));
    for expression in
        ["MIT", "MIT OR GPL-3.0", "GPL-3.0/MIT", "(MIT AND ISC) OR GPL-3.0", "Apache-2.0 WITH LLVM-exception"]
    {
        assert!(is_allowed(expression, &allowed), "{expression}");
    }
    for expression in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR ISC) AND GPL-3.0", "Apache-2.0", "MIT MIT"] {
        assert!(!is_allowed(expression, &allowed), "{expression}");
    }
}
