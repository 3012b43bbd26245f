//! Worker threads that do numbered jobs side by side.

use crossbeam_channel::{RecvTimeoutError, bounded, unbounded};
use std::time::Duration;

/// Longest time between two calls of `done`: a progress display can be redrawn at this rate.
const REDRAW: Duration = Duration::from_millis(200);

/// Threads that do a list of jobs. Each thread takes the next job as soon as it is free.
#[derive(Clone, Copy, Debug)]
pub struct WorkerPool<'a> {
    /// Numbers of the jobs, in the order in which they are begun.
    pub jobs: &'a [usize],
    /// Number of threads.
    pub workers: usize,
}

impl WorkerPool<'_> {
    /// Does all jobs with `work`. The calling thread passes each result to `done` as it comes, and `None` now and then
    /// in between. A worker ends when `work` gives `None`; all end when `done` fails.
    ///
    /// # Errors
    /// The first error of `done`.
    pub fn run<R: Send, E>(
        &self,
        work: impl Fn(usize) -> Option<R> + Sync,
        done: impl FnMut(Option<R>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.run_with(|_| {}, work, done)
    }

    /// As [`WorkerPool::run`]. Each worker first calls `start` with its own number, from 0.
    ///
    /// # Errors
    /// The first error of `done`.
    pub fn run_with<R: Send, E>(
        &self,
        start: impl Fn(usize) + Sync,
        work: impl Fn(usize) -> Option<R> + Sync,
        mut done: impl FnMut(Option<R>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (job_sender, job_receiver) = bounded::<usize>(0);
        let (result_sender, result_receiver) = unbounded::<R>();
        let (start, work) = (&start, &work);
        std::thread::scope(move |scope| {
            for worker in 0..self.workers {
                let (jobs, results) = (job_receiver.clone(), result_sender.clone());
                scope.spawn(move || {
                    start(worker);
                    while let Ok(job) = jobs.recv() {
                        let Some(result) = work(job) else { return };
                        // The caller has stopped listening: the other results are not wanted.
                        if results.send(result).is_err() {
                            return;
                        }
                    }
                });
            }
            drop((job_receiver, result_sender));
            // Ends early when no worker takes jobs any more.
            scope.spawn(move || self.jobs.iter().try_for_each(|&job| job_sender.send(job)));
            loop {
                match result_receiver.recv_timeout(REDRAW) {
                    Ok(result) => done(Some(result))?,
                    Err(RecvTimeoutError::Timeout) => done(None)?,
                    Err(RecvTimeoutError::Disconnected) => return Ok(()),
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_is_done_once() {
        let pool = WorkerPool { jobs: &[3, 1, 2], workers: 2 };
        let mut squares = Vec::new();
        let done = |square: Option<usize>| {
            squares.extend(square);
            Ok::<(), ()>(())
        };
        assert_eq!(pool.run(|job| Some(job * job), done), Ok(()));
        squares.sort_unstable();
        assert_eq!(squares, [1, 4, 9]);
    }

    #[test]
    fn an_error_of_the_caller_ends_the_pool() {
        let jobs: Vec<usize> = (0..100).collect();
        let pool = WorkerPool { jobs: &jobs, workers: 2 };
        assert_eq!(pool.run(Some, |done| if done == Some(7) { Err(7) } else { Ok(()) }), Err(7));
    }
}
