//! What the report says.

use super::figures::Figure;
use super::flight::{Flight, JITTER_M};
use super::flights::{DEFAULT, DRONES, GEOMETRIES, PAPER, PLACEMENTS, SHORTEST, fixed, jittered, seeds};
use super::forest::Forest;
use super::gain;
use super::results::{Results, split};
use super::rows::{Row, pass_s};
use super::studies::studies;
use super::table::{shown, study, table};

/// A part of the report.
pub enum Block {
    /// Of a section.
    Heading(String),
    /// A paragraph; code stands between backticks.
    Text(String),
    /// Lines of cells.
    Table {
        /// Above the columns.
        head: Vec<String>,
        /// Each as long as the head.
        lines: Vec<Vec<String>>,
    },
    /// A drawing.
    Figure(Figure),
}

/// The report's title.
pub const TITLE: &str = "Swarm Formation Morphing for Congestion Aware Collision Avoidance, reproduced";

/// The report.
pub fn content(results: &Results, forest: &Forest, rows: &[Row], figures: Vec<Figure>, quick: bool) -> Vec<Block> {
    let mut blocks = opening(results, quick);
    blocks.extend(differences(rows));
    let sections: [(&str, &[&str]); 7] = [
        ("One obstacle: time and split (R1, R2, R3)", &["R1", "R2", "R3"]),
        ("Energy (R4)", &["R4"]),
        ("The forest mission (R5)", &["R5"]),
        ("After the reformation (R6)", &["R6"]),
        ("Disturbance and bending energy (E6)", &["E6"]),
        ("Forecasts (T*)", &["T*"]),
        ("The power model (P1)", &["P1"]),
    ];
    for (heading, prefixes) in sections {
        blocks.extend([Block::Heading(heading.to_owned()), table(rows, prefixes)]);
        match prefixes[0] {
            "R4" => blocks.push(Block::Text(ENERGY.to_owned())),
            "R5" => blocks.push(Block::Text(groups(forest))),
            "E6" => blocks.push(Block::Text(BENDING.to_owned())),
            "T*" => blocks.push(Block::Text(FORECASTS.to_owned())),
            _ => {}
        }
    }
    for one in studies(quick) {
        blocks.push(Block::Heading(one.heading.to_owned()));
        blocks.extend([Block::Text((one.says)(&one, results)), study(&one, results)]);
    }
    blocks.extend(gain::blocks(results, quick));
    blocks.push(Block::Heading("Figures".to_owned()));
    blocks.push(Block::Text(format!("{CURVES} {}", fastest(results))));
    blocks.extend(figures.into_iter().map(Block::Figure));
    blocks.push(Block::Heading("Flights that did not reach their goal".to_owned()));
    blocks.push(Block::Text(failures(results)));
    blocks
}

const ENERGY: &str = "The paper does not say when a mission ends, and the ratio depends on it; so each ratio stands \
    here under three conventions, beside the one published number. S1 and S2 end when the formation holds again, S3b \
    when all drones are in fixed slots at a goal, which is the clean convention: both strategies end in the same place.";

const BENDING: &str = "Disturbance is the root of the mean square distance of the drones to the slots of the target shape, \
    after the best translation and assignment. Bending energy is the second term of E6 for the thin-plate spline that \
    takes each slot exactly to its drone (λ = 0): zero for whatever is an affine image of the shape, large where the \
    swarm is torn apart; it jumps where the best assignment changes. The figures show both over time; each recorded run has them in `formation.csv`.";

const FORECASTS: &str = "T* is the time of the cost model: each route a single-file queue with a headway of 1.1 safe \
    distances, each path a taut string round the obstacle. It is what the rule minimises. The time flown is longer: \
    drones accelerate, turn, and make way for each other. The paper gives one time and does not say which it is; it is \
    compared with the time flown.";

const CURVES: &str = "In F1 the two ends of a curve, where nearly all drones take one side, are longer than any queue \
    explains: lanes cross on the way to the corner. Their shape matters, not their value. Quick reports show F1 for \
    S2 alone.";

fn opening(results: &Results, quick: bool) -> Vec<Block> {
    let count = results.len();
    let (seeds, scenarios) = (seeds(quick).count(), jittered(quick).join(", "));
    vec![
        Block::Text(format!(
            "{count} flights by the inline runtime, whose digests equal those of one process a drone. The rule is the \
             paper's to the letter, `{PAPER}`; what it is compared with is `{SHORTEST}`, and beside them stands \
             `{DEFAULT}`, the default. Means are over {seeds} starts of {scenarios}, each drone displaced by up to \
             {JITTER_M} m in any direction, with 95 % intervals (Student) in brackets. All flights stand in \
             `results.csv`, each with the command that repeats it, the rows of all tables in `reproduction.json`, the \
             forest mission recorded in `forest`."
        )),
        Block::Text(
            "Time to pass is the paper's cost: from the first detection of the obstacle until the last drone is past \
             its centre."
                .to_owned(),
        ),
    ]
}

fn differences(rows: &[Row]) -> Vec<Block> {
    let ours = |id: &str| rows.iter().find(|row| row.id == id).map_or_else(|| "–".to_owned(), |row| shown(&row.ours));
    let says = |text: String| Block::Text(text);
    vec![
        Block::Heading("Where paper and ours differ, or the paper is ambiguous".to_owned()),
        says(
            "Missing geometry. The paper gives neither the formation's size nor the obstacles', nor detection range or \
             safe distance. S1, S2, S3b and the forest were searched for so that the published numbers come out; that \
             such geometries exist is shown, not that they were the authors'. Numbers that agree were fitted."
                .to_owned(),
        ),
        says(
            "Left and right. The paper sends six drones into the left group when the obstacle is shifted to the left, \
             that is, the majority round the longer side. In our flights the majority takes the shorter side, as the \
             cost demands; for a swarm that is its own mirror image the published labels are read as mirrored. Splits \
             in the tables are in the paper's labels, so that its 6/2 and ours can be compared; `results.csv` has them \
             as flown, rightmost route first."
                .to_owned(),
        ),
        says(format!(
            "The end of the mission. Shortest path costs {} of the paper's rule from start to end in S2, {} until the \
             last drone has passed, {} from detection to pass; in S3b {}, {} and {}. A ratio alone says little.",
            ours("R4.S2.ratio.total"),
            ours("R4.S2.ratio.until_passed"),
            ours("R4.S2.ratio.detection_to_pass"),
            ours("R4.S3b.ratio.total"),
            ours("R4.S3b.ratio.until_passed"),
            ours("R4.S3b.ratio.detection_to_pass"),
        )),
        says(format!(
            "Forecast and flown. In S2 with the obstacle right the leader forecasts {} s and {} s are flown; the paper \
             has 32 s.",
            ours("T*.S2.best"),
            ours("R3.S2.time"),
        )),
        says(format!(
            "The error after reformation. The paper has 0.8 m in the average inter-drone distance. A mission of ours \
             ends only when every slot error is at most 0.8 m; the average distance is then off by {} m and the \
             largest slot error is {} m.",
            ours("R6"),
            ours("R6.slot"),
        )),
        says(format!(
            "The forest's clock. Only times are published; the obstacles were placed to meet them. Detection is the \
             first tick in which any drone senses the set. The paper's snapshot calls the disturbance greatest at 50 s, \
             its text puts the peak of the average distance at about 43 s; ours has that peak at {} s, is widest across \
             the flight at {} s, and farthest from its target shape at {} s.",
            ours("R5.peak"),
            ours("R5.widest"),
            ours("R5.disturbance"),
        )),
        says(format!(
            "Jittered starts. The intervals over starts are narrow because drones hold their formation from the first \
             second on: most of a displacement of {JITTER_M} m is gone when the first obstacle is seen. They are no \
             measure of how the numbers depend on geometry; the gain over shift and safe distance is. S1 has no room for \
             jitter: its slots are 35 m apart, and its safe distance is 33 m."
        )),
        says(
            "Assumptions. As in the paper there is no delay, no loss and no time to compute in these flights, but a \
             message takes one tick of 20 ms, and drones know of each other by beacons."
                .to_owned(),
        ),
    ]
}

/// The fastest splits as flown, which need not be those that the rule forecasts.
fn fastest(results: &Results) -> String {
    let scenarios = GEOMETRIES.iter().flat_map(|geometry| PLACEMENTS.map(|at| format!("{geometry}-{at}")));
    let best = |scenario: String| {
        let time = |left: u32| {
            let strategy = fixed(left);
            let time_s = results.reached(&Flight::new(&scenario, &strategy)).and_then(pass_s)?;
            Some((time_s, strategy))
        };
        let (time_s, strategy) = (0..=DRONES).filter_map(time).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let rule_s = results.reached(&Flight::new(&scenario, PAPER)).and_then(pass_s)?;
        Some(format!("{scenario} `{strategy}` in {time_s:.2} s, where the rule takes {rule_s:.2} s"))
    };
    let best: Vec<String> = scenarios.filter_map(best).collect();
    format!(
        "The rule takes the split with the least forecast; the fastest of all splits as flown (left/right) can be \
         another: {}.",
        best.join("; ")
    )
}

/// Who flew where in the forest, by stage.
fn groups(forest: &Forest) -> String {
    let stage = |stage: &skein_report::Stage| {
        let group =
            |group: &skein_report::StageGroup| format!("{} {} (route {})", group.name, group.drones.len(), group.route);
        let groups: Vec<String> = stage.groups.iter().flatten().map(group).collect();
        format!("{}: {}", split(stage.split.as_deref()), groups.join(", "))
    };
    let stages: Vec<String> = forest.summary.stages.iter().map(stage).collect();
    format!(
        "Drones for each route, rightmost route first, and the groups they flew in: {}. Two groups on one route share \
         it in one queue.",
        stages.join("; then ")
    )
}

fn failures(results: &Results) -> String {
    let line = |(flight, summary): (&Flight, &skein_report::Summary)| {
        let why = summary.reason.clone().unwrap_or_else(|| format!("{:?}", summary.outcome).to_lowercase());
        format!("`{}` ({why})", flight.command())
    };
    let failed: Vec<String> = results.failed().map(line).collect();
    match failed.is_empty() {
        true => "None.".to_owned(),
        false => format!("They count in no table. {}.", failed.join("; ")),
    }
}
