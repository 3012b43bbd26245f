//! The world divided by space. Each part knows the drones in its [`Tiles`] tile, and of the others only the [`Halo`] that it is sent in
//! each tick: bodies that its drones may sense, and frames that they may hear. A frame takes at least a tick to arrive, so parts need to
//! hear of each other once per tick only.
//!
//! In each tick, call in this order for every part:
//! 1. [`WorldPart::downlink`], which its drones read;
//! 2. [`WorldPart::take_slot`] and [`WorldPart::take_frames`] for each of its drones;
//! 3. [`WorldPart::advance`], which gives a [`TickShare`]: hand all of them to a [`SplitDigest`], and their [`Announcement`]s to all parts;
//! 4. [`WorldPart::leave`] with all announcements, which gives a halo for each part;
//! 5. [`WorldPart::meet`] with the halos for it.
//!
//! The digest is that of one [`World`](crate::World). Scheduled faults and a shared radio channel concern all drones at once: a world
//! with them is not divided.

mod halo;
mod part;
mod reaches;
mod split_digest;
mod tick_share;
mod tiles;

pub use halo::Halo;
pub use part::{SplitError, WorldPart};
pub use reaches::Reaches;
pub use split_digest::SplitDigest;
pub use tick_share::{Announcement, TickShare};
pub use tiles::Tiles;
