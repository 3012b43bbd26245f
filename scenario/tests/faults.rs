//! The keys of faults: what is read, and what is rejected with its place.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_scenario::{Fault, FaultEvent, FaultKind, FaultTarget, Scenario, ScenarioErrors, ScenarioSource};

const HEAD: &str = "[formation]\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [300, 0]\nradius_m = 20\n";
const SOURCE: ScenarioSource<'_> = ScenarioSource { name: "f.toml", stem: "f" };

fn parse(text: &str, sets: &[(&str, &str)]) -> Result<Scenario, ScenarioErrors> {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    Scenario::parse(text, SOURCE, &sets)
}

/// The only fault of a scenario with these lines.
fn fault(lines: &str) -> Fault {
    let scenario = parse(&format!("{HEAD}[[fault]]\n{lines}"), &[]).unwrap_or_else(|errors| panic!("{errors}"));
    scenario.fault_plan[0].clone()
}

#[test]
fn every_kind_is_read_and_survives_json_and_toml() {
    let faults = "[[fault]]\nkind = \"kill\"\nat_s = 12.0\ndrone = 3\n\
        [[fault]]\nkind = \"freeze\"\non = \"queued\"\nafter_s = 1\ntarget = \"leader\"\nfor_s = 2\n\
        [[fault]]\nkind = \"restart\"\non = \"leader-elected\"\nstage = 2\ntarget = \"group-leader:2\"\nfor_s = 2\n\
        [[fault]]\nkind = \"slow\"\nat_s = 1\ndrones = [1, 2]\nreaction_time_s = 0.2\n\
        [[fault]]\nkind = \"deaf\"\nat_s = 1\ntarget = \"random\"\n\
        [[fault]]\nkind = \"mute\"\nat_s = 1\ntarget = \"all\"\n\
        [[fault]]\nkind = \"partition\"\nat_s = 1\nsides = \"halves\"\n\
        [[fault]]\nkind = \"partition\"\nat_s = 1\nsides = [[0, 1], [7]]\nfor_s = 3\n\
        [[fault]]\nkind = \"blind\"\nat_s = 1\ndrone = 0\nsensor = \"ranging\"\n\
        [[fault]]\nkind = \"noise\"\nat_s = 1\ndrone = 0\nposition_bias_m = [1, 0]\n\
        [[fault]]\nkind = \"wind\"\nat_s = 1\ngust_mps2 = 0.2\n\
        [[fault]]\nkind = \"ranging\"\nat_s = 1\ndrone = 0\nranging_dropout_share = 0.5\nranging_std_m = 1\n\
        ranging_latency_s = 0.2\nranging_field_rad = 3\nranging_occlusion = true\n\
        [[fault]]\nkind = \"gnss\"\nat_s = 1\ndrone = 0\nposition_drift_mps = [0.1, 0]\nposition_error_max_m = 2\n\
        [[fault]]\nkind = \"clock\"\nat_s = 1\ndrone = 0\nclock_offset_s = -1\nclock_drift_ppm = 20\n\
        [[fault]]\nkind = \"host-down\"\nat_s = 1\nhost = \"a\"\n\
        [[fault]]\nkind = \"host-cut\"\nat_s = 1\nfor_s = 2\nhost = \"b\"\n\
        [[host]]\nname = \"a\"\ndrones = 2\n[[host]]\nname = \"b\"\ndrones = 1\nconnect = \"tls/10.0.0.2:1\"\n";
    let scenario = parse(&format!("{HEAD}{faults}"), &[]).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scenario.fault_plan.len(), 16);
    assert_eq!(scenario.hosts_of_drones()[1..4], [Some("a".to_owned()), Some("b".to_owned()), None]);
    let json = serde_json::to_value(&scenario).unwrap();
    assert_eq!(Scenario::from_json(&json, SOURCE).unwrap(), scenario);
    assert_eq!(serde_json::from_value::<Scenario>(json).unwrap(), scenario);
    assert_eq!(Scenario::parse(&scenario.to_toml().unwrap(), SOURCE, &[]).unwrap(), scenario);
    let restart = &scenario.fault_plan[2];
    assert_eq!((restart.kind, restart.on, restart.stage), (FaultKind::Restart, Some(FaultEvent::LeaderElected), 2));
    assert_eq!(restart.target.unwrap().to_string(), "group-leader:N2");
    let sides = |index: usize| scenario.fault_plan[index].sides.as_ref().unwrap().of(8);
    assert_eq!(sides(6), [vec![0, 1, 2, 3], vec![4, 5, 6, 7]]);
    assert_eq!(sides(7), [vec![0, 1], vec![7]]);
}

/// What the margins count with is derived from the faults of one drone, unless a key says it.
#[test]
fn the_bounds_of_errors_follow_from_the_faults() {
    let scenario = |lines: &str| parse(&format!("{HEAD}{lines}"), &[]).unwrap_or_else(|errors| panic!("{errors}"));
    let position = |lines: &str| scenario(lines).position_error_max_m();
    let clock = |lines: &str| scenario(lines).clock_error_max_s();
    let bias = |who: &str| format!("[[fault]]\nkind = \"gnss\"\nat_s = 1\nposition_bias_m = [0, 2]\n{who}\n");
    let (one, other) = (bias("drone = 1"), bias("drones = [2, 2]"));
    assert_eq!(position(&one), 2.0);
    assert_eq!(position(&format!("{one}{other}")), 2.0, "different drones");
    assert_eq!(position(&format!("{one}{other}{one}")), 4.0, "one drone has two faults");
    assert_eq!(position(&format!("{one}{}", bias("target = \"leader\""))), 4.0, "that drone may lead");
    let noisy = format!("[sensors]\nposition_std_m = 1\n{one}");
    assert_eq!((position(&noisy), scenario(&noisy).position_noise_max_m()), (5.0, 3.0));
    let given = format!("[sensors]\nposition_std_m = 1\nposition_error_max_m = 4\n{one}");
    let given = scenario(&given);
    assert_eq!((given.position_error_max_m(), given.position_noise_max_m()), (4.0, 3.0));
    assert_eq!(given.position_error_possible_m(), 5.0);
    let drift =
        "[time]\ntimeout_s = 100\n[[fault]]\nkind = \"gnss\"\nat_s = 20\ndrone = 0\nposition_drift_mps = [-0.1, 0]\n";
    assert_eq!(position(drift), 8.0, "up to the time limit");
    assert_eq!(position(&format!("{drift}for_s = 10\n")), 1.0);
    assert_eq!(position(&format!("{drift}position_bias_m = [6, 0]\n")), 6.0, "it drifts past the truth");
    assert_eq!(position(&format!("{drift}position_error_max_m = 3\n")), 3.0);
    let jump = "[time]\ntimeout_s = 100\n[sensors]\nclock_offset_max_s = 0.5\n[[fault]]\nkind = \"clock\"\nat_s = 0\ndrone = 0\n\
        clock_offset_s = -1\nclock_drift_ppm = -10000\n";
    assert_eq!(clock(jump), 2.5);
    assert_eq!(clock(&jump.replace("[sensors]", "[sensors]\nclock_error_max_s = 1")), 1.0);
}

/// One key of ranging is enough for a fault, and any of them leaves the distances of all drones to words.
#[test]
fn each_key_of_ranging_makes_a_fault_and_leaves_the_distances_to_words() {
    let apart_by_words = |text: &str| parse(text, &[]).unwrap_or_else(|errors| panic!("{errors}")).apart_by_words();
    assert!(!apart_by_words(HEAD));
    for key in ["dropout_share = 1", "std_m = 1", "latency_s = 0.5", "field_rad = 3", "occlusion = true"] {
        let fault = format!("{HEAD}[[fault]]\nkind = \"ranging\"\non = \"queued\"\ndrone = 1\nranging_{key}\n");
        assert!(apart_by_words(&fault), "{key}");
    }
}

#[test]
fn overrides_can_make_a_fault() {
    let sets = [("fault.0", "{ kind = \"freeze\", for_s = 2 }"), ("fault.0.target", "leader"), ("fault.0.at_s", "3")];
    let made = parse(HEAD, &sets).unwrap_or_else(|errors| panic!("{errors}")).fault_plan;
    assert_eq!(made, [fault("kind = \"freeze\"\nfor_s = 2\ntarget = \"leader\"\nat_s = 3")]);
    let keys = [("fault.0.kind", "kill"), ("fault.0.drone", "1"), ("fault.0.on", "gate")];
    assert_eq!(parse(HEAD, &keys).unwrap().fault_plan[0].drone, Some(1));
    assert_eq!(fault("kind = \"kill\"\ntarget = \"member\"\nat_s = 3").target, Some(FaultTarget::Member));
    let wrong = parse(HEAD, &[("fault.0.kind", "kil")]).unwrap_err().to_string();
    assert!(
        wrong.contains("--set fault.0.kind=kil: fault.0.kind: found \"kil\"") && wrong.contains("`kill`?"),
        "{wrong}"
    );
}

#[test]
fn an_invalid_fault_is_rejected_with_its_place() {
    let sides = |sides: &str| format!("kind = \"partition\"\nat_s = 1\nsides = {sides}");
    let cases: &[(&str, &str)] = &[
        ("kind = \"kill\"\ndrone = 1", "f.toml:7:8: fault.0.at_s: is missing: expected the time of the fault"),
        ("at_s = 1\ndrone = 1", "f.toml:6:1: fault.0.kind: is missing"),
        ("kind = \"kil\"\nat_s = 1\ndrone = 1", "f.toml:7:8: fault.0.kind: found \"kil\", expected one of \"kill\""),
        (
            "kind = \"kill\"\nat_s = 1\non = \"gate\"\ndrone = 1",
            "f.toml:9:6: fault.0.on: expected either this key or at_s",
        ),
        ("kind = \"kill\"\nat_s = -1\ndrone = 1", "f.toml:8:8: fault.0.at_s: found -1, expected a number from 0"),
        ("kind = \"kill\"\nat_s = 1\nafter_s = 1\ndrone = 1", "f.toml:9:11: fault.0.after_s: needs an event"),
        ("kind = \"kill\"\nat_s = 1\nstage = 1\ndrone = 1", "f.toml:9:9: fault.0.stage: needs an event"),
        (
            "kind = \"kill\"\non = \"gate\"\nstage = 1\ndrone = 1",
            "f.toml:9:9: fault.0.stage: found 1, expected an obstacle set",
        ),
        ("kind = \"kill\"\nat_s = 1", "fault.0.target: is missing: expected the targets of the fault"),
        (
            "kind = \"kill\"\nat_s = 1\ndrone = 1\ntarget = \"all\"",
            "f.toml:10:10: fault.0.target: expected either this key or drone",
        ),
        ("kind = \"kill\"\nat_s = 1\ndrone = 8", "f.toml:9:9: fault.0.drone: found drone 8, expected one from 0 to 7"),
        (
            "kind = \"kill\"\nat_s = 1\ndrones = []",
            "fault.0.drones: found an array of 0, expected an array of 1 to 10000 whole",
        ),
        (
            "kind = \"kill\"\nat_s = 1\ntarget = \"boss\"",
            "f.toml:9:10: fault.0.target: found \"boss\", expected one of \"leader\"",
        ),
        ("kind = \"kill\"\nat_s = 1\ndrone = 1\nfor_s = 1", "fault.0.for_s: does not belong to kind = \"kill\""),
        ("kind = \"freeze\"\nat_s = 1\ndrone = 1", "fault.0.for_s: is missing: kind = \"freeze\" needs for_s"),
        ("kind = \"slow\"\nat_s = 1\ndrone = 1", "fault.0.reaction_time_s: is missing: kind = \"slow\" needs"),
        (
            "kind = \"deaf\"\nat_s = 1\ndrone = 1\nreaction_time_s = 1",
            "belongs to kind = \"slow\", found kind = \"deaf\"",
        ),
        ("kind = \"noise\"\nat_s = 1\ndrone = 1", "kind = \"noise\" needs position_std_m or position_bias_m or"),
        (
            "kind = \"ranging\"\nat_s = 1\ndrone = 1",
            "kind = \"ranging\" needs ranging_dropout_share or ranging_std_m or",
        ),
        (
            "kind = \"gnss\"\nat_s = 1\ndrone = 1\nposition_error_max_m = 1",
            "kind = \"gnss\" needs position_bias_m or position_drift_mps",
        ),
        ("kind = \"clock\"\nat_s = 1\ndrone = 1", "kind = \"clock\" needs clock_offset_s or clock_drift_ppm"),
        (
            "kind = \"clock\"\nat_s = 1\ndrone = 1\nclock_offset_s = 11",
            "f.toml:10:18: fault.0.clock_offset_s: found 11, expected a number from -10 to 10 (s)",
        ),
        (
            "kind = \"ranging\"\nat_s = 1\ndrone = 1\nranging_dropout_share = 1.5",
            "fault.0.ranging_dropout_share: found 1.5, expected a number from 0 to 1",
        ),
        (
            "kind = \"ranging\"\nat_s = 1\ndrone = 1\nranging_latency_s = 10.5",
            "f.toml:10:21: fault.0.ranging_latency_s: found 10.5, expected a number from 0 to 10 (s)",
        ),
        (
            "kind = \"ranging\"\nat_s = 1\ndrone = 1\nranging_field_rad = 0",
            "fault.0.ranging_field_rad: found 0, expected a number above 0, at most 6.283185307179586 (rad)",
        ),
        (
            "kind = \"ranging\"\nat_s = 1\ndrone = 1\nranging_occlusion = 1",
            "fault.0.ranging_occlusion: found 1, expected true or false",
        ),
        (
            "kind = \"blind\"\nat_s = 1\ndrone = 1\nranging_occlusion = true",
            "fault.0.ranging_occlusion: belongs to kind = \"ranging\", found kind = \"blind\"",
        ),
        (
            "kind = \"clock\"\nat_s = 1\ndrone = 1\nclock_offset_s = 1\nposition_bias_m = [1, 0]",
            "fault.0.position_bias_m: belongs to kind = \"noise\" or \"gnss\", found kind = \"clock\"",
        ),
        ("kind = \"host-down\"\nat_s = 1\nhost = \"a\"", "fault.0.host: found \"a\": expected the name of a host, and"),
        (
            "kind = \"host-down\"\nat_s = 1\n[[host]]\nname = \"b\"\ndrones = 8",
            "fault.0.host: is missing: expected the name of a host: b",
        ),
        (
            "kind = \"host-cut\"\nat_s = 1\nhost = \"b\"\n[[host]]\nname = \"b\"\ndrones = 8",
            "fault.0.for_s: is missing: kind = \"host-cut\" needs for_s",
        ),
        (
            "kind = \"host-down\"\nat_s = 1\nhost = \"b\"\ntarget = \"all\"\n[[host]]\nname = \"b\"\ndrones = 8",
            "fault.0.target: does not belong to a fault of a host",
        ),
        ("kind = \"kill\"\nat_s = 1\ndrone = 1\nhost = \"b\"", "fault.0.host: belongs to kind = \"host-down\""),
        (
            "kind = \"kill\"\nat_s = 1\ndrone = 1\n[[host]]\nname = \"b\"\ndrones = 9",
            "f.toml:12:10: host.0.drones: found 9 drones up to this host, expected formation.drones = 8 at most",
        ),
        (
            "kind = \"kill\"\nat_s = 1\ndrone = 1\n[[host]]\nname = \"b/c\"\ndrones = 1",
            "f.toml:11:8: host.0.name: found \"b/c\", expected letters",
        ),
        (
            "kind = \"kill\"\nat_s = 1\ndrone = 1\n[[host]]\nname = \"b\"\ndrones = 1\n[[host]]\nname = \"b\"\ndrones = 1",
            "f.toml:14:8: host.1.name: found \"b\" twice",
        ),
        ("kind = \"wind\"\nat_s = 1", "kind = \"wind\" needs wind_mps2 or gust_mps2"),
        ("kind = \"partition\"\nat_s = 1", "fault.0.sides: is missing"),
        (
            "kind = \"partition\"\nat_s = 1\ntarget = \"all\"\nsides = \"halves\"",
            "fault.0.target: does not belong to a partition",
        ),
        (
            &sides("\"half\""),
            "f.toml:9:9: fault.0.sides: found \"half\", expected \"halves\" or an array of 2 to 15 arrays",
        ),
        (&sides("[[0]]"), "expected an array of 2 to 15 arrays"),
        (&sides("[[0], [9]]"), "fault.0.sides: found drone 9, expected one from 0 to 7"),
        (&sides("[[0], [0]]"), "fault.0.sides: found drone 0 twice"),
        ("kind = \"kill\"\nat_s = 1\ndrone = 1\nfore_s = 1", "fault.0.fore_s: unknown key"),
    ];
    for (lines, wanted) in cases {
        let message = match parse(&format!("{HEAD}[[fault]]\n{lines}"), &[]) {
            Ok(_) => panic!("accepted: {lines}"),
            Err(errors) => errors.to_string(),
        };
        assert!(message.contains(wanted), "{lines:?}: no {wanted:?} in\n{message}");
    }
    let many = "[[fault]]\nkind = \"partition\"\nat_s = 1\nsides = \"halves\"\n".repeat(9);
    let message = parse(&format!("{HEAD}{many}"), &[]).unwrap_err().to_string();
    assert!(message.contains("fault.8.kind: found one more partition, expected at most 8"), "{message}");
}
