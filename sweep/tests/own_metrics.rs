//! A sweep of a pilot that reports figures of its own.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
use skein_runtime::{PilotRegistry, Program};
use skein_sweep::{Experiment, Grid, Sweep};
use std::path::Path;

/// Reports its parameter, and its number in every second drone only.
struct Teller {
    drone: u32,
    gain: f64,
}

impl Pilot for Teller {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
        out.metric("gain", self.gain);
        out.metric("now_s", senses.now_s);
        if self.drone % 2 == 1 {
            out.metric("order", f64::from(self.drone));
        }
        Command::default()
    }
}

const SCENARIO: &str = "[formation]\ndrones = 4\nspacing_m = 60\nstart_jitter_m = 1\n[mission]\nend = \"time\"\nduration_s = 1\n\
                        [[pilot]]\nname = \"teller\"\nparams = { gain = 1.0 }\n";
const EXPERIMENT: &str = "scenario = \"telling.toml\"\nseeds = 2\n[grid]\n\"pilot.0.params.gain\" = [1.0, 2.5]\n";

fn pilots() -> PilotRegistry {
    let mut pilots = PilotRegistry::new(Program::current().unwrap());
    pilots.register("teller", |birth| {
        Ok(Box::new(Teller { drone: birth.drone, gain: birth.params.get_f64("gain", 0.0)? }))
    });
    pilots
}

/// Flies the experiment with this line added, into a folder.
fn fly(root: &Path, more: &str) -> std::path::PathBuf {
    std::fs::write(root.join("telling.toml"), SCENARIO).unwrap();
    let experiment = Experiment::parse(&format!("{more}\n{EXPERIMENT}"), "tell", root).unwrap();
    let grid = Grid::new(&experiment, &[]);
    let out = root.join("out");
    assert!(Sweep::new(&grid, &pilots()).workers(1).run_in_folder(&out).unwrap().complete().is_some());
    out
}

#[test]
fn figures_of_pilots_are_columns_estimates_and_plots() {
    let root = tempfile::tempdir().unwrap();
    let out = fly(root.path(), "");
    let csv = std::fs::read_to_string(out.join("runs.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| {
        let place = rows[0].iter().position(|head| *head == name).unwrap_or_else(|| panic!("{name}: {csv}"));
        rows[1..].iter().map(|row| row[place]).collect::<Vec<_>>()
    };
    assert_eq!(column("metric.gain"), ["1", "1", "2.5", "2.5"]);
    assert_eq!(column("metric.order"), ["2"; 4]);
    assert_eq!((column("metric.order.min"), column("metric.order.max")), (vec!["1"; 4], vec!["3"; 4]));
    let last = column("metric.now_s.last");
    assert_eq!((&last, column("metric.now_s.max")), (&column("metric.now_s.max"), last.clone()));
    assert!(
        last.iter()
            .zip(column("metric.now_s"))
            .all(|(last, mean)| last.parse::<f64>().unwrap() > 1.5 * mean.parse::<f64>().unwrap())
    );
    assert_eq!(column("union"), ["1"; 4], "the swarm's own figure of a like name");
    let summary: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    let gain = &summary["cells"][1]["metrics_own"]["gain"];
    assert_eq!((&gain["mean"], &gain["n"]), (&2.5.into(), &2.into()), "{summary}");
    assert_eq!(summary["cells"][1]["metrics_own"]["order.max"]["mean"], 3.0);
    let svg = std::fs::read_to_string(out.join("plots/metric.gain.svg")).unwrap();
    assert!(svg.contains("gain, mean over drones and time") && svg.contains("pilot.0.params.gain"));
    assert!(out.join("plots/metric.order.svg").exists() && out.join("plots/success.svg").exists());
    assert!(
        !out.join("plots/metric.order.last.svg").exists(),
        "only means are plotted unless the experiment asks for more"
    );
}

#[test]
fn an_experiment_chooses_figures_of_pilots_like_metrics() {
    let root = tempfile::tempdir().unwrap();
    let out = fly(root.path(), "metrics = [\"metric.order.last\", \"order\", \"metric.never\", \"metric.gain.max\"]");
    let mut plots: Vec<String> = (std::fs::read_dir(out.join("plots")).unwrap())
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    plots.sort();
    assert_eq!(plots, ["metric.gain.max.svg", "metric.order.last.svg", "order.svg"]);
    let svg = std::fs::read_to_string(out.join("plots/metric.order.last.svg")).unwrap();
    assert!(svg.contains("order, mean over drones at the end"));
    let refused = Experiment::parse(&format!("metrics = [\"gain\"]\n{EXPERIMENT}"), "tell", root.path()).unwrap_err();
    assert!(refused.to_string().contains("or metric.NAME for a figure that pilots report"), "{refused}");
}
