//! Each error of a scenario gives its place, what was found and what was expected.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_scenario::{Scenario, ScenarioErrors, ScenarioSource};

const SOURCE: ScenarioSource<'_> = ScenarioSource { name: "bad.toml", stem: "bad" };

fn parse(text: &str, sets: &[(&str, &str)]) -> Result<Scenario, ScenarioErrors> {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    Scenario::parse(text, SOURCE, &sets)
}

fn errors(text: &str, sets: &[(&str, &str)]) -> String {
    match parse(text, sets) {
        Ok(_) => panic!("accepted: {text} {sets:?}"),
        Err(errors) => errors.to_string(),
    }
}

/// Each text must be rejected with a message that contains all of these parts.
fn assert_rejected(cases: &[(&str, &[&str])]) {
    for (text, wanted) in cases {
        let message = errors(text, &[]);
        for part in *wanted {
            assert!(message.contains(part), "{text:?}: no {part:?} in\n{message}");
        }
    }
}

const BOX: &str = "[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [150, 0]\nhalf_size_m = [5, 50]\n";

#[test]
fn invalid_toml_is_rejected_with_its_place() {
    assert_rejected(&[
        ("", &["bad.toml:1:1: formation: is missing: this table is required"]),
        ("[formation]\ndrones = \n", &["bad.toml:2:"]),
        ("[formation]\ndrones = 8\ndrones = 9\n", &["bad.toml:3:1: TOML syntax: duplicate key"]),
        ("[formation]\n\u{1b}[31m = 1", &["bad.toml:2:1: "]),
    ]);
    assert!(!errors("[formation]\n\"\u{1b}[31m\" = 1", &[]).contains('\u{1b}'));
    let error = Scenario::parse_bytes(b"[formation]\n# \xff\n", SOURCE, &[]).unwrap_err();
    assert_eq!(error.to_string(), "bad.toml:2:3: found byte 0xff, expected UTF-8 text");
    assert!(Scenario::parse_bytes(b"[formation]", SOURCE, &[]).is_ok());
}

#[test]
fn unknown_keys_and_words_come_with_a_suggestion() {
    assert_rejected(&[
        ("[formation]\ndronse = 8", &["bad.toml:2:1: formation.dronse: unknown key", "did you mean `drones`?"]),
        ("[formation]\n[drone]\nspeed = 8", &["bad.toml:3:1: drone.speed: unknown key", "did you mean `speed_mps`?"]),
        ("drones = 8\n[formation]", &["bad.toml:1:1: drones: unknown key", "; it belongs in `[formation]` or "]),
        (
            "[formation]\nseed = 8",
            &["bad.toml:2:1: formation.seed: unknown key", "; it belongs at the top level of the file"],
        ),
        ("[formation]\n[time]\nspeed_mps = 8", &["time.speed_mps: unknown key", "; it belongs in `[drone]`"]),
        (
            "[formation]\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [99, 0]\nradius_m = 3\nhalf_size_m = [1, 1]",
            &["obstacle.0.half_size_m: unknown key", "; it belongs in `[[obstacle]]` with shape = \"rectangle\""],
        ),
        ("[formation]\n[obstacles]", &["obstacles: unknown table", "did you mean `obstacle`?"]),
        ("[formation]\nshape = \"nestedv\"", &["bad.toml:2:9: formation.shape: found \"nestedv\"", "`nested-v`?"]),
        (
            "strategy = \"shortest\"\n[formation]",
            &["bad.toml:1:12: strategy: \"shortest\"", "`shortest-path`?", "fixed:L/R"],
        ),
        ("[formation]\n[[obstacle]]\nshape = \"disc\"", &["obstacle.0.shape: found \"disc\"", "\"circle\""]),
        ("[formation]\n[[obstacle]]\nradius_m = 3", &["bad.toml:2:1: obstacle.0.shape: is missing"]),
        ("[formation]\n[[obstacle]]\nshape = \"circle\"\nradius_m = 3\nside_m = 2", &["obstacle.0.side_m", "centre_m"]),
    ]);
}

#[test]
fn what_is_not_similar_or_not_a_key_there_is_not_suggested() {
    // Each is a little like a key of its own table or of another one.
    let texts =
        ["[formation]\nspam_rate = 3", "[formation]\n[time]\ndrag_coeficient = 1", "[formation]\n[drone]\nweight = 3"];
    for text in texts {
        let message = errors(text, &[]);
        assert!(message.contains("unknown key, expected one of") && !message.contains(';'), "{message}");
    }
}

#[test]
fn wrong_types_and_ranges_are_rejected() {
    assert_rejected(&[
        (
            "[formation]\ndrones = 0",
            &["bad.toml:2:10: formation.drones: found 0, expected a whole number from 1 to 10000"],
        ),
        ("[formation]\ndrones = 1_000_000_000", &["found 1000000000, expected a whole number from 1 to 10000"]),
        (
            "[formation]\ndrones = 99999999999999999999999999999999999999999",
            &["formation.drones: found an integer of too"],
        ),
        ("[formation]\ndrones = 8.0", &["found 8.0, expected a whole number"]),
        ("seed = -1\n[formation]", &["seed: found -1", "9223372036854775807"]),
        (
            "[formation]\nspacing_m = -3",
            &["formation.spacing_m: found -3, expected a number above 0, at most 10000 (m)"],
        ),
        ("[formation]\nspacing_m = nan", &["found NaN"]),
        ("[formation]\nstart_m = [inf, 0]", &["bad.toml:2:12: formation.start_m.0: found inf", "(m)"]),
        ("[formation]\nstart_m = [1]", &["formation.start_m: found an array of 1, expected an array of 2 numbers"]),
        ("[formation]\nspacing_m = \"far\"", &["found \"far\", expected a number"]),
        ("[formation]\n[time]\ndt_s = 0.2", &["time.dt_s: found 0.2, expected a number from 0.0001 to 0.1 (s)"]),
        ("[formation]\n[time]\ndt_s = 2020-01-01", &["found a date or time"]),
        ("[formation]\n[radio]\nloss = 1.5", &["radio.loss: found 1.5, expected a number from 0 to 1"]),
        ("[formation]\n[sensors]\nranging = 1", &["found 1, expected true or false"]),
        ("formation = 3", &["formation: found 3, expected a table"]),
        ("name = \"../x\"\n[formation]", &["name: found \"../x\""]),
        (
            "[formation]\n[[obstacle]]\nshape=\"circle\"\ncentre_m=[99,0]\nradius_m=-1",
            &["obstacle.0.radius_m: found -1"],
        ),
        ("[formation]\n[[obstacle]]\nshape=\"polygon\"\nvertices_m=[[0,0],[1,1]]", &["an array of 3 to 16 arrays"]),
    ]);
    let many = format!("[formation]\n{}", BOX.repeat(1025));
    assert!(errors(&many, &[]).contains("obstacle: found an array of 1025, expected an array of at most 1024 tables"));
}

#[test]
fn broken_rules_between_keys_are_rejected() {
    assert_rejected(&[
        ("[formation]\nspacing_m = 20", &["bad.toml:2:13: formation.spacing_m: found 20 m", "safe_distance_m = 35 m"]),
        (
            "[formation]\n[drone]\nspeed_mps = 25",
            &["drone.speed_mps: found 25 m/s, expected at most drone.speed_max_mps"],
        ),
        (
            "[formation]\n[mission]\nreform_speed_max_mps = 21",
            &["bad.toml:3:24: mission.reform_speed_max_mps: found 21 m/s"],
        ),
        ("[formation]\n[drone]\nspeed_change_mps = 11", &["drone.speed_change_mps: found 11 m/s"]),
        ("[formation]\n[sensors]\ndetection_range_m = 24", &["detection_range_m: found 24 m, expected at least 25 m"]),
        ("[formation]\n[drone]\nreaction_time_s = 2\n[sensors]\ndetection_range_m = 44", &["expected at least 45 m"]),
        ("[formation]\n[avoidance]\nplanning_distance_m = 10", &["avoidance.clearance_m = 15 m"]),
        ("[formation]\n[protocol]\nleader_timeout_s = 0.1", &["protocol.heartbeat_period_s: found 0.2 s"]),
        (
            "[formation]\n[time]\ndt_s = 0.1\n[avoidance]\nclearance_m = 4",
            &["time.dt_s: found 0.1 s", "at most 0.05 s"],
        ),
        ("[formation]\n[mission]\nend = \"goal\"", &["bad.toml:3:7: mission.goal_m: is missing"]),
        ("[formation]\n[mission]\nend = \"time\"", &["bad.toml:3:7: mission.duration_s: is missing"]),
        (
            "[formation]\n[mission]\nend = \"goal\"\ngoal_m = [9, 0]\nparts = \"each\"",
            &[
                "bad.toml:5:9: mission.parts: found mission.parts = \"each\", expected it with mission.end = \"hold\" alone",
            ],
        ),
        (
            "[formation]\n[mission]\nend = \"time\"\nduration_s = 9\n[time]\ntimeout_s = 8",
            &["bad.toml:4:14: mission.duration_s: found 9 s, expected at most time.timeout_s = 8 s"],
        ),
        (
            "strategy = \"fixed:4/4\"\n[formation]",
            &["strategy: found fixed:4/4 with 0 obstacles, expected exactly one"],
        ),
        ("[formation]\noffsets_m = [[0,0],[-9,3]]", &["formation.offsets_m: slots 0 and 1 are 9.48"]),
        (
            "[formation]\nshape = \"v\"\noffsets_m = [[0,0],[-40,3]]",
            &["formation.shape: found both this key and offsets_m"],
        ),
        ("[formation]\nstart_jitter_m = 30", &["formation.start_jitter_m: drones", "apart at the start"]),
    ]);
    let short = format!("strategy = \"fixed:4/3\"\n[formation]\n{BOX}");
    assert_rejected(&[(&short, &["strategy: found fixed:4/3, 7 drones, expected a sum of formation.drones = 8"])]);
    assert!(parse(&short.replace("4/3", "5/3"), &[]).is_ok());
}

#[test]
fn slots_and_obstacles() {
    let near = format!("[formation]\n{}", BOX.replace("150", "12"));
    let message = errors(&near, &[]);
    assert!(
        message.contains("bad.toml:2:1: obstacle.0: start slot 0 at [0.000, 0.000] m is 7 m from it, expected at least avoidance.clearance_m = 15 m"),
        "{message}"
    );
    let inside = format!("[formation]\n{}", BOX.replace("150", "0").replace("[5, 50]", "[15, 50]"));
    assert!(errors(&inside, &[]).contains("start slot 0 at [0.000, 0.000] m is inside it (3 such slots)"));
    let goal = format!("[formation]\n[mission]\nend = \"goal\"\ngoal_m = [160, 0]\n{BOX}");
    assert!(errors(&goal, &[]).contains("obstacle.0: goal slot 0 at [160.000, 0.000] m is 5 m from it"));
    let polygon = |corners: &str| format!("[formation]\n[[obstacle]]\nshape=\"polygon\"\nvertices_m={corners}");
    let star = polygon("[[300,100],[240,-80],[395,30],[205,30],[360,-80]]");
    for bad in [star, polygon("[[200,0],[201,0],[202,0]]"), polygon("[[200,0],[300,0],[220,9],[200,90]]")] {
        assert!(errors(&bad, &[]).contains("bad.toml:4:12: obstacle.0.vertices_m: found corners"));
    }
}

#[test]
fn overrides_are_checked_like_keys_and_named_in_their_errors() {
    let file = format!("[formation]\n{BOX}");
    let cases: &[(&str, &str, &str)] = &[
        ("drone.speed_mps", "fast", "--set drone.speed_mps=fast: drone.speed_mps: found \"fast\", expected a number"),
        ("drone.speed", "3", "--set drone.speed=3: drone.speed: unknown key"),
        ("strategy", "shortest-pth", "--set strategy=shortest-pth: strategy: \"shortest-pth\" is no strategy"),
        ("formation.drones", "1000000000", "--set formation.drones=1000000000: formation.drones: found"),
        ("obstacle.0.centre_m", "[0,0]", "--set obstacle.0.centre_m=[0,0]: obstacle.0: start slot"),
        ("obstacle.1.centre_m", "[0,0]", "obstacle.1.shape: is missing"),
        ("obstacle.2.centre_m", "[0,0]", "found index \"2\", expected a number up to 1: obstacle has 1 entries"),
        ("obstacle.0.centre_m.0.x", "1", "obstacle.0.centre_m.0 is a single value"),
        ("time..dt_s", "1", "expected a key's path"),
        ("avoidance.clearance_m", "19", "--set avoidance.clearance_m=19: sensors.detection_range_m: found 28 m"),
        ("formation", "3", "--set formation=3: formation: found 3, expected a table"),
    ];
    for (key, value, wanted) in cases {
        let file = file.replace("[formation]", "[sensors]\ndetection_range_m = 28\n[formation]");
        let message = errors(&file, &[(key, value)]);
        assert!(message.contains(wanted), "{key}={value}: no {wanted:?} in\n{message}");
    }
    let deep = format!("user{}", ".a".repeat(20_000));
    let message = errors(&file, &[(&deep, "1")]);
    assert!(message.ends_with("expected a key's path of at most 32 steps, found 20001"), "{message}");
    assert!(parse("[formation]", &[(&deep[..66], "1")]).is_ok());
    let offsets = "[formation]\noffsets_m = [[0,0],[-40,0]]";
    assert_eq!(parse(offsets, &[]).unwrap().formation.drones, 2);
    let message = errors(offsets, &[("formation.drones", "3")]);
    assert!(message.contains("--set formation.drones=3: formation.drones: found 3, expected 2"), "{message}");
}

#[test]
fn all_errors_are_collected_in_the_order_of_the_file() {
    let message = errors("[time]\ndt_s = 5\n[radio]\nloss = 2\n[drone]\nspeedy = 1", &[("name", "a b")]);
    let places: Vec<&str> = message.lines().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(places, ["bad.toml:1:1:", "bad.toml:2:8:", "bad.toml:4:8:", "bad.toml:6:1:"]);
}

#[test]
fn the_diagnostic_shows_the_lines_of_the_file() {
    let error = parse("[formation]\ndrones = 0\nspacing_m = -1\n", &[]).unwrap_err();
    let mut shown = String::new();
    miette::NarratableReportHandler::new().render_report(&mut shown, &error).unwrap();
    assert!(shown.contains("snippet line 2: drones = 0") && shown.contains("formation.spacing_m"), "{shown}");
    for text in ["", "[formation", "[formation]\nx = \"\u{9b}\u{7}"] {
        let mut shown = String::new();
        let error = parse(text, &[]).unwrap_err();
        miette::GraphicalReportHandler::new().render_report(&mut shown, &error).unwrap();
        assert!(shown.contains("bad.toml") && !shown.contains(['\u{9b}', '\u{7}']), "{shown}");
    }
}

#[test]
fn after_fifty_errors_the_others_are_counted() {
    let many: String = (0..20_000).map(|i| format!("x{i} = 1\n")).collect();
    let message = errors(&many, &[]);
    assert_eq!(message.lines().count(), 51);
    assert!(message.ends_with("… and 19951 more errors"), "{}", message.lines().last().unwrap_or_default());
}

#[test]
fn a_floor_above_its_top_and_an_altitude_below_the_clearance_are_rejected() {
    let high = format!("[formation]\n{BOX}floor_m = 30\ntop_m = 20\n");
    assert_rejected(&[
        (&high, &["obstacle.0.top_m: found 20 m, expected more than floor_m = 30 m"]),
        (
            "[formation]\naltitude_m = 10",
            &["avoidance.clearance_m", "found 15 m, expected at most formation.altitude_m = 10 m"],
        ),
    ]);
}
