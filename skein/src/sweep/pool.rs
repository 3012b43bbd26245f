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
    done: impl FnMut(Option<Row>) -> Result<(), E>,
) -> Result<(), E> {
    let start = |worker| {
        if let Runtime::Processes(_) = runtime {
            // Its swarms inherit the core. Without it they are only slower.
            let _ = pin_to_core(worker, PinMode::Auto);
        }
    };
    side_by_side(jobs, workers, start, |job| fly(grid, job, runtime, interrupt), done)
}

/// Does these jobs with so many workers, each of which calls `start` first, and hands each result to `done` as it
/// comes, or `None` now and then in between. A worker stops when `work` gives nothing, all when `done` fails.
pub fn side_by_side<R: Send, E>(
    jobs: &[usize],
    workers: usize,
    start: impl Fn(usize) + Sync,
    work: impl Fn(usize) -> Option<R> + Sync,
    mut done: impl FnMut(Option<R>) -> Result<(), E>,
) -> Result<(), E> {
    let (give, take) = bounded::<usize>(0);
    let (tell, hear) = unbounded::<R>();
    let (start, work) = (&start, &work);
    std::thread::scope(move |scope| {
        for worker in 0..workers {
            let (take, tell) = (take.clone(), tell.clone());
            scope.spawn(move || {
                start(worker);
                while let Ok(job) = take.recv() {
                    let Some(result) = work(job) else { return };
                    // Nobody listens any more: the rest is not wanted.
                    if tell.send(result).is_err() {
                        return;
                    }
                }
            });
        }
        drop((take, tell));
        scope.spawn(move || jobs.iter().try_for_each(|&job| give.send(job)));
        loop {
            match hear.recv_timeout(PATIENCE) {
                Ok(result) => done(Some(result))?,
                Err(RecvTimeoutError::Timeout) => done(None)?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    })
}
