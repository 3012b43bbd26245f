//! After any fault, the drones that still fly keep their distances and reach the goal.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::record::{EventKind, Outcome, RecordSink, RecordView, SinkError};
use skein_runtime::{PilotRegistry, inline};
use support::scenario;

/// How a mission ended.
#[derive(Default)]
struct Ending {
    outcome: Option<Outcome>,
    reason: String,
    ticks: usize,
}

impl RecordSink for Ending {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        self.ticks += 1;
        let parse = |line: &[u8]| serde_json::from_slice(line).map_err(|error| error.to_string());
        for event in record.parse_events(parse)? {
            if let EventKind::End { outcome, reason, .. } = event.what {
                (self.outcome, self.reason) = (Some(outcome), reason);
            }
        }
        Ok(())
    }
}

fn fly(name: &str, keys: &[(&str, &str)]) -> Ending {
    let mut ending = Ending::default();
    inline::run(&scenario(name, keys), &PilotRegistry::built_in().unwrap(), &mut ending, || None).unwrap();
    ending
}

/// Flies a mission with each set of faults. All must reach the goal with every distance kept.
fn all_reach_the_goal(name: &str, faults: impl Iterator<Item = Vec<String>>) {
    let mut failed = Vec::new();
    for plan in faults {
        let names: Vec<String> = (0..plan.len()).map(|i| format!("fault.{i}")).collect();
        let keys: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(plan.iter().map(String::as_str)).collect();
        let Ending { outcome, reason, .. } = fly(name, &keys);
        if outcome != Some(Outcome::Reached) {
            failed.push(format!("{plan:?}: {outcome:?}, {reason}"));
        }
    }
    assert!(failed.is_empty(), "{name}, {} failed:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn a_restarted_drone_flies_round_a_dead_body_that_it_never_heard() {
    let kill = r#"{ kind = "kill", at_s = 10, target = "leader" }"#;
    let restart = |at_s: u32| format!(r#"{{ kind = "restart", at_s = {at_s}, for_s = 5, target = "member" }}"#);
    all_reach_the_goal("paper/s2-right", (11..25).step_by(3).map(|at_s| vec![kill.to_owned(), restart(at_s)]));
}

#[test]
fn a_dead_body_in_a_gap_sends_the_queue_behind_it_another_way() {
    let kill = |at_s: u32| vec![format!(r#"{{ kind = "kill", at_s = {at_s}, target = "first-in-queue" }}"#)];
    all_reach_the_goal("narrow/gap", (14..=34).step_by(4).map(kill));
}

#[test]
fn a_drone_behind_one_that_stops_is_not_pushed_into_it_by_the_queue() {
    let kill = vec![r#"{ kind = "kill", at_s = 38, target = "first-in-queue" }"#.to_owned()];
    all_reach_the_goal("paper/forest", std::iter::once(kill));
}

#[test]
fn parts_that_do_not_hear_each_other_keep_their_distance_while_they_re_form() {
    for sides in ["[[0], [1, 2, 3, 4, 5, 6, 7]]", "[[0, 1], [2, 3], [4, 5], [6, 7]]"] {
        let cut = format!(r#"{{ kind = "partition", on = "reforming", after_s = 1, for_s = 10, sides = {sides} }}"#);
        all_reach_the_goal("paper/forest", std::iter::once(vec![cut]));
    }
}

/// The drone that was alone has passed the obstacle and made a formation of its own. When it leads the others again, some of them
/// have still to pass.
#[test]
fn a_drone_that_was_alone_lets_the_others_pass_before_it_re_forms() {
    let cut = r#"{ kind = "partition", on = "queued", after_s = 1, for_s = 30, sides = [[0], [1, 2, 3, 4, 5, 6, 7]] }"#;
    for seed in ["1", "2"] {
        let keys = [("fault.0", cut), ("formation.start_jitter_m", "1"), ("seed", seed)];
        let Ending { outcome, reason, .. } = fly("paper/s1-right", &keys);
        assert_eq!(outcome, Some(Outcome::Reached), "seed {seed}: {reason}");
    }
}

/// A fault that lasts to the end, on the leader and on a member, at three moments.
fn to_the_end(kind: &str) -> impl Iterator<Item = Vec<String>> {
    let moments = ["leader-elected", "queued", "reforming"].into_iter();
    let cells = moments.flat_map(|on| ["leader", "member"].map(|target| (on, target)));
    cells.map(move |(on, target)| {
        vec![format!(r#"{{ kind = "{kind}", on = "{on}", after_s = 1, target = "{target}" }}"#)]
    })
}

#[test]
fn a_drone_that_is_never_heard_again_joins_the_formation() {
    all_reach_the_goal("paper/s2-right", to_the_end("mute"));
    all_reach_the_goal("narrow/door", to_the_end("mute"));
}

#[test]
fn a_drone_that_never_hears_again_gets_the_slot_where_it_is() {
    all_reach_the_goal("paper/s2-right", to_the_end("deaf"));
    all_reach_the_goal("narrow/door", to_the_end("deaf"));
}

#[test]
fn a_drone_that_was_cut_off_leaves_the_way_once_it_hears_the_others_again() {
    let cut = r#"{ kind = "partition", on = "queued", after_s = 1, for_s = 30, sides = [[0], [1, 2, 3, 4, 5, 6, 7]] }"#;
    for seed in ["1", "3", "4"] {
        // By the paper's rule, seeds 1 and 2 end by time-out: docs/faults.md, known failures.
        let look_ahead = ("strategy", "congestion-aware");
        let keys = [look_ahead, ("seed", seed), ("formation.start_jitter_m", "1"), ("fault.0", cut)];
        let Ending { outcome, reason, .. } = fly("paper/s1-right", &keys);
        assert_eq!(outcome, Some(Outcome::Reached), "seed {seed}: {reason}");
    }
}

/// A group leader that plans before it knows how all of its group fly would change the order of the queue. The mission would
/// then take 64 s.
#[test]
fn a_queue_keeps_its_order_while_assignments_are_being_sent() {
    let keys =
        [("seed", "9"), ("formation.start_jitter_m", "5"), ("radio.preset", "\"lte\""), ("time.timeout_s", "58")];
    assert_eq!(fly("paper/s2-right", &keys).outcome, Some(Outcome::Reached));
}

#[test]
fn a_queue_keeps_its_order_when_assignments_are_lost() {
    // On this radio, a burst of loss often costs a group leader the assignment of a member that all others have.
    let ticks = |preset: &str, seed: &str| {
        let keys = [("radio.preset", preset), ("seed", seed), ("formation.start_jitter_m", "5")];
        let ending = fly("paper/s2-right", &keys);
        assert_eq!(ending.outcome, Some(Outcome::Reached));
        ending.ticks as f64
    };
    for seed in ["3", "5", "6", "10"] {
        let (ideal, lte) = (ticks("\"ideal\"", seed), ticks("\"lte\"", seed));
        assert!(lte < 1.05 * ideal, "seed {seed}: {lte} ticks over lte, {ideal} over an ideal radio");
    }
}

/// A drone that stops when those behind it cannot brake yet, and a process that starts while its drone lands.
#[test]
fn a_process_that_ends_early_or_comes_late_breaks_no_distance() {
    let kind = |kind: &str| format!("{{ kind = \"{kind}\", drone = 5, at_s = 0.1, for_s = 3 }}");
    let (freeze, restart) = (kind("freeze"), kind("restart"));
    let kill = r#"{ kind = "kill", drone = 5, at_s = 0.1 }"#.to_owned();
    for fault in [freeze, restart, kill] {
        for ranging in ["true", "false"] {
            let keys = [("fault.0", &*fault), ("sensors.ranging", ranging)];
            let Ending { outcome, reason, .. } = fly("hard/stopped-before-the-first-command", &keys);
            assert_eq!(outcome, Some(Outcome::Reached), "{keys:?}: {reason}");
        }
    }
    let Ending { outcome, reason, .. } = fly("hard/restart-while-landing", &[]);
    assert_eq!(outcome, Some(Outcome::Reached), "{reason}");
}

/// By word alone: two drones at nearly the same time, all drones at once, one drone in a jam, and two drones that do not hear each other.
#[test]
fn restarted_drones_agree_on_lines_again() {
    let all = r#"{ kind = "restart", at_s = 20, for_s = 1, target = "all" }"#;
    let few = [("two-restarts", &[][..]), ("two-restarts", &[("fault.2", all)]), ("restart-in-a-jam", &[])];
    for (name, keys) in few.into_iter().chain([("restarts-out-of-reach", &[][..]), ("all-restarted-at-once", &[])]) {
        let Ending { outcome, reason, .. } = fly(&format!("hard/{name}"), keys);
        assert_eq!(outcome, Some(Outcome::Reached), "{name} {keys:?}: {reason}");
    }
}
