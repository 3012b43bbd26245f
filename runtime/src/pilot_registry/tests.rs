use super::*;
use skein_pilot::{Command, Inbox, Out, Senses};
use skein_scenario::ScenarioSource;

struct Still;

impl Pilot for Still {
    fn step(&mut self, _: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        Command::default()
    }
}

fn registry() -> PilotRegistry {
    let mut registry = PilotRegistry::built_in().unwrap();
    registry.register("still", |birth| match birth.params.get_f64("k", 1.0)? {
        k if k > 100.0 => panic!("k is {k}"),
        k if k < 0.0 => Err(PilotError::of_param("k", "expected a number from 0")),
        _ => Ok(Box::new(Still)),
    });
    registry
}

fn problem(tables: &str, inline: bool) -> Result<(), String> {
    let source = ScenarioSource { name: "m", stem: "m" };
    let scenario = Scenario::parse(&format!("[formation]\ndrones = 3\n{tables}"), source, &[]).unwrap();
    registry().check(&scenario, inline).map_err(|problem| problem.to_string())
}

#[test]
fn a_scenario_is_checked_by_its_pilots() {
    assert_eq!(problem("", true), Ok(()));
    assert_eq!(problem("[[pilot]]\nname = \"still\"\n[[pilot]]\nname = \"cruise\"\ndrones = [1]\n", true), Ok(()));
    let unknown = problem("[[pilot]]\nname = \"stil\"\n", true).unwrap_err();
    assert!(
        unknown.starts_with("pilot.0.name: found \"stil\", expected one of \"cruise\", \"paper\", \"still\""),
        "{unknown}"
    );
    assert!(unknown.ends_with("; did you mean `still`?"), "{unknown}");
    let low = problem("[[pilot]]\nname = \"still\"\nparams = { k = -1 }\n", true).unwrap_err();
    assert_eq!(low, "pilot.0.params.k: expected a number from 0 (pilot \"still\")");
    let panics = problem("[[pilot]]\nname = \"still\"\nparams = { k = 101 }\n", true).unwrap_err();
    assert!(panics.contains("panicked at ") && panics.contains("k is 101"), "{panics}");
    let cruise = problem("[[pilot]]\nname = \"cruise\"\nparams = { speed = 1 }\n", true).unwrap_err();
    assert!(cruise.starts_with("pilot.0.params.speed: unknown field"), "{cruise}");
    assert!(problem("[[pilot]]\nparams = { k = 1 }\n", true).unwrap_err().contains("expected no parameters"));
}

#[test]
fn a_program_of_its_own_cannot_fly_inline() {
    let command = "[[pilot]]\ncommand = [\"python3\", \"x.py\"]\n";
    assert_eq!(problem(command, false), Ok(()));
    assert!(problem(command, true).unwrap_err().contains("pilot.0.command: a program of its own cannot fly inline"));
}

#[test]
fn the_entries_name_drones_and_programs() {
    let source = ScenarioSource { name: "m", stem: "m" };
    let text = "[formation]\ndrones = 3\n[[pilot]]\nname = \"still\"\ndrones = [1]\nparams = { k = 2 }\n";
    let entries = registry().entries(&Scenario::parse(text, source, &[]).unwrap()).unwrap();
    let drones: Vec<_> = entries.iter().map(|entry| (entry.name.as_str(), entry.drones.clone())).collect();
    assert_eq!(drones, [("still", vec![1]), ("paper", vec![0, 2])]);
    assert!(entries[0].program.as_ref().is_some_and(|hash| hash.len() == 16) && entries[1].program.is_none());
}
