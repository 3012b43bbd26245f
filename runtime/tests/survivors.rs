//! Whatever goes wrong, those who still fly keep their distances and get there.
#![allow(clippy::unwrap_used)]

use skein_protocol::record::{EventKind, Outcome, RecordSink, RecordView, SinkError};
use skein_runtime::inline;
use skein_scenario::{Scenario, ScenarioSource};

/// How a mission ended, why, and after how many ticks.
#[derive(Default)]
struct Ending(Option<(Outcome, String)>, usize);

impl RecordSink for Ending {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        self.1 += 1;
        for event in record
            .parse_events(|line| serde_json::from_slice(line))
            .map_err(|error: serde_json::Error| error.to_string())?
        {
            if let EventKind::End { outcome, reason, .. } = event.what {
                self.0 = Some((outcome, reason));
            }
        }
        Ok(())
    }
}

fn fly(name: &str, keys: &[(&str, &str)]) -> (Outcome, String) {
    watch(name, keys).0.unwrap()
}

fn watch(name: &str, keys: &[(&str, &str)]) -> Ending {
    let path = format!("{}/../scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let keys: Vec<(String, String)> = keys.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
    let scenario = Scenario::parse(&text, ScenarioSource { name: &path, stem: "flight" }, &keys).unwrap();
    let mut ending = Ending::default();
    inline::run(&scenario, &mut ending, || None).unwrap();
    ending
}

/// Flies each set of faults; all have to get there safely.
fn all_get_there(name: &str, faults: impl Iterator<Item = Vec<String>>) {
    let mut failed = Vec::new();
    for plan in faults {
        let names: Vec<String> = (0..plan.len()).map(|i| format!("fault.{i}")).collect();
        let keys: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(plan.iter().map(String::as_str)).collect();
        let (outcome, reason) = fly(name, &keys);
        if outcome != Outcome::Reached {
            failed.push(format!("{plan:?}: {outcome:?}, {reason}"));
        }
    }
    assert!(failed.is_empty(), "{name}, {} failed:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn a_newcomer_goes_round_a_body_that_it_never_heard() {
    let kill = r#"{ kind = "kill", at_s = 10, target = "leader" }"#;
    let restart = |at_s: u32| format!(r#"{{ kind = "restart", at_s = {at_s}, for_s = 5, target = "member" }}"#);
    all_get_there("paper/s2-right", (11..25).step_by(3).map(|at_s| vec![kill.to_owned(), restart(at_s)]));
}

#[test]
fn a_body_in_a_gap_sends_the_queue_behind_it_another_way() {
    let kill = |at_s: u32| vec![format!(r#"{{ kind = "kill", at_s = {at_s}, target = "first-in-queue" }}"#)];
    all_get_there("narrow/gap", (14..=34).step_by(4).map(kill));
}

#[test]
fn who_follows_one_that_stops_dead_is_not_pushed_into_it_by_those_behind() {
    let kill = vec![r#"{ kind = "kill", at_s = 38, target = "first-in-queue" }"#.to_owned()];
    all_get_there("paper/forest", std::iter::once(kill));
}

#[test]
fn halves_that_do_not_hear_each_other_keep_their_distance_while_they_re_form() {
    for sides in ["[[0], [1, 2, 3, 4, 5, 6, 7]]", "[[0, 1], [2, 3], [4, 5], [6, 7]]"] {
        let cut = format!(r#"{{ kind = "partition", on = "reforming", after_s = 1, for_s = 10, sides = {sides} }}"#);
        all_get_there("paper/forest", std::iter::once(vec![cut]));
    }
}

/// A fault to the end, to whoever leads and to a member, at three moments.
fn to_the_end(kind: &str) -> impl Iterator<Item = Vec<String>> {
    let moments = ["leader-elected", "queued", "reforming"].into_iter();
    let cells = moments.flat_map(|on| ["leader", "member"].map(|target| (on, target)));
    cells.map(move |(on, target)| {
        vec![format!(r#"{{ kind = "{kind}", on = "{on}", after_s = 1, target = "{target}" }}"#)]
    })
}

#[test]
fn who_is_never_heard_again_joins_the_formation_all_the_same() {
    all_get_there("paper/s2-right", to_the_end("mute"));
    all_get_there("narrow/door", to_the_end("mute"));
}

#[test]
fn who_never_hears_again_is_given_the_place_where_it_stands() {
    all_get_there("paper/s2-right", to_the_end("deaf"));
    all_get_there("narrow/door", to_the_end("deaf"));
}

#[test]
fn who_was_cut_off_does_not_stay_in_the_way_once_it_hears_the_others_again() {
    let cut = r#"{ kind = "partition", on = "queued", after_s = 1, for_s = 30, sides = [[0], [1, 2, 3, 4, 5, 6, 7]] }"#;
    for seed in ["1", "3", "4"] {
        let (outcome, reason) =
            fly("paper/s1-right", &[("seed", seed), ("formation.start_jitter_m", "1"), ("fault.0", cut)]);
        assert_eq!(outcome, Outcome::Reached, "seed {seed}: {reason}");
    }
}

/// Planned anew by a part's leader who does not know yet how all of it fly, the queue would lose its order: 64 s.
#[test]
fn a_queue_keeps_its_order_while_parts_are_on_the_air() {
    let keys =
        [("seed", "9"), ("formation.start_jitter_m", "5"), ("radio.preset", "\"lte\""), ("time.timeout_s", "58")];
    assert_eq!(fly("paper/s2-right", &keys).0, Outcome::Reached);
}

#[test]
fn a_queue_keeps_its_order_though_parts_of_the_plan_are_lost() {
    // Over this radio a burst of loss often takes somebody's part away from the leader of its group alone.
    let ticks = |preset: &str, seed: &str| {
        let keys = [("radio.preset", preset), ("seed", seed), ("formation.start_jitter_m", "5")];
        let Ending(end, ticks) = watch("paper/s2-right", &keys);
        assert_eq!(end.unwrap().0, Outcome::Reached);
        ticks as f64
    };
    for seed in ["3", "5", "6", "10"] {
        let (ideal, lte) = (ticks("\"ideal\"", seed), ticks("\"lte\"", seed));
        assert!(lte < 1.05 * ideal, "seed {seed}: {lte} ticks over lte, {ideal} over an ideal radio");
    }
}
