//! `[[pilot]]` and `[user]`: who flies what, and what is refused.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_scenario::{Scenario, ScenarioSource};

fn parse(text: &str, sets: &[(&str, &str)]) -> Result<Scenario, String> {
    let sets: Vec<_> = sets.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    let source = ScenarioSource { name: "m.toml", stem: "m" };
    Scenario::parse(text, source, &sets).map_err(|errors| errors.to_string())
}

const MIXED: &str = r#"
[formation]
drones = 5
[[pilot]]
name = "boids"
params = { k = 8, gains = [1, 2.5], deep = { on = true, word = "x" } }
[[pilot]]
command = ["python3", "flock.py", "--fast"]
drones = [1, 3]
[user]
colour = "blue"
"#;

#[test]
fn each_drone_has_the_pilot_that_names_it_or_the_one_for_the_rest() {
    let scenario = parse(MIXED, &[]).unwrap();
    assert_eq!(scenario.pilot_tables(), [Some(0), Some(1), Some(0), Some(1), Some(0)]);
    let names: Vec<&str> = scenario.pilots.iter().map(skein_scenario::PilotKeys::shown_name).collect();
    assert_eq!(names, ["boids", "flock"]);
    assert_eq!(scenario.pilots[0].params["gains"], serde_json::json!([1, 2.5]));
    assert_eq!(scenario.user["colour"], "blue");
    let again = parse(&scenario.to_toml().unwrap(), &[]).unwrap();
    assert_eq!(again, scenario);
    let source = ScenarioSource { name: "m", stem: "m" };
    assert_eq!(Scenario::from_json(&serde_json::to_value(&scenario).unwrap(), source).unwrap(), scenario);
    let bare = parse("[formation]\ndrones = 2", &[]).unwrap();
    assert_eq!(bare.pilot_tables(), [None, None]);
}

#[test]
fn a_pilot_and_its_parameters_can_be_set_on_the_command_line() {
    let set = [("pilot.0.name", "boids"), ("pilot.0.params.k", "3")];
    let scenario = parse("[formation]\ndrones = 2", &set).unwrap();
    assert_eq!((scenario.pilots[0].shown_name(), &scenario.pilots[0].params["k"]), ("boids", &serde_json::json!(3)));
}

#[test]
fn wrong_pilots_are_refused_with_their_place() {
    let of = |tables: &str| parse(&format!("[formation]\ndrones = 3\n{tables}"), &[]).unwrap_err();
    let twice = of("[[pilot]]\ndrones = [0, 1]\n[[pilot]]\ndrones = [1]\n");
    assert_eq!(twice, "m.toml:6:11: pilot.1.drones.0: found drone 1, which pilot.0 flies already");
    let rests = of("[[pilot]]\n[[pilot]]\nname = \"cruise\"\n");
    assert!(rests.contains("pilot.1.drones: is missing: pilot.0 flies all drones"), "{rests}");
    let high = of("[[pilot]]\ndrones = [3]\n");
    assert!(high.contains("found drone 3, expected one below formation.drones = 3"), "{high}");
    assert!(of("[[pilot]]\nname = \"a b\"\n").contains("expected letters, digits"));
    assert!(of("[[pilot]]\nparams = 3\n").contains("pilot.0.params: found 3, expected a table"));
    assert!(of("[[pilot]]\nparams = { at = 1979-05-27 }\n").contains("pilot.0.params.at: found a date or time"));
    assert!(of("[[pilot]]\nparam = {}\n").contains("did you mean `params`?"));
    assert!(of("[[pilot]]\ncommand = [\"\"]\n").contains("pilot.0.command.0: found an empty word"));
}

#[test]
fn what_a_pilot_refuses_is_shown_where_it_is_written() {
    let source = ScenarioSource { name: "m.toml", stem: "m" };
    let keys = ["pilot.0.params.k".to_owned()];
    let errors = Scenario::blame(MIXED, source, &[], &keys, "expected a number from 0");
    assert_eq!(errors.to_string(), "m.toml:6:16: pilot.0.params.k: expected a number from 0");
    let set = [("pilot.0.params.k".to_owned(), "-1".to_owned())];
    let errors = Scenario::blame(MIXED, source, &set, &keys, "expected a number from 0");
    assert_eq!(errors.to_string(), "--set pilot.0.params.k=-1: pilot.0.params.k: expected a number from 0");
}
