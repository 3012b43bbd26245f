//! Who leads, and who goes where: membership, election, routes, exact grouping, formation. Pure.

mod adaptive_timeout;
mod avoid;
pub mod candidates;
pub mod cost;
pub mod election;
pub mod funnel;
pub mod geometry;
mod joint;
pub mod leading;
pub mod ledger;
mod matroid_intersection;
pub mod membership;
pub mod obstacles;
mod parts;
pub mod plan_exchange;
pub mod planner;
mod reform;
pub mod roster;
pub mod routes;
pub mod slots;
pub mod split;
pub mod talk;
pub mod tps;
