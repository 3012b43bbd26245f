//! Who leads, and who goes where: membership, election, routes, exact grouping, formation. Pure.

mod avoid;
pub mod candidates;
pub mod cost;
pub mod council;
pub mod election;
mod exchange;
pub mod geometry;
mod joint;
pub mod leading;
pub mod ledger;
pub mod membership;
pub mod obstacles;
mod parts;
pub mod planner;
mod reform;
mod rhythm;
pub mod roster;
pub mod routes;
pub mod slots;
pub mod split;
pub mod string;
pub mod talk;
pub mod tps;
