//! With every radio model, both runtimes give the same digest, and the summary counts what was received.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use support::{Place, number, paper};

/// Flies S2 with this `[radio]` for ten seconds, until after the first plans.
fn fly(place: &Place, runtime: &str, radio: &str) -> Value {
    let scenario = std::fs::read_to_string(paper("s2-right")).unwrap();
    let file = place.join("s2-radio.toml");
    std::fs::write(&file, format!("{scenario}\n[time]\ntimeout_s = 10\n[radio]\n{radio}")).unwrap();
    let done = place.run(&["run", file.to_str().unwrap(), "--json", "--no-record", "--runtime", runtime]);
    assert_eq!(done.code, Some(1), "its time runs out: {done:?}");
    done.summary()
}

/// Flies in both runtimes and asserts that the digests are equal. Returns the summary.
fn same(radio: &str) -> Value {
    let [processes, inline] = ["processes", "inline"].map(|runtime| fly(&Place::new(), runtime, radio));
    for key in ["digest", "ticks", "energy_j", "messages"] {
        assert_eq!(processes[key], inline[key], "{key} over\n{radio}");
    }
    inline
}

#[test]
fn every_model_gives_one_digest_in_both_runtimes() {
    let radios = [
        "",
        "delay_s = 0.1\njitter_s = 0.05\ndelay_model = \"uniform\"",
        "delay_s = 0.1\njitter_s = 0.1\ndelay_model = \"normal\"",
        "delay_s = 0.1\njitter_s = 0.1\ndelay_model = \"gamma\"",
        "burst = { share = 0.2, length_s = 0.3 }",
        "burst = { share = 0.2, length_s = 0.3, scope = \"link\" }",
        "burst = { share = 0.2, length_s = 0.3, scope = \"swarm\", loss = 0.8 }",
        "range_m = 150",
        "range_m = 150\nshadowing_db = 6",
        "loss = 0.2\nasymmetry = 2",
        "duplicate = 0.3\ndelay_s = 0.05\njitter_s = 0.02\ndelay_model = \"gamma\"",
        "rate_bps = 80e3\nqueue_limit_s = 0.1",
        "[[radio.rule]]\ntopics = [\"pose\"]\nloss = 0.3\n[[radio.rule]]\nfrom = [0]\nto = [1, 2]\ndelay_s = 0.2",
    ];
    let mut digests: Vec<String> = radios.iter().map(|radio| same(radio)["digest"].to_string()).collect();
    digests.sort();
    digests.dedup();
    assert_eq!(digests.len(), radios.len(), "each of them is another flight");
}

#[test]
fn every_preset_gives_one_digest_in_both_runtimes() {
    for preset in ["wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        same(&format!("preset = \"{preset}\""));
    }
    let ideal = fly(&Place::new(), "inline", "preset = \"ideal\"");
    assert_eq!(ideal["digest"], fly(&Place::new(), "inline", "")["digest"]);
}

#[test]
fn the_summary_counts_drops_by_reason_and_duplicates_apart() {
    let place = Place::new();
    let twice = fly(&place, "inline", "duplicate = 1");
    let ideal = fly(&place, "inline", "");
    let [sent, delivered, duplicates] =
        ["sent", "delivered", "duplicates"].map(|key| number(&twice, &format!("/messages/{key}")));
    assert_eq!(delivered, duplicates, "each is heard twice, and counted once as delivered");
    assert!(delivered <= 7.0 * sent, "{delivered} of {sent}");
    assert_eq!(number(&ideal, "/messages/duplicates"), 0.0);
    let narrow = fly(&place, "inline", "rate_bps = 60e3\nqueue_limit_s = 0.1");
    let [sent, delivered, queue] =
        ["sent", "delivered", "dropped/queue"].map(|key| number(&narrow, &format!("/messages/{key}")));
    assert!(queue > 0.0 && delivered + queue <= 7.0 * sent, "{narrow}");
    assert!(number(&narrow, "/messages/delay_s/max") <= 0.1 + 0.1, "limit, own time on the channel, and two ticks");
}
