//! No text causes a panic in the reader of scenarios, and each error has a place. `PROPTEST_CASES` sets the number of cases.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]
#![allow(clippy::disallowed_methods, reason = "the texts are files")]

use proptest::prelude::*;
use skein_scenario::{Scenario, ScenarioSource};
use std::fs;
use std::path::{Path, PathBuf};

const SOURCE: ScenarioSource<'_> = ScenarioSource { name: "bad.toml", stem: "bad" };

/// The texts of all scenarios of the repository.
fn texts() -> Vec<String> {
    fn add(folder: PathBuf, texts: &mut Vec<String>) {
        let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                add(path, texts);
            } else if path.extension().is_some_and(|end| end == "toml") {
                texts.push(fs::read_to_string(path).unwrap());
            }
        }
    }
    let mut texts = Vec::new();
    add(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios"), &mut texts);
    assert!(!texts.is_empty());
    texts
}

/// Something to put into a text in the place of a word.
fn piece() -> impl Strategy<Value = String> {
    let words = [
        "",
        "0",
        "-1",
        "1e308",
        "-1e308",
        "5e-324",
        "nan",
        "inf",
        "-inf",
        "9223372036854775807",
        "4294967296",
        "true",
        "\"\"",
        "[]",
        "[[]]",
        "{}",
        "[0, 0]",
        "[nan, nan]",
        "[1e308, -1e308]",
        "\"\\u0000\"",
        "\n[[obstacle]]\n",
        "\n[[fault]]\n",
        "\n[[pilot]]\n",
        "\n[radio]\n",
        "=",
        ".",
        "\"shortest-path\"",
        "\"fixed:0/0\"",
        "\"fixed:99999999999/1\"",
        "1979-05-27",
    ];
    prop_oneof![
        6 => prop::sample::select(words.to_vec()).prop_map(str::to_owned),
        1 => any::<f64>().prop_map(|value| format!("{value:?}")),
        1 => any::<i64>().prop_map(|value| value.to_string()),
        1 => "\\PC{0,6}",
    ]
}

/// The text with words replaced. A word ends at white space.
fn changed(text: &str, changes: &[(prop::sample::Index, String)]) -> String {
    let mut words: Vec<String> = text.split_inclusive(char::is_whitespace).map(str::to_owned).collect();
    for (place, piece) in changes {
        let place = place.index(words.len());
        let end = words[place].chars().last().filter(|letter| letter.is_whitespace()).unwrap_or('\n');
        words[place] = format!("{piece}{end}");
    }
    words.concat()
}

proptest! {
    #[test]
    fn scenarios(
        text in prop::sample::select(texts()),
        changes in prop::collection::vec((any::<prop::sample::Index>(), piece()), 0..5),
    ) {
        let text = changed(&text, &changes);
        if let Err(errors) = Scenario::parse_bytes(text.as_bytes(), SOURCE, &[]) {
            let text = errors.to_string();
            prop_assert!(text.starts_with("bad.toml:"), "{text}");
            prop_assert!(!text.contains(|letter: char| letter.is_control() && letter != '\n'), "{text:?}");
        }
    }

    #[test]
    fn settings(key in "[a-z_.0-9\\[\\]\"]{0,24}", value in piece()) {
        let _ = Scenario::parse_bytes(texts()[0].as_bytes(), SOURCE, &[(key, value)]);
    }

    #[test]
    fn bytes(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Scenario::parse_bytes(&bytes, SOURCE, &[]).is_err());
    }
}
