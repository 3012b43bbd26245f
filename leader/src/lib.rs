//! Which drone leads, and which drone goes where. Pure: no clock, file, socket or thread; time is an argument.
//!
//! [`leading::Leading`] is the state machine of one drone. It hears messages, decides and says messages. Inside it are
//!
//! - [`election::Election`]: which term the drone obeys, and whether it leads it;
//! - [`peers::Peers`] and [`obstacles::Obstacles`]: what the drone knows of others and of obstacles;
//! - [`ledger::Ledger`]: the newest plan it has heard of, the one it obeys, and the assignments in it;
//! - a planner, idle unless the drone leads: which drone flies which route past an obstacle set, jointly with the leaders
//!   of other groups, and which drone takes which slot of the formation.
//!
//! The planner rests on functions that can be used alone: [`routes::Routes`] (the routes past a set),
//! [`funnel::Corridor`] (the shortest path along routes), [`cost::trips`] (arrival times), [`split::ArrivalTable`] (the exact
//! grouping of the paper's Algorithm 3), [`candidates::candidates`] (groupings worth a rollout) and
//! [`slots::assign_by`] (slots of the formation).
//!
//! Messages are soft state: they may be lost, doubled, delayed or reordered, and what matters is repeated. A drone obeys
//! the highest (ballot, epoch) it has heard and never goes back. `tests/check.rs` explores the machine that flies with a
//! model checker.
//!
//! This crate does not know how a drone flies, senses or keeps its distance (`skein-agent`), nor how messages travel
//! (`skein-bus`, `skein-world`). It does not choose among the alternatives of a look-ahead either: the pilot does.
//!
//! # Example
//!
//! Four drones and two routes. The left route is a little longer. All drones on the right route would pass 4 s apart; the
//! exact split sends half of them to the left.
//!
//! ```
//! use skein_leader::split::ArrivalTable;
//!
//! let arrivals_s = [[10.0, 11.0], [11.0, 12.0], [12.0, 13.0], [13.0, 14.0]].map(Vec::from);
//! let table = ArrivalTable::new(&arrivals_s, &[4.0, 4.0])?;
//! assert_eq!(table.shortest().makespan_s, 22.0);
//! let split = table.split();
//! assert_eq!(split.makespan_s, 15.0);
//! assert_eq!([0, 1].map(|route| split.queues[route].len()), [2, 2]);
//! # Ok::<(), skein_leader::split::SplitError>(())
//! ```

mod adaptive_timeout;
pub mod assignments;
mod avoidance;
mod beacon_pace;
mod beacon_states;
pub mod beacons;
mod beats;
mod broadcaster;
pub mod candidates;
pub mod changes;
pub mod channel_params;
pub mod cost;
mod draft;
mod drone_entries;
mod drone_set;
pub mod election;
mod fact_store;
mod fact_values;
mod formation_pace;
mod formation_planner;
pub mod funnel;
pub mod geometry;
mod gossip;
mod grouping;
mod growth;
mod heard;
mod joint_planner;
mod knowledge;
pub mod leading;
pub mod ledger;
mod matching;
mod matroid_intersection;
pub mod member;
mod membership;
pub mod nearest_on_segment;
mod news;
pub mod obstacles;
mod onward;
pub mod own_state;
mod packed_assignment;
pub mod params;
pub mod peers;
pub mod plan_bundle;
mod plan_exchange;
mod plan_pace;
pub mod planned_set;
mod planner;
mod pool;
mod presences;
mod quiet_blocks;
mod relay_pace;
mod relayed_facts;
mod relays;
mod roles;
pub mod roster;
pub mod routes;
pub mod set_place;
mod shared_values;
pub mod silent;
mod situation;
pub mod slots;
pub mod split;
mod subject;
mod survey;
mod task;
pub mod tps;
mod tuning;
mod turns;
pub mod visibility;
