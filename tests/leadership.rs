//! Leaders that die, hang, are cut off and come back, in real processes: the survivors are led again, the mission ends in
//! formation, and both runtimes agree to the bit.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use support::Place;

/// One story: what happens, in which scenario, and who leads the swarm in the end, if that is told.
struct Story {
    name: &'static str,
    scenario: &'static str,
    faults: &'static str,
    elections: usize,
    /// What the dead do: one that hovers in the gap shuts it for good.
    failsafe: &'static str,
}

const STORIES: [Story; 9] = [
    Story {
        name: "kill-leader",
        scenario: "s2-right",
        faults: "{kind='kill', at_s=3, target='leader'}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "kill-while-deciding",
        scenario: "s2-right",
        faults: "{kind='kill', on='detected', target='leader'}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "kill-leader-and-successor",
        scenario: "s2-right",
        faults: "{kind='kill', at_s=3, target='leader'}, {kind='kill', at_s=4.6, target='leader'}",
        elections: 3,
        failsafe: "hover",
    },
    Story {
        name: "freeze-and-wake",
        scenario: "s2-right",
        faults: "{kind='freeze', at_s=3, target='leader', for_s=5}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "partition-and-heal",
        scenario: "s2-right",
        faults: "{kind='partition', at_s=2, sides=[[0, 1, 2, 3], [4, 5, 6, 7]], for_s=3}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "restart",
        scenario: "s2-right",
        faults: "{kind='restart', at_s=2, target='leader', for_s=1}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "blind-leader",
        scenario: "s2-right",
        faults: "{kind='blind', at_s=2, target='leader', for_s=6}",
        elections: 2,
        failsafe: "hover",
    },
    Story {
        name: "kill-group-leader-in-the-gap",
        scenario: "forest",
        faults: "{kind='kill', at_s=74, target='group-leader:N12'}",
        elections: 4,
        failsafe: "land",
    },
    Story {
        name: "leader-while-splitting-one-in-the-queue-and-back",
        scenario: "s2-right",
        faults: "{kind='restart', on='grouped', target='leader', for_s=8}, {kind='kill', on='queued', after_s=2, drone=5}",
        elections: 2,
        failsafe: "hover",
    },
];

fn args(story: &Story, runtime: &str, clock: &str, out: &str) -> Vec<String> {
    let faults = format!("fault=[{}]", story.faults.replace('\'', "\""));
    let failsafe = format!("faults.failsafe=\"{}\"", story.failsafe);
    let scenario = support::paper(story.scenario);
    let words = ["run", &scenario, "--json", "--no-record", "--strategy", "congestion-aware-paper", "--out", out];
    // Two bodies that hover right before the swarm make a long mission.
    let time = "time.timeout_s=300";
    let rest = ["--clock", clock, "--runtime", runtime, "--set", &faults, "--set", &failsafe, "--set", time];
    words.into_iter().chain(rest).map(str::to_owned).collect()
}

fn fly(place: &Place, story: &Story, runtime: &str, clock: &str) -> Value {
    let args = args(story, runtime, clock, &format!("{}-{runtime}", story.name));
    let done = place.run(&args.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(done.code, Some(0), "{done:?}");
    done.summary()
}

/// Reached and safe is what code 0 says; here: led again, and together.
fn assert_led(story: &Story, summary: &Value) {
    let elections = summary["elections"].as_u64().unwrap() as usize;
    assert!(elections >= story.elections, "{}: {elections} elections", story.name);
    assert_eq!(summary["leaders"].as_array().unwrap().last().unwrap()["group"], "N", "{}", story.name);
    assert!(summary["formation_error_m"].as_f64().unwrap() <= 0.8, "{}", story.name);
    let fires = summary["faults"].as_array().unwrap().iter().filter(|fault| fault["scheduled"] == true).count();
    assert_eq!(fires, story.faults.matches("kind=").count(), "{}: {}", story.name, summary["faults"]);
}

/// A leader that does not see any more is followed by another one at once, and nobody has died.
fn assert_handed_over(summary: &Value) {
    let leaders = summary["leaders"].as_array().unwrap();
    let (blind, heir) = (&leaders[0], &leaders[1]);
    assert!(heir["group"] == "N" && heir["leader"] != blind["leader"], "{leaders:?}");
    assert!((2.0..2.3).contains(&heir["t_s"].as_f64().unwrap()), "{leaders:?}");
    assert_eq!(summary["failover_s"].as_array().unwrap().len(), 0);
    let while_blind = |leader: &&Value| leader["leader"] == blind["leader"] && leader["t_s"].as_f64() < Some(8.0);
    assert_eq!(leaders[1..].iter().filter(while_blind).count(), 0, "{leaders:?}");
}

#[test]
fn every_story_ends_in_formation_with_one_digest_and_by_the_wall_clock_too() {
    let place = Place::new();
    for story in &STORIES {
        let inline = fly(&place, story, "inline", "lockstep");
        assert_led(story, &inline);
        if story.name == "blind-leader" {
            assert_handed_over(&inline);
        }
        let processes = fly(&place, story, "processes", "lockstep");
        assert_eq!(inline["digest"], processes["digest"], "{}", story.name);
        assert_eq!(processes["split_brain_s"], inline["split_brain_s"], "{}", story.name);
    }
    STORIES.iter().for_each(|story| by_the_wall_clock(&place, story));
}

/// A machine that is too busy to keep time flies another mission: then it is tried again, and in the end left alone.
fn by_the_wall_clock(place: &Place, story: &Story) {
    for attempt in 0..3 {
        let out = format!("{}-wall-{attempt}", story.name);
        let done =
            place.run(&args(story, "processes", "realtime:20", &out).iter().map(String::as_str).collect::<Vec<_>>());
        let summary = done.summary();
        if done.code == Some(0) {
            return assert_led(story, &summary);
        }
        assert_ne!(summary["deadline_misses"], 0, "{} kept time and failed: {done:?}", story.name);
    }
    eprintln!("{}: this machine is too busy for the wall clock, nothing is compared", story.name);
}
