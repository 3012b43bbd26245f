//! Which known word a misspelt one was meant to be.

/// The known word that `found` is most similar to; `None` if none is similar enough. It may have one edit for every three letters (a
/// letter more, less or other, or two swapped ones), or lack an ending, as `speed` lacks that of `speed_mps`.
#[must_use]
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let scored = known.into_iter().filter_map(|word| Some((edits(found, word)?, word)));
    scored.min().map(|(_, word)| word)
}

/// A question for the most similar word, behind a semicolon; empty if none is similar enough.
#[must_use]
pub fn did_you_mean<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(found, known).map(|word| format!("; did you mean `{word}`?")).unwrap_or_default()
}

/// The number of edits that make `found` the word; `None` if the words are not similar.
fn edits(found: &str, word: &str) -> Option<usize> {
    let (found_len, len) = (found.chars().count(), word.chars().count());
    if word.strip_prefix(found).is_some_and(|ending| !found.is_empty() && ending.starts_with(['_', '-'])) {
        return Some(len - found_len);
    }
    let longer = found_len.max(len);
    // As many edits are needed at least. Long texts are not compared.
    if 3 * found_len.abs_diff(len) > longer {
        return None;
    }
    let edits = strsim::damerau_levenshtein(found, word);
    (3 * edits <= longer).then_some(edits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_similar_words_are_suggested() {
        let cases = [
            ("repotr", Some("report")),
            ("rnu", Some("run")),
            ("fly", None),
            ("re", None),
            ("speed", Some("speed_mps")),
            ("speeed_mps", Some("speed_mps")),
            ("", None),
            ("m", None),
        ];
        for (found, wanted) in cases {
            assert_eq!(nearest(found, ["run", "report", "replay", "speed_max_mps", "speed_mps"]), wanted, "{found}");
        }
    }

    #[test]
    fn words_that_only_begin_alike_are_not_suggested() {
        assert_eq!(nearest("spam_rate", ["spacing_m", "speed_mps"]), None);
        assert_eq!(nearest("drone_mass_kg", ["drones", "drag_coefficient"]), None);
        assert_eq!(did_you_mean("drones_max", ["dt_s"]), "");
        assert_eq!(did_you_mean("dronse", ["drones", "shape"]), "; did you mean `drones`?");
    }
}
