//! Workers that fly runs side by side.

use super::fly::{Runtime, fly};
use super::grid::Grid;
use super::row::Row;
use crate::interrupt::Interrupt;
use crossbeam_channel::{RecvTimeoutError, bounded, unbounded};
use skein_bus::{PinMode, pin_to_core};
use std::time::Duration;

/// Between two redraws of the progress bar when no run ends.
const PATIENCE: Duration = Duration::from_millis(200);

/// Flies these runs with so many workers, and hands each row to `done` as it comes, or `None` now and then in between.
/// Stops at once when interrupted, or when `done` fails.
pub fn fly_all<E>(
    grid: &Grid<'_>,
    jobs: &[usize],
    workers: usize,
    runtime: &Runtime,
    interrupt: &Interrupt,
    mut done: impl FnMut(Option<Row>) -> Result<(), E>,
) -> Result<(), E> {
    let (give, take) = bounded::<usize>(0);
    let (tell, hear) = unbounded::<Row>();
    std::thread::scope(move |scope| {
        for worker in 0..workers {
            let (take, tell) = (take.clone(), tell.clone());
            scope.spawn(move || {
                if let Runtime::Processes(_) = runtime {
                    // Its swarms inherit the core. Without it they are only slower.
                    let _ = pin_to_core(worker, PinMode::Auto);
                }
                while let Ok(job) = take.recv() {
                    let Some(row) = fly(grid, job, runtime, interrupt) else { return };
                    // Nobody listens any more: the sweep has ended.
                    if tell.send(row).is_err() {
                        return;
                    }
                }
            });
        }
        drop((take, tell));
        scope.spawn(move || jobs.iter().try_for_each(|&job| give.send(job)));
        loop {
            match hear.recv_timeout(PATIENCE) {
                Ok(row) => done(Some(row))?,
                Err(RecvTimeoutError::Timeout) => done(None)?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    })
}
