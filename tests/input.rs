//! Bad input ends with exit code 2 and a message that says where it is and what was expected, and starts nothing. Good
//! input gives the files and outputs that scripts rely on.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::{Value, json};
use std::collections::BTreeSet;
use support::{Done, Place, json as read_json, names, paper};

/// A mission without obstacles that ends after two simulated seconds.
const SHORT: &str = "[formation]\nshape = \"v\"\ndrones = 3\nspacing_m = 60\n[time]\ntimeout_s = 2\n";
const BOX: &str = "[[obstacle]]\nshape = \"rectangle\"\nhalf_size_m = [5, 50]\n";

/// The command ended with code 2 and a readable message on stderr alone. It made no process, domain or folder.
fn assert_refused(place: &Place, done: &Done, wanted: &[&str]) {
    assert_eq!(done.code, Some(2), "{done:?}");
    assert_eq!(done.stdout, "", "{done:?}");
    assert!(!done.stderr.contains("panicked") && !done.stderr.contains('\u{1b}'), "{done:?}");
    for part in wanted {
        assert!(done.stderr.contains(part), "no {part:?} in {done:?}");
    }
    place.assert_untouched(done);
}

/// `run` and `check` refuse a file with the same message.
fn refused(content: &[u8], wanted: &[&str]) {
    let place = Place::new();
    std::fs::write(place.join("bad.toml"), content).unwrap();
    for command in ["run", "check"] {
        assert_refused(&place, &place.run(&[command, "bad.toml"]), wanted);
    }
}

#[test]
fn files_that_hold_no_scenario_are_refused() {
    refused(b"", &["bad.toml:1:1: formation: ", "required"]);
    refused(b"\x7fELF\x02\x01\x00\xff\xfe\x00\x80", &["bad.toml:1:", "expected UTF-8 text"]);
    refused(b"[formation\n", &["bad.toml:1:"]);
    refused(b"[formation]\ndrones = 8\ndrones = 9\n", &["bad.toml:3:1: ", "duplicate"]);
    let place = Place::new();
    std::fs::create_dir(place.join("folder.toml")).unwrap();
    assert_refused(&place, &place.run(&["run", "folder.toml"]), &["folder.toml", "directory", "expected"]);
    assert_refused(&place, &place.run(&["run", "missing.toml"]), &["missing.toml does not exist", "expected"]);
    assert_refused(&place, &place.run(&["run", "/dev/zero"]), &["/dev/zero", "expected"]);
}

#[test]
fn what_does_not_exist_or_is_of_another_kind_is_answered_by_what_was_meant() {
    let place = Place::new();
    std::fs::create_dir_all(place.join("scenarios/own")).unwrap();
    std::fs::write(place.join("scenarios/own/short.toml"), SHORT).unwrap();
    std::fs::write(place.join("many.toml"), "scenario = \"random\"\nseeds = 2\n").unwrap();
    let short = "did you mean scenarios/own/short.toml?";
    let cases: [(&[&str], &[&str]); 9] = [
        (&["run", "scenarios/own/shrot.toml"], &["scenarios/own/shrot.toml does not exist", short]),
        (&["check", "short.toml"], &["short.toml does not exist", short]),
        (&["run", "scenario/own/short.toml"], &["the folder scenario does not exist", short]),
        (&["sweep", "mayn.toml"], &["mayn.toml does not exist", "did you mean many.toml?"]),
        (&["run", "many.toml"], &["is an experiment", "`skein sweep many.toml` flies it"]),
        (&["sweep", "scenarios/own/short.toml"], &["is a scenario", "`skein run scenarios/own/short.toml` flies it"]),
        (&["report", "runs/nothing-7"], &["the folder runs does not exist", "expected the folder of a run"]),
        (&["rnu", "many.toml"], &["unrecognized", "'run'"]),
        (&["man", "repotr"], &["`skein` has no command `repotr`", "did you mean `report`?"]),
    ];
    for (args, wanted) in cases {
        assert_refused(&place, &place.run(args), wanted);
    }
}

#[test]
fn keys_and_values_are_named_with_their_place() {
    let cases: [(&str, &[&str]); 12] = [
        (
            "[formation]\nspeed_mps = 8\n",
            &["bad.toml:2:1: formation.speed_mps: unknown key", "it belongs in `[drone]`"],
        ),
        ("[formation]\nseed = 8\n", &["bad.toml:2:1: formation.seed: unknown key", "at the top level of the file"]),
        ("[formation]\ndronse = 8\n", &["bad.toml:2:1: formation.dronse: unknown key", "did you mean `drones`?"]),
        ("[formation]\n[dron]\n", &["bad.toml:2:2: dron: unknown table", "did you mean `drone`?"]),
        ("[formation]\ndrones = \"eight\"\n", &["bad.toml:2:10: formation.drones: ", "expected a whole number"]),
        ("[formation]\nspacing_m = -3\n", &["bad.toml:2:13: formation.spacing_m: found -3", "above 0"]),
        ("[formation]\nspacing_m = nan\n", &["bad.toml:2:13: formation.spacing_m: found NaN", "expected"]),
        ("[formation]\nstart_m = [inf, 0]\n", &["bad.toml:2:12: formation.start_m.0: found inf", "expected"]),
        ("[formation]\ndrones = 0\n", &["bad.toml:2:10: formation.drones: found 0", "from 1"]),
        ("[formation]\ndrones = 1_000_000_000\n", &["bad.toml:2:10: formation.drones: found 1000000000", "expected"]),
        ("[formation]\nspacing_m = 20\n", &["bad.toml:2:13: formation.spacing_m: found 20 m", "safe_distance_m"]),
        ("[formation]\noffsets_m = [[0,0],[0,0]]\n", &["bad.toml:2:13: formation.offsets_m: slots 0 and 1", "apart"]),
    ];
    for (content, wanted) in cases {
        refused(content.as_bytes(), wanted);
    }
}

#[test]
fn obstacles_must_have_a_size_and_keep_clear_of_slots() {
    let negative = "[formation]\n[[obstacle]]\nshape = \"circle\"\ncentre_m = [99, 0]\nradius_m = -1\n";
    refused(negative.as_bytes(), &["bad.toml:5:12: obstacle.0.radius_m: found -1", "expected a number from 0.001"]);
    let around_start = format!("[formation]\n{BOX}centre_m = [0, 0]\n");
    refused(around_start.as_bytes(), &["bad.toml:2:1: obstacle.0: start slot 0 at", "inside"]);
    let at_goal = format!("[formation]\n[mission]\nend = \"goal\"\ngoal_m = [150, 0]\n{BOX}centre_m = [150, 0]\n");
    refused(at_goal.as_bytes(), &["bad.toml:5:1: obstacle.0: goal slot 0 at", "inside"]);
}

#[test]
fn arguments_without_a_meaning_are_refused() {
    let inline = ["--runtime", "inline"];
    let processes = ["expected --runtime processes beside it"];
    for option in
        [["--patience", "1"], ["--drones-per-process", "2"], ["--pin", "off"], ["--wait", "yield"], ["--keys", "k"]]
    {
        let done = Place::new().run(&[&["run", &paper("s2-right")], &inline[..], &option].concat());
        assert_refused(&Place::new(), &done, &[&[option[0]], &processes[..]].concat());
    }
    let cases: [(&[&str], &[&str]); 17] = [
        (&["--clock", "realtime", "--patience", "1"], &["--patience: expected --clock lockstep beside it"]),
        (&["--keys", "keys"], &["--keys: expected --hosts NAME=COUNT or [[host]] beside it"]),
        (&["--connect", "tcp/127.0.0.1:1"], &["--connect: expected --hosts NAME=COUNT or [[host]] beside it"]),
        (&["--set", "drone"], &["--set", "expected key.path=value"]),
        (&["--set", "drone.speed=3"], &["drone.speed: unknown key", "`speed_mps`"]),
        (&["--set", "time.dt_s=soon"], &["--set time.dt_s=soon", "expected a number"]),
        (&["--set", "formation.drones=1000000000"], &["formation.drones: found 1000000000"]),
        (&["--set", "obstacle.0.half_size_m=[-5, 80]"], &["obstacle.0.half_size_m.0: found -5"]),
        (&["--strategy", "shortest"], &["\"shortest\" is no strategy", "`shortest-path`"]),
        (&["--strategy", "fixed:5/5"], &["fixed:5/5, 10 drones", "8"]),
        (&["--strategy", "fixed:4"], &["fixed:4", "fixed:L/R"]),
        (&["--clock", "fast"], &["`fast` is no clock", "`realtime:SPEED`"]),
        (&["--clock", "realtime:-1"], &["--clock", "SPEED from"]),
        (&["--seed", "many"], &["seed", "expected"]),
        (&["--runtime", "threads"], &["threads", "inline"]),
        (&["--force"], &["--out"]),
        (&["--frobnicate"], &["--frobnicate"]),
    ];
    let place = Place::new();
    for (args, wanted) in cases {
        assert_refused(&place, &place.run(&[&["run", &paper("s2-right")], args].concat()), wanted);
    }
    let two = "[formation]\n[[obstacle]]\nshape=\"circle\"\ncentre_m=[200,0]\nradius_m=5\n";
    let two = format!("strategy = \"fixed:4/4\"\n{two}[[obstacle]]\nshape=\"circle\"\ncentre_m=[400,0]\nradius_m=5\n");
    refused(two.as_bytes(), &["fixed:4/4 with 2 obstacles", "expected exactly one"]);
    for args in [&["fly"][..], &["run"], &[], &["schema", "moon"], &["completions", "abacus"]] {
        let done = place.run(args);
        assert_eq!(done.code, Some(2), "{done:?}");
        place.assert_untouched(&done);
    }
}

#[test]
fn an_existing_folder_is_refused_unless_forced() {
    let place = Place::new();
    std::fs::write(place.join("short.toml"), SHORT).unwrap();
    let args = ["run", "short.toml", "--out", "out", "--json"];
    let first = place.run(&args).summary();
    std::fs::write(place.join("out/notes.txt"), "mine").unwrap();
    let before = std::fs::read(place.join("out/summary.json")).unwrap();
    let again = place.run(&args);
    assert_eq!(again.code, Some(2), "{again:?}");
    assert!(again.stderr.contains("out") && again.stderr.contains("--force"), "{again:?}");
    assert_eq!(std::fs::read(place.join("out/summary.json")).unwrap(), before);
    let forced = place.run(&[&args[..], &["--force", "--seed", "9"]].concat()).summary();
    assert_eq!((first["seed"].as_u64(), forced["seed"].as_u64()), (Some(1), Some(9)));
    assert_eq!(read_json(place.join("out/summary.json"))["seed"], 9);
    assert_eq!(std::fs::read(place.join("out/notes.txt")).unwrap(), b"mine", "files of others are left alone");
    std::fs::create_dir(place.join("mine")).unwrap();
    std::fs::write(place.join("mine/summary.json"), "mine").unwrap();
    let done = place.run(&["run", "short.toml", "--out", "mine", "--force"]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert_eq!(std::fs::read(place.join("mine/summary.json")).unwrap(), b"mine");
}

#[test]
fn a_goal_that_is_not_reached_in_time_gives_exit_code_1() {
    let place = Place::new();
    std::fs::write(place.join("short.toml"), SHORT).unwrap();
    for runtime in ["processes", "inline"] {
        let done = place.run(&["run", "short.toml", "--json", "--runtime", runtime]);
        assert_eq!(done.code, Some(1), "{done:?}");
        assert_eq!(done.summary()["outcome"], "timeout");
        assert_eq!(done.summary()["sim_s"], 2.0);
    }
}

#[test]
fn check_prints_the_plan_and_starts_nothing() {
    let place = Place::new();
    let done = place.run(&["check", &paper("s2-right")]);
    assert_eq!(done.code, Some(0), "{done:?}");
    for part in ["s2-right", "launcher, world, 8 drones", "skein/uplink/0", "2 routes"] {
        assert!(done.stdout.contains(part), "no {part:?} in {done:?}");
    }
    place.assert_untouched(&done);
    let plan = place.run(&["check", &paper("s2-right"), "--json", "--set", "formation.drones=8"]).summary();
    assert_eq!(plan["processes"], 10);
    assert_eq!(plan["sets"][0]["routes"], 2);
    place.assert_untouched(&done);
}

#[test]
fn help_version_schemas_completions_and_manual_go_to_stdout() {
    let place = Place::new();
    let version = format!("skein {}", env!("CARGO_PKG_VERSION"));
    let cases: [(&[&str], &str); 10] = [
        (&["--help"], "Exit codes:"),
        (&["run", "--help"], "skein run scenarios/paper/s2-right.toml"),
        (&["check", "--help"], "Example"),
        (&["--version"], &version),
        (&["completions", "bash"], "complete -F _skein"),
        (&["completions", "zsh"], "#compdef skein"),
        (&["man"], ".TH skein 1"),
        (&["man", "run"], ".TH skein-run 1"),
        (&["man", "bench", "runtime"], ".TH skein-bench-runtime 1"),
        (&["schema", "scenario"], "spacing_m"),
    ];
    for (args, wanted) in cases {
        let done = place.run(args);
        assert_eq!((done.code, done.stderr.as_str()), (Some(0), ""), "{done:?}");
        assert!(done.stdout.contains(wanted), "no {wanted:?} in {done:?}");
        place.assert_untouched(&done);
    }
}

#[test]
fn help_into_a_closed_pipe_is_no_error() {
    let place = Place::new();
    for args in [&["--help"][..], &["run", "--help"], &["--version"], &["man", "run"], &["schema", "scenario"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = place.command(args).stdout(writer).output().unwrap();
        assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stderr).as_ref()), (Some(0), ""), "{args:?}");
    }
}

/// The value has every required key, each with a type that the schema allows, and no other key.
fn assert_valid(value: &Value, schema: &Value, root: &Value, at: &str) {
    let name = schema["$ref"].as_str();
    if let Some(pointer) = name.and_then(|name| name.strip_prefix('#')) {
        return assert_valid(value, root.pointer(pointer).unwrap(), root, at);
    }
    if let Some(any) = schema["anyOf"].as_array() {
        let kinds: Vec<_> = any.iter().filter(|kind| (kind["type"] == "null") == value.is_null()).collect();
        return assert_valid(value, kinds.first().unwrap_or_else(|| panic!("{at}: {value}")), root, at);
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let allowed = |word: &Value| word == kind || (kind == "integer" && word == "number");
    let fits = schema["type"].as_array().map_or_else(|| allowed(&schema["type"]), |types| types.iter().any(allowed));
    assert!(fits, "{at}: {value} is no {}", schema["type"]);
    if let Some(words) = schema["enum"].as_array() {
        assert!(words.contains(value), "{at}: {value} is none of {words:?}");
    }
    for (number, item) in value.as_array().into_iter().flatten().enumerate() {
        assert_valid(item, &schema["items"], root, &format!("{at}/{number}"));
    }
    let Some(object) = value.as_object() else { return };
    let others = &schema["additionalProperties"];
    if *others == true || others.is_object() {
        let items = object.iter().filter(|_| others.is_object());
        return items.for_each(|(key, item)| assert_valid(item, others, root, &format!("{at}/{key}")));
    }
    let known = schema["properties"].as_object().unwrap_or_else(|| panic!("{at}: {schema}"));
    for key in schema["required"].as_array().into_iter().flatten() {
        assert!(object.contains_key(key.as_str().unwrap()), "{at}: {key} is missing");
    }
    for (key, item) in object {
        let schema = known.get(key).unwrap_or_else(|| panic!("{at}: {key} is not in the schema"));
        assert_valid(item, schema, root, &format!("{at}/{key}"));
    }
}

#[test]
fn the_summary_follows_its_schema_and_its_contract() {
    let place = Place::new();
    let schema: Value = serde_json::from_str(&place.run(&["schema", "summary"]).stdout).unwrap();
    let flown = place.run(&["run", &paper("s1-right"), "--json"]).summary();
    std::fs::write(place.join("short.toml"), SHORT).unwrap();
    let timeout = place.run(&["run", "short.toml", "--json", "--no-record"]).summary();
    for summary in [&flown, &timeout] {
        assert_valid(summary, &schema, &schema, "");
    }
    let contract = "schema scenario strategy seed runtime clock drones dt_s ticks sim_s realtime_factor \
        agent_steps_per_s wall_s startup_s report_s outcome stages mission_s reform_start_s reform_end_s \
        formation_error_m formation_rmse_m mean_distance_error_m energy_j min_separation_m min_clearance_m min_altitude_m violations \
        metrics elections leaders split_brain_s failover_s messages faults deadline_misses step_us digest";
    let required: BTreeSet<&str> = schema["required"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    for key in contract.split_whitespace() {
        assert!(required.contains(key), "{key} is not required by the schema");
    }
    let stage = &flown["stages"][0];
    for key in ["detected_s", "passed_s", "pass_time_s", "routes", "split", "split_left_right", "predicted_s", "groups"]
    {
        assert!(!stage[key].is_null(), "{key}: {stage}");
    }
    assert_eq!(timeout["stages"], json!([]));
    assert_eq!(timeout["reform_end_s"], Value::Null);
}

#[test]
fn quiet_prints_nothing_and_colour_is_for_terminals() {
    let place = Place::new();
    let scenario = paper("s1-centred");
    let quiet = place.run(&["run", &scenario, "--quiet", "--runtime", "inline"]);
    assert_eq!((quiet.code, quiet.stdout.as_str(), quiet.stderr.as_str()), (Some(0), "", ""));
    let spoken = place.run(&["run", &scenario, "--runtime", "inline"]);
    assert_eq!(spoken.stderr, "", "no progress bar without a terminal");
    for part in ["reached", "runs/s1-centred-2"] {
        assert!(spoken.stdout.contains(part), "no {part:?} in {spoken:?}");
    }
    assert!(!spoken.stdout.contains('\u{1b}'), "{spoken:?}");
}

/// What a command prints on a terminal with these variables; `None` if the machine has no util-linux `script`, which makes one.
fn on_terminal(place: &Place, args: &str, variables: &[(&str, &str)]) -> Option<String> {
    let line = format!("{} {args}", env!("CARGO_BIN_EXE_skein"));
    let mut command = std::process::Command::new("script");
    command.args(["-qec", &line, "/dev/null"]).current_dir(place.join("")).env("TERM", "xterm");
    command.env("XDG_RUNTIME_DIR", place.join("x")).env_remove("NO_COLOR").stdin(std::process::Stdio::null());
    command.envs(variables.iter().copied());
    command.output().ok().map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Only sequences that end in `m` set a colour. Others move the cursor.
fn is_coloured(text: &str) -> bool {
    let mut sequences = text.split("\u{1b}[").skip(1);
    sequences.any(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';').starts_with('m'))
}

#[test]
fn colour_follows_one_rule_on_a_terminal() {
    let place = Place::new();
    std::fs::write(place.join("bad.toml"), "[formation]\ndrones = 0\n").unwrap();
    let run = format!("run {} --runtime inline", paper("s1-centred"));
    let commands = [("--help", "Usage"), ("run --no-such", "error"), ("check bad.toml", "drones"), (&run, "reached")];
    let cases: [(&[(&str, &str)], bool); 5] = [
        (&[], true),
        (&[("NO_COLOR", "")], true),
        (&[("NO_COLOR", "1")], false),
        (&[("TERM", "dumb")], false),
        (&[("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")], false),
    ];
    for ((args, word), (variables, coloured)) in
        commands.into_iter().flat_map(|command| cases.map(|case| (command, case)))
    {
        let Some(text) = on_terminal(&place, args, variables) else {
            return eprintln!("skipped: the command `script` is missing");
        };
        assert!(text.contains(word), "{args} {variables:?}: {text:?}");
        assert_eq!(is_coloured(&text), coloured, "{args} {variables:?}: {text:?}");
    }
}

#[test]
fn a_runs_folder_holds_all_documented_files() {
    let place = Place::new();
    let done = place.run(&["run", &paper("s2-right"), "--json"]);
    let (summary, folder) = (done.summary(), place.join("runs/s2-right-1"));
    let found = names(&folder);
    let promised = ["events.jsonl", "manifest.json", "plots", "processes.json", "report.html", "run.mcap"];
    for file in promised.into_iter().chain(["summary.json", "trace.csv"]) {
        assert!(found.iter().any(|name| name == file), "no {file} in {found:?}");
    }
    assert!(names(folder.join("plots")).iter().any(|name| name.ends_with(".svg")));
    let manifest = read_json(folder.join("manifest.json"));
    assert_eq!(manifest["scenario"]["formation"]["spacing_m"], 65.0);
    for key in ["seed", "strategy", "version", "commit", "platform"] {
        assert!(manifest.get(key).is_some(), "no {key} in {manifest}");
    }
    let trace = std::fs::read_to_string(folder.join("trace.csv")).unwrap();
    let mut lines = trace.lines();
    let header = lines.next().unwrap();
    assert!(header.starts_with("t_s,drone,x_m,y_m,vx_mps,vy_mps,group,leader,energy_j,"), "{header}");
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == header.split(',').count()));
    assert_eq!(rows.len() as u64, 8 * summary["ticks"].as_u64().unwrap(), "one row per drone and tick");
    let last: f64 = rows[rows.len() - 1][0].parse().unwrap();
    assert_eq!(json!(last), summary["sim_s"]);
    let events = std::fs::read_to_string(folder.join("events.jsonl")).unwrap();
    let events: Vec<Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(events.iter().all(|event| event["t_s"].is_f64()), "each with its time");
    assert!(events.windows(2).all(|two| two[0]["t_s"].as_f64() <= two[1]["t_s"].as_f64()), "in order");
    for kind in ["leader", "detected", "grouping", "assigned", "passed", "end"] {
        assert!(events.iter().any(|event| event["event"] == kind), "no event {kind:?}");
    }
}

#[test]
fn without_a_record_only_the_summary_is_written() {
    let place = Place::new();
    std::fs::write(place.join("short.toml"), SHORT).unwrap();
    place.run(&["run", "short.toml", "--no-record", "--quiet", "--out", "out"]);
    assert_eq!(names(place.join("out")), ["manifest.json", "processes.json", "summary.json"]);
    for command in ["report", "view"] {
        let done = place.run(&[command, "out"]);
        assert_eq!(done.code, Some(2), "{done:?}");
        assert!(
            done.stderr.contains("out: has no trace.csv; expected a run that was flown without --no-record"),
            "{done:?}"
        );
    }
    let hunt = place.run(&["hunt", "short.toml", "--flights", "1", "--out", "out"]);
    assert!(hunt.code == Some(2) && hunt.stderr.contains("out: exists"), "{hunt:?}");
    let forced = place.run(&["hunt", "short.toml", "--flights", "1", "--out", "out", "--force"]);
    assert!(forced.code == Some(2) && forced.stderr.contains("out: is not the folder of a hunt"), "{forced:?}");
    let manifest = std::fs::read_to_string(place.join("out/manifest.json")).unwrap();
    assert_eq!(read_json(place.join("out/manifest.json"))["facts"]["end"], "hold");
    let broken = manifest.replacen("\"spacing_m\": 60.0", "\"spacing_m\": -60.0", 1);
    assert_ne!(broken, manifest);
    std::fs::write(place.join("out/manifest.json"), broken).unwrap();
    let replay = place.run(&["replay", "out"]);
    assert_eq!(replay.code, Some(2), "{replay:?}");
    assert!(replay.stderr.contains("out/manifest.json") && replay.stderr.contains("formation.spacing_m"), "{replay:?}");
}

#[test]
fn a_pilots_program_that_is_not_there_is_refused() {
    let pilot = "[[pilot]]\ncommand = [\"no-such-program\", \"x\"]\n";
    refused(format!("{SHORT}{pilot}").as_bytes(), &["bad.toml:8:11: pilot.0.command: \"no-such-program\"", "expected"]);
}

#[test]
fn a_process_that_is_killed_before_the_first_tick_leaves_a_summary() {
    let place = Place::new();
    let pilot = "[[pilot]]\ncommand = [\"sh\", \"-c\", \"kill -9 $$\"]\n";
    std::fs::write(place.join("killed.toml"), format!("{SHORT}{pilot}")).unwrap();
    let done = place.run(&["run", "killed.toml", "--json", "--out", "out"]);
    assert_eq!(done.code, Some(3), "{done:?}");
    assert_eq!((&done.summary()["outcome"], &done.summary()["ticks"]), (&json!("aborted"), &json!(0)));
    assert_eq!(read_json(place.join("out/summary.json"))["outcome"], "aborted");
    // These take long if the folder is made last.
    std::fs::write(place.join("short.toml"), SHORT).unwrap();
    for args in [&["reproduce", "--quick"][..], &["hunt", "short.toml", "--flights", "10000000"]] {
        let nowhere = place.run(&[args, &["--out", "/proc/paper"]].concat());
        assert_eq!(nowhere.code, Some(3), "{nowhere:?}");
    }
}
