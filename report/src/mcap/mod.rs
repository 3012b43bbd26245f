//! run.mcap: a recording for Foxglove, Lichtblick and other readers of MCAP. It holds no wall times, so that equal runs
//! make equal files.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms`: a frame `drone_3` for each drone, in the frame `world` | every sample |
//! | `/drones` | `foxglove.PosesInFrame` | every fifth sample |
//! | `/scene` | `foxglove.SceneUpdate`: obstacles, hulls, routes; drones; marks and lines of pilots; danger zones, slots, radio links | once; when they change; every sample with any; every fifth sample |
//! | `/skein/marks` | `skein.Marks`: see [`Shown`](crate::scene::Shown) | every sample with marks or lines |
//! | `/log` | `foxglove.Log` | every event |
//! | `/skein/state`, `/skein/energy`, `/skein/radio` | `skein.State`, … in JSON, see [`Sample`](crate::scene::Sample) | every sample |
//! | `/skein/groups`, `/skein/leadership`, `/skein/events` | `skein.Event`: a line of events.jsonl | every event |
//!
//! A sample is taken ten times per simulated second, in large swarms less often. The resolved scenario is the attachment
//! `scenario.json`; the main facts of the run are the metadata record `run`.

mod draw;
mod foxglove;
mod read;
#[cfg(test)]
mod tests;
mod writer;

pub(crate) use read::read;
pub(crate) use writer::McapWriter;
