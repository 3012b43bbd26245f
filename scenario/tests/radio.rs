//! `[radio]`: presets, keys that override them, rules, and what is rejected.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_protocol::message::Topic;
use skein_protocol::radio::{Burst, BurstScope, ChannelModel, Delay, DelayModel, Link, Radio, Range, SharedChannel};
use skein_protocol::{DroneId, TopicName, Vec3};
use skein_scenario::{Preset, Scenario, ScenarioErrors, ScenarioSource};

const SOURCE: ScenarioSource<'_> = ScenarioSource { name: "r.toml", stem: "r" };

fn try_parse(radio: &str, sets: &[(&str, &str)]) -> Result<Scenario, ScenarioErrors> {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let text = format!("seed = 7\n[formation]\n[radio]\n{radio}");
    Scenario::parse(&text, SOURCE, &sets)
}

fn parse(radio: &str, sets: &[(&str, &str)]) -> Scenario {
    try_parse(radio, sets).unwrap_or_else(|errors| panic!("{errors}"))
}

fn link(source: u32, destination: u32, topic: Topic) -> Link {
    Link { source: DroneId(source), destination: DroneId(destination), topic: topic as u16, sequence: 0 }
}

#[test]
fn every_key_reaches_the_radio_model() {
    let s = parse(
        "delay_s = 0.1\njitter_s = 0.02\ndelay_model = \"gamma\"\nloss = 0.1\nrange_m = 300\nshadowing_db = 4\n\
         path_loss_exponent = 2.5\nduplicate = 0.05\nasymmetry = 0.5\nrate_bps = 1e6\nqueue_limit_s = 0.5\n\
         carrier_sense_m = 700\n\
         burst = { share = 0.2, length_s = 0.3, loss = 0.9, scope = \"link\" }",
        &[],
    );
    let air = ChannelModel {
        delay: Delay { model: DelayModel::Gamma, mean_s: 0.1, jitter_s: 0.02 },
        loss: 0.1,
        burst: Some(Burst { share: 0.2, length_s: 0.3, loss: 0.9, scope: BurstScope::Link }),
        range: Some(Range { half_m: 300.0, shadowing_db: 4.0, exponent: 2.5 }),
        duplicate: 0.05,
    };
    assert_eq!(s.radio(), Radio { seed: 7, channel: air, asymmetry: 0.5, keyed_by_time: false, rules: Vec::new() });
    let channel = SharedChannel { seed: 7, rate_bps: 1e6, limit_s: 0.5, carrier_sense_m: 700.0 };
    assert_eq!(s.channel(), Some(channel));
    let everywhere = parse("rate_bps = 1e6", &[]).channel().map(|channel| channel.carrier_sense_m);
    assert_eq!(everywhere, Some(f64::INFINITY));
}

#[test]
fn a_preset_fills_in_the_keys_that_are_not_written() {
    assert_eq!(parse("preset = \"ideal\"", &[]).radio(), parse("", &[]).radio());
    for name in ["ideal", "wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        let s = parse(&format!("preset = \"{name}\""), &[]);
        let again = Scenario::parse(&s.to_toml().unwrap(), SOURCE, &[]).unwrap();
        assert_eq!(again, s, "the keys of a preset are written out");
        let json = Scenario::from_json(&serde_json::to_value(&s).unwrap(), SOURCE).unwrap();
        assert_eq!(json, s);
    }
    let wifi = parse("preset = \"wifi\"\nloss = 0.5", &[("radio.jitter_s", "0")]);
    assert_eq!((wifi.radio.preset, wifi.radio.loss, wifi.radio.jitter_s), (Some(Preset::Wifi), 0.5, 0.0));
    assert_eq!((wifi.radio.range_m, wifi.radio.delay_s), (Some(300.0), 0.005));
    let jammed = parse("preset = \"jammed\"\nburst.share = 0.9", &[]).radio.burst.unwrap();
    assert_eq!((jammed.share, jammed.length_s, jammed.loss), (0.9, 1.0, 0.95), "a preset also fills in tables");
    let set = parse("", &[("radio.preset", "satellite"), ("radio.delay_s", "1")]);
    assert_eq!((set.radio.delay_s, set.radio.rate_bps), (1.0, Some(256e3)));
}

#[test]
fn the_last_matching_rule_counts_and_inherits_the_rest() {
    let s = parse(
        "loss = 0.1\ndelay_s = 0.2\nburst = { share = 0.5 }\n\
         [[radio.rule]]\ntopics = [\"pose\", \"assignment\"]\nloss = 0.5\nburst = { share = 0 }\n\
         [[radio.rule]]\nfrom = [0, 1]\nto = [2]\ndelay_s = 1",
        &[],
    );
    let radio = s.radio();
    assert!(radio.rules[0].covers(link(0, 1, Topic::Pose)) && !radio.rules[0].covers(link(0, 1, Topic::Plan)));
    assert!(radio.rules[1].covers(link(1, 2, Topic::Plan)));
    assert!(!radio.rules[1].covers(link(2, 1, Topic::Plan)) && !radio.rules[1].covers(link(1, 3, Topic::Plan)));
    let of = |rule: usize| (radio.rules[rule].channel.loss, radio.rules[rule].channel.delay.mean_s);
    assert_eq!((of(0), of(1)), ((0.5, 0.2), (0.1, 1.0)));
    assert_eq!(radio.rules[0].channel.burst.map(|burst| burst.share), Some(0.0));
    assert_eq!(radio.rules[1].channel.burst, radio.channel.burst);
    assert_eq!(Scenario::parse(&s.to_toml().unwrap(), SOURCE, &[]).unwrap(), s);
    // Both rules match this frame. Its delivery is that of the last rule alone.
    let due = radio.outcome(link(0, 2, Topic::Pose), Vec3::zeros(), skein_protocol::SimTime::ZERO);
    let last_rule = Radio { channel: radio.rules[1].channel, rules: Vec::new(), ..radio };
    assert_eq!(due, last_rule.outcome(link(0, 2, Topic::Pose), Vec3::zeros(), skein_protocol::SimTime::ZERO));
}

#[test]
fn a_rule_names_topics_that_pilots_declare() {
    let with = |rule: &str| format!("[[radio.rule]]\n{rule}\n[[pilot]]\ntopics = [\"gossip\"]");
    let radio = parse(&with("topics = [\"gossip\", \"pose\"]\nloss = 1"), &[]).radio();
    let gossip = Link { topic: TopicName::new("gossip").unwrap().kind(), ..link(0, 1, Topic::Pose) };
    assert!(radio.rules[0].covers(gossip) && radio.rules[0].covers(link(0, 1, Topic::Pose)));
    assert!(!radio.rules[0].covers(link(0, 1, Topic::Plan)));
    let message = try_parse(&with("topics = [\"gosip\"]\nloss = 1"), &[]).unwrap_err().to_string();
    assert!(message.starts_with("r.toml:5:11: radio.rule.0.topics.0: found \"gosip\""), "{message}");
    assert!(message.ends_with("; did you mean `gossip`?"), "{message}");
    let message = try_parse("[[pilot]]\ntopics = [\"pose\"]", &[]).unwrap_err().to_string();
    assert!(
        message.contains("r.toml:5:11: pilot.0.topics.0: the topic name \"pose\" is that of a built-in"),
        "{message}"
    );
}

#[test]
fn invalid_keys_are_rejected_with_their_place() {
    let rejected = [
        ("preset = \"wfi\"", "r.toml:4:10: radio.preset: found \"wfi\", expected one of \"ideal\", \"wifi\""),
        ("jitter_s = 0.1", "r.toml:4:12: radio.jitter_s: found 0.1 s, expected 0 s with radio.delay_model = \"fixed\""),
        (
            "delay_s = 0.1\njitter_s = 0.1\ndelay_model = \"uniform\"",
            "r.toml:5:12: radio.jitter_s: found 0.1 s, expected at most radio.delay_s / √3",
        ),
        ("jitter_s = 0.1\ndelay_model = \"gamma\"", "r.toml:4:12: radio.delay_s: found 0 s, expected more than 0 s"),
        ("shadowing_db = 3", "r.toml:4:16: radio.range_m: is missing: radio.shadowing_db = 3 dB"),
        ("shadowing_db = 31", "radio.shadowing_db: found 31, expected a number from 0 to 30 (dB)"),
        ("rate_bps = 0", "radio.rate_bps: found 0, expected a number above 0, at most 1000000000000 (bit/s)"),
        ("burst = { share = 1 }", "r.toml:4:19: radio.burst.share: found 1, expected a number from 0 to 0.99"),
        (
            "burst = { scope = \"all\" }",
            "radio.burst.scope: found \"all\", expected one of \"direction\", \"link\", \"swarm\"",
        ),
        ("burst = 0.3", "radio.burst: found 0.3, expected a table"),
        ("bursts = 0.3", "radio.bursts: unknown key"),
        (
            "[[radio.rule]]\ntopics = [\"poses\"]\nloss = 1",
            "r.toml:5:11: radio.rule.0.topics.0: found \"poses\", expected one of \"pose\"",
        ),
        (
            "[[radio.rule]]\ntopics = []",
            "radio.rule.0.topics: found an array of 0, expected an array of 1 to 16 strings",
        ),
        ("[[radio.rule]]\nto = [0]", "r.toml:4:1: radio.rule.0: sets nothing: expected delay_s"),
        (
            "[[radio.rule]]\nloss = 1\nfrom = [0, 8]",
            "r.toml:6:12: radio.rule.0.from.1: found drone 8, expected one below formation.drones = 8",
        ),
        (
            "[[radio.rule]]\njitter_s = 1",
            "r.toml:5:12: radio.rule.0.jitter_s: found 1 s, expected 0 s with radio.rule.0.delay_model",
        ),
        ("rule = { loss = 1 }", "radio.rule: found a table, expected an array"),
    ];
    for (radio, wanted) in rejected {
        let message = try_parse(radio, &[]).unwrap_err().to_string();
        assert!(message.contains(wanted), "{radio:?}: no {wanted:?} in\n{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    let message = try_parse("preset = \"wifi\"", &[("radio.delay_s", "0")]).unwrap_err().to_string();
    assert!(message.starts_with("--set radio.delay_s=0: radio.delay_s: found 0 s"), "{message}");
}
