//! The text of the report.

use crate::block::Block;
use crate::cases::{DRONES, GEOMETRIES, LOOK_AHEAD, PAPER, PLACEMENTS, SHORTEST, fixed, jittered, seeds};
use crate::figures::Figure;
use crate::flight::{Flight, JITTER_M};
use crate::forest::Forest;
use crate::gain;
use crate::headline;
use crate::results::{Results, split};
use crate::row::{Row, pass_s};
use crate::studies::studies;
use crate::table::{shown, study, table};

/// The report's title.
pub(crate) const TITLE: &str = "Swarm Formation Morphing for Congestion Aware Collision Avoidance, reproduced";

/// The figure that stands at the beginning: the whole forest mission.
const FIRST: [&str; 1] = ["f2-snapshots.svg"];

/// All parts of the report.
pub(crate) fn content(
    results: &Results,
    forest: &Forest,
    rows: &[Row],
    mut figures: Vec<Figure>,
    quick: bool,
) -> Vec<Block> {
    let mut blocks = vec![headline::table(rows), Block::Text(headline::MEANING.to_owned())];
    let forests = figures.extract_if(.., |figure| FIRST.contains(&figure.file.as_str()));
    blocks.extend(forests.map(Block::Figure));
    blocks.extend([Block::Contents, Block::Heading("What was flown".to_owned())]);
    blocks.extend(opening(results, quick));
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
        blocks.extend([Block::Text((one.finding)(&one, results)), study(&one, results)]);
    }
    blocks.extend(gain::blocks(results, quick));
    blocks.push(Block::Heading("Figures".to_owned()));
    blocks.push(Block::Text(format!("{CURVES} {}", fastest(results))));
    blocks.extend(figures.into_iter().map(Block::Figure));
    blocks.push(Block::Heading("Flights that did not reach their goal".to_owned()));
    blocks.push(Block::Text(failures(results)));
    blocks
}

const ENERGY: &str = "The paper does not say when a mission ends, and the ratio depends on it. So each ratio is given \
    under three conventions, beside the one published number. S1 and S2 end when the formation holds again. S3b ends when \
    all drones are in fixed slots at a goal; this is the cleanest convention, because both strategies end in the same \
    place.";

const BENDING: &str = "Disturbance is the root mean square distance of the drones to the slots of the target shape, after \
    the best translation and assignment. Bending energy is the second term of E6 for the thin-plate spline that maps each \
    slot exactly to its drone (λ = 0). It is zero for every affine image of the shape, and large where the swarm is torn \
    apart. It jumps where the best assignment changes. The figures show both over time; each recorded run has them in \
    `formation.csv`.";

const FORECASTS: &str = "T* is the time of the cost model: each route is a single-file queue with a headway of 1.1 safe \
    distances, and each path is the shortest one round the obstacle. The rule minimises T*. The time flown is longer, \
    because drones accelerate, turn and make way for each other. The paper gives one time and does not say which of the \
    two it is; here it is compared with the time flown.";

const CURVES: &str = "In F1 the two ends of a curve, where nearly all drones take one side, are longer than the queue \
    explains, because paths cross on the way to the corner. Compare their shape, not their values. A quick report shows F1 \
    for S2 only.";

fn opening(results: &Results, quick: bool) -> Vec<Block> {
    let count = results.len();
    let (seeds, scenarios) = (seeds(quick).count(), jittered(quick).join(", "));
    vec![
        Block::Text(format!(
            "{count} flights by the inline runtime, which gives the same digests as one process per drone. `{PAPER}` is \
             the paper's rule and the default; the paper compares it with `{SHORTEST}`; `{LOOK_AHEAD}` looks ahead by simulation. \
             Means are over {seeds} starts of {scenarios}. In each start, every drone is displaced by up to {JITTER_M} m in a random \
             direction. Brackets hold 95 % intervals (Student). `results.csv` lists all flights, each with the command that \
             repeats it. `reproduction.json` holds the rows of all tables. `forest` and `distribution` hold the recorded missions."
        )),
        Block::Text(
            "Time to pass is the paper's cost: from the first detection of the obstacle until the last drone is past \
             its centre."
                .to_owned(),
        ),
    ]
}

/// Where the paper and our results differ, or the paper is ambiguous.
fn differences(rows: &[Row]) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("Where paper and ours differ, or the paper is ambiguous".to_owned())];
    blocks.extend(ambiguities().into_iter().map(Block::Text));
    blocks.extend(measured_differences(rows).into_iter().map(Block::Text));
    blocks.extend(assumptions().into_iter().map(Block::Text));
    blocks
}

fn ambiguities() -> [String; 5] {
    [
        "Missing geometry. The paper gives neither the sizes of formation and obstacles nor the detection range or the safe \
         distance. S1, S2, S3b and the forest were found by a search for geometries that give the published numbers. So it \
         is shown that such geometries exist, not that the authors used them. Numbers that agree were fitted."
            .to_owned(),
        "Left and right. In the paper, six drones join the left group when the obstacle is shifted to the left: the majority \
         takes the longer side. In our flights the majority takes the shorter side, as the cost demands. For a swarm that \
         is its own mirror image, the published labels are read as mirrored. Splits in the tables have the paper's labels, \
         so that they can be compared. `results.csv` has them as flown, from left to right."
            .to_owned(),
        "The speed while re-forming. The ratio of R4 depends on `mission.reform_speed_max_mps`, which the paper does not give: \
         it says v ± δ, and never above 20 m/s. The scenario files have 20 m/s in S1 and the forest, 15 m/s in S2, and 10 m/s in \
         S3b. These values were fitted together with the geometry. The default of the key is v + δ = 15 m/s, which is what S2 has. \
         A table below has the ratio with each cap. δ itself is used only to slow down in a queue and to catch up while re-forming."
            .to_owned(),
        "Where our rule is not the paper's text. The time of an assignment is computed from arrivals at nominal speed and a \
         headway, not by simulating each assignment; the best assignment is found exactly by matching, not by trying all. Paths \
         are our own: the shortest ones round the obstacles, which are widened by the planning distance. Reformation assigns slots \
         with the least sum of squared distances; the paper's TPS mapping is `mission.reformation = \"tps\"`. The target shape \
         is read from the scenario and does not change with the state. A drone in the danger zone takes a way of its own only if \
         no plan covers the obstacle, which does not occur in these flights. Precedence in a queue is the order of arrival when \
         the plan is made, and is then kept; in the paper the drone that is farthest ahead has precedence at any time. With a fixed \
         order no two drones exchange their places while messages are under way."
            .to_owned(),
        "Between the two sets of the forest, N1 and N2 go on by themselves and split again, as in the paper. The paper does not \
         say in which order or in which direction they fly there. Here each group closes its own ranks and flies straight to where \
         its drones will stand at the end. A table below has the mission with a formation that closes between the sets, too."
            .to_owned(),
    ]
}

fn measured_differences(rows: &[Row]) -> [String; 4] {
    let ours = |id: &str| rows.iter().find(|row| row.id == id).map_or_else(|| "–".to_owned(), |row| shown(&row.ours));
    [
        format!(
            "The end of the mission. In S2, shortest path takes {} of the energy of the paper's rule from start to end, {} \
             until the last drone has passed, and {} from detection to pass. In S3b it takes {}, {} and {}. A single ratio \
             says little.",
            ours("R4.S2.ratio.total"),
            ours("R4.S2.ratio.until_passed"),
            ours("R4.S2.ratio.detection_to_pass"),
            ours("R4.S3b.ratio.total"),
            ours("R4.S3b.ratio.until_passed"),
            ours("R4.S3b.ratio.detection_to_pass"),
        ),
        format!(
            "Forecast and flown. In S2 with the obstacle to the right, the leader forecasts {} s, and {} s are flown. The \
             paper has 32 s.",
            ours("T*.S2.best"),
            ours("R3.S2.time"),
        ),
        format!(
            "The error after reformation. The paper has 0.8 m in the average inter-drone distance. Our mission ends only \
             when every slot error is at most 0.8 m. Then the error of the average distance is {} m, and the largest slot \
             error is {} m.",
            ours("R6"),
            ours("R6.slot"),
        ),
        format!(
            "The times of the forest. The paper publishes only times; the obstacles were placed to meet them. Detection is \
             the first tick in which any drone senses the set. In the paper, the snapshot shows the greatest disturbance at \
             50 s, and the text puts the peak of the average distance at about 43 s. In our flight that peak is at {} s; \
             the swarm is widest across the flight at {} s, and farthest from its target shape at {} s.",
            ours("R5.peak"),
            ours("R5.widest"),
            ours("R5.disturbance"),
        ),
    ]
}

fn assumptions() -> [String; 2] {
    [
        format!(
            "Jittered starts. The intervals over starts are narrow, because drones hold their formation from the first \
             second on: most of a displacement of {JITTER_M} m is gone when the first obstacle is seen. The intervals do \
             not measure how the numbers depend on the geometry; the gain over shift and safe distance does. S1 has no room \
             for jitter: its slots are 35 m apart, and its safe distance is 33 m."
        ),
        "Assumptions. As in the paper, these flights have no delay, no loss and no time to compute. But a message takes one \
         tick of 20 ms, and drones know of each other by beacons. A drone that senses any part of an obstacle knows its whole \
         shape. The clocks of all drones agree. Power follows from the speed over ground, in still air, and acceleration costs \
         nothing."
            .to_owned(),
    ]
}

/// The fastest splits as flown. The rule may forecast others.
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
        "The rule takes the split with the least forecast. Another split may be the fastest one as flown (left/right); the table \
         above has both: {}.",
        best.join("; ")
    )
}

/// The groups of the forest mission and their routes, by stage.
fn groups(forest: &Forest) -> String {
    let stage = |stage: &skein_report::Stage| {
        let group =
            |group: &skein_report::StageGroup| format!("{} {} (route {})", group.name, group.drones.len(), group.route);
        let groups: Vec<String> = stage.groups.iter().flatten().map(group).collect();
        format!("{}: {}", split(stage.split.as_deref()), groups.join(", "))
    };
    let stages: Vec<String> = forest.summary.stages.iter().map(stage).collect();
    format!(
        "Number of drones on each route, from left to right, and the groups they flew in: {}. Two groups on one route \
         form one queue.",
        stages.join("; then ")
    )
}

fn failures(results: &Results) -> String {
    let line = |(flight, summary): (&Flight, &skein_report::Summary)| {
        let why = summary.reason.clone().unwrap_or_else(|| format!("{:?}", summary.outcome).to_lowercase());
        format!("`{}` ({why})", flight.command())
    };
    let failed: Vec<String> = results.failed().map(line).collect();
    if failed.is_empty() { "None.".to_owned() } else { format!("No table contains them. {}.", failed.join("; ")) }
}
