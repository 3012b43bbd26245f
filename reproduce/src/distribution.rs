//! The paper's Fig. 2: how the swarm is distributed before an obstacle, initially, on the shortest paths, and by the paper's rule.

use crate::cases::{PAPER, SHORTEST};
use crate::error::ReproduceError;
use crate::figures::Figure;
use crate::flight::Flight;
use crate::recording::Recording;
use skein_report::plot::reproduce::Snapshots;
use skein_sweep::Interrupted;
use std::path::Path;

/// The start, and a moment at which the queues stand before the obstacle of S2, s.
const MOMENTS_S: [f64; 2] = [0.0, 20.0];

/// Flies S2 with the obstacle to the right by both strategies, records the flights below this folder, and draws them.
pub(crate) fn figures(path: &Path, interrupted: &Interrupted<'_>) -> Result<Vec<Figure>, ReproduceError> {
    let cases = [(SHORTEST, "b", "on the shortest paths"), (PAPER, "c", "by the paper's rule")];
    let figure = |(strategy, panel, words): (&str, &str, &str)| {
        let made = Recording::make(&path.join(strategy), &Flight::new("s2-right", strategy), interrupted)?;
        let snapshots = Snapshots::read(&made.folder, &MOMENTS_S)?;
        Ok(Figure {
            file: format!("distribution-{strategy}.svg"),
            caption: format!(
                "The paper's Fig. 2 (a) and ({panel}): the swarm at the start, and distributed {words}, S2."
            ),
            svg: snapshots.draw(&made.facts, &format!("The swarm before the obstacle, {words}")),
        })
    };
    cases.into_iter().map(figure).collect()
}
