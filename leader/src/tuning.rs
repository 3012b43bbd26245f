//! The tuned numbers of this crate. Limits that a type or a wire format imposes stand beside their types.
//!
//! "By hand" means that the value was chosen from watching single runs and that no sweep is on record. A number that was
//! measured names the command that measures it again.

// ---- Queues and crowds (`params.rs`) ----

/// From this number of drones on, drones pass side by side where there is room, and not one behind another. 33. By hand: in a long queue most
/// drones cannot wait for their turn, because they fly no slower than v − δ. Queues of up to 16 drones mostly can: in four of 100 random
/// scenes (`skein scene 900000` to `900099`) some drones could not.
pub(crate) const CROWD_DRONES: u32 = 33;
/// By words, drones follow each other through a gap no faster than such a number of messages takes, one after the other. No unit. 3. By
/// reasoning ([`crate::params::PlannerParams::turn_s`]), and compared with 4 in `scenarios/narrow/gap.toml`, seeds 1 to 8.
pub(crate) const AGREEMENT_MESSAGES: f64 = 3.0;

// ---- Adaptive time-outs (`adaptive_timeout.rs`) ----

/// Weight of a new gap in the running means of a source's gaps. No unit. 0.02. By hand.
pub(crate) const GAP_WEIGHT: f64 = 0.02;
/// Mean deviation that is assumed for a new source, as a multiple of its first gap. No unit. 1: that of a link which
/// loses every other message. By calculation.
pub(crate) const INITIAL_DEVIATION: f64 = 1.0;
/// A silence is significant from this many mean deviations above the mean gap. No unit. 22: at 50 % loss that is 24
/// periods, and one silence in ten million is as long. By calculation; `skein bench failover` measures what it costs.
pub(crate) const TIMEOUT_DEVIATIONS: f64 = 22.0;
/// Upper bound of an adaptive time-out, in base time-outs. No unit. 12. By hand; `skein bench failover`.
pub(crate) const MAX_TIMEOUTS: f64 = 12.0;

// ---- Peers (`peers.rs`) ----

/// Weight of a new sample in the running mean of the message delay. No unit. 0.1. By hand.
pub(crate) const DELAY_WEIGHT: f64 = 0.1;

// ---- Elections (`election.rs`, `leading.rs`) ----

/// Two signs of a leader that are closer than this part of its heartbeat period count as one. No unit. 0.75. By hand.
pub(crate) const SAME_BEAT: f64 = 0.75;
/// A drone that was restarted listens for this many leader time-outs before it claims. No unit. 4. By hand;
/// `skein bench failover`.
pub(crate) const NEWCOMER_TIMEOUTS: f64 = 4.0;
/// A drone that its group's split left out waits for this many leader time-outs to be taken in. Then it claims its
/// group. No unit. 4. By hand.
pub(crate) const PARTED_TIMEOUTS: f64 = 4.0;
/// Number of members that reject a pre-vote, besides the leader itself. 4. By hand: enough that one of them is heard.
pub(crate) const MAX_REJECTIONS: usize = 4;
/// A leader that has been last in the formation for this long transfers its leadership, s. 3. By hand.
pub(crate) const BEHIND_S: f64 = 3.0;
/// A group that goes on by itself and has been at its destination for this long makes one formation of the swarm, s, if no drone has an
/// obstacle ahead. 20. By hand: longer than groups come one after another.
pub(crate) const ARRIVED_S: f64 = 20.0;
/// A drone that has had no assignment in its leader's newest plan for this long concludes that the leader does not hear
/// it, s. If its leader says only older plans for this long, the newest one was invented. 4. By hand.
pub(crate) const LEFT_OUT_S: f64 = 4.0;

// ---- Rate of plans (`plan_pace.rs`) ----

/// Least time between two plans of one leader for the same set, s. The message delay is added twice, so that the members'
/// beacons can show the first plan before the second is made. 0.5. By hand: a few beacon periods.
pub(crate) const PLAN_INTERVAL_S: f64 = 0.5;
/// How often that time is doubled at most while the members stay the same. No unit. 4: at most 8 s without delay. By hand.
pub(crate) const MAX_PLAN_DOUBLINGS: u32 = 4;

// ---- Joint planning (`joint_planner.rs`, `plan_exchange.rs`, `planner.rs`) ----

/// A leader waits this long for the arrivals of other groups and then plans alone, s. The message delay is added twice.
/// 0.3. By hand; `skein reproduce`.
pub(crate) const ARRIVALS_TIMEOUT_S: f64 = 0.3;
/// A leader waits this long for the coordinator's choice, s. The message delay is added twice. 2: the coordinator's
/// rollouts take one second. By hand; `skein reproduce`.
pub(crate) const CHOICE_TIMEOUT_S: f64 = 2.0;
/// The coordinator repeats its choice for this long, s. 1. By hand.
pub(crate) const ANNOUNCE_S: f64 = 1.0;
/// Assignments of a new plan may still be under way for this long, s. The message delay is added twice. 1. By hand.
pub(crate) const ASSIGNMENTS_DUE_S: f64 = 1.0;
/// While the coordinator runs its rollouts, all fly their shortest paths, or the paper's rule if that saves at least this
/// share of the last drone's time. No unit. 0.2. Groups that meet before one set are close to it, and a second on the
/// wrong path cannot be made up for. By hand; `skein reproduce`.
pub(crate) const INTERIM_RULE_SAVING: f64 = 0.2;
/// Largest swarm that is simulated. 32. The neighbours of all drones are searched for pair by pair. By hand: what a second of
/// rollouts suffices for.
pub const MAX_ROLLOUT_DRONES: usize = 32;
/// Most groupings that are handed to a rollout, the shortest paths and the rule's among them. 16. By hand: what a second
/// of rollouts suffices for.
pub(crate) const MAX_CANDIDATES: usize = 16;

// ---- Gossip (`gossip.rs`), after Trickle, RFC 6206 ----

/// A drone that hears a fact this often within an interval does not repeat it. No unit. 3. RFC 6206, section 6.2, names values
/// between 1 and 5; `skein sweep experiments/presets.toml`.
pub(crate) const REDUNDANCY: u32 = 3;
/// How often the shortest interval between repetitions is doubled at most. No unit. 3: with the default period that is 1.6 s.
/// By hand; `skein sweep experiments/presets.toml`.
pub(crate) const MAX_GOSSIP_DOUBLINGS: u8 = 3;

// ---- Beacons (`beacon_pace.rs`) ----

/// A drone that hears more beacons than this per second sends its own less often, 1/s. 320: those of 32 drones with the default period.
/// SAE J2945/1 has 250 for cars: a period of 0.1 s for 25 neighbours.
pub(crate) const BEACONS_PER_S: f64 = 320.0;

// ---- Relays (`relays.rs`, `presences.rs`) ----

/// A drone that hears this many copies from drones close to it does not pass a message on. No unit. 2. By hand.
pub(crate) const NEAR_REDUNDANCY: u32 = 2;
/// A drone that was silent in this many turns because drones close to it had said the message says it in the next one: it may be
/// heard by drones that do not hear those. No unit. 8. By hand.
pub(crate) const MAX_SILENT_TURNS: u8 = 8;
/// The nearest of the drones whose last beacon was heard, up to this share, are within the range of a radio. No unit. 0.75. By hand: a
/// beacon that is heard by chance from far away does not count.
pub(crate) const REACHED: f64 = 0.75;
/// A drone is close if it is nearer than this part of that range. No unit. 0.6. By hand: of a radio with a hard limit, that is half of the
/// limit, because some drones that are heard are beyond the range as it is measured.
pub(crate) const NEAR: f64 = 0.6;
/// A drone passes messages on once a neighbour has heard other drones than it does for this long, s. At least three beacons,
/// and twice the message delay is added. 0.5. By hand: longer than a crash is noticed by some and not by others.
pub(crate) const WIDE_S: f64 = 0.5;
/// A drone stops passing messages on once each neighbour has heard the same drones as it does for this long, s. Chosen by hand: where beacons
/// are lost, and at the edge of the range, all agree by chance for a moment now and then, and what was to be passed on would be forgotten.
pub(crate) const STAYS_WIDE_S: f64 = 3.0;
/// Longest time until a message of a leader is passed on while other drones are close, s; also the time between two repetitions
/// while a neighbour obeys an earlier term. 0.1: half of a heartbeat period. By hand.
pub(crate) const HOP_S: f64 = 0.1;
/// A leader's next message is overdue after this many heartbeat periods. No unit. 1.1. By hand: a little more than one, so that
/// nothing is repeated while nothing is lost.
pub(crate) const BEAT_OVERDUE: f64 = 1.1;
/// Time between two repetitions of a leader's newest message, in heartbeat periods. No unit. 0.5. By hand; `skein bench election`.
pub(crate) const BEAT_REPEAT: f64 = 0.5;
/// The newest message of a term that this drone does not obey is repeated for this many heartbeat periods. No unit. 10. By hand.
pub(crate) const FOREIGN_BEATS: f64 = 10.0;
/// What was not heard for this long is forgotten, s. 30. By hand.
pub(crate) const RELAY_MEMORY_S: f64 = 30.0;
/// In swarms of more drones than this, passages are remembered longer in proportion. No unit. 64: so a drone passes on at most about two known
/// passages per second. By hand.
pub(crate) const PASSAGES: f64 = 64.0;
/// Time between two looks at what was not heard for long, s. 3: a tenth of that. By hand.
pub(crate) const FORGET_S: f64 = 3.0;
/// Time between two counts of the drones that share the bandwidth, s. 1. By hand.
pub(crate) const COUNT_S: f64 = 1.0;
/// An assignment that its drone obeys is looked at again after this many repeat periods. No unit. 8: with the default period
/// 1.6 s. By hand.
pub(crate) const UNWANTED_REPEATS: f64 = 8.0;
/// A message of a leader whose stamp lies further in the future is not believed, s. 2: twice the offset of two clocks that are
/// each one second off. By calculation.
pub(crate) const CLOCKS_S: f64 = 2.0;
/// A message of a leader that was passed on for longer is not believed, s. 300: some hundred hops at 75 % loss. By hand.
pub(crate) const OLDEST_S: f64 = 300.0;
/// Most frames that a drone passes on in one tick. 4. By hand.
pub(crate) const MAX_RELAYED_PER_TICK: usize = 4;
/// Greatest share of a limited bandwidth that the states, plans, assignments and rows of arrivals take that drones pass on. No unit.
/// 0.5. Beacons take another quarter at most. By hand.
pub(crate) const RELAY_SHARE: f64 = 0.5;
/// Greatest share of a limited bandwidth that the messages of leaders take that drones pass on. No unit. 0.15. By hand.
pub(crate) const BEAT_SHARE: f64 = 0.15;
/// Greatest share of a limited bandwidth that one leader's assignments take, and that its rows of arrivals take. No unit. 0.05. By hand.
pub(crate) const LEADER_SHARE: f64 = 0.05;
/// That many assignments or rows of arrivals may be repeated without regard to that share. 32. By hand: small groups need no share.
pub(crate) const UNPACED: usize = 32;
/// An assignment is passed on by drones in all directions from this interval on. No unit. 2. By hand.
pub(crate) const DETOUR_DOUBLINGS: u32 = 2;
/// A drone's news is passed on this many times at once. 2. By hand.
pub(crate) const NEWS_TIMES: u8 = 2;
/// Drones without news are passed on once per this many repeat periods. No unit. 8: with the default period every 1.6 s. By
/// hand.
pub(crate) const PRESENCE_REPEATS: f64 = 8.0;
/// A state is repeated if nothing newer came for this part of that period. No unit. 1.5. By hand: more than the waits of two drones,
/// so that nothing is repeated while nothing is lost.
pub(crate) const PRESENCE_OVERDUE: f64 = 1.5;
/// A drone whose state is passed on counts as living for at least this many time-outs without word of it. No unit. 4: with the default
/// periods 6 s, or longer from 160 drones on, in which its state comes three times. By hand.
pub(crate) const RELAYED_TIMEOUTS: f64 = 4.0;
/// The drones within a close distance of each other pass on about this many states without news per second, 1/s. 100: swarms of more than 160
/// drones repeat states less often, so that what a drone hears does not grow with the swarm (`runtime/tests/growth.rs`). Chosen with whole
/// missions of `scenarios/grid.toml` with 300 drones.
pub(crate) const STATES_PER_S: f64 = 100.0;
/// Longest mean time between two times at which a drone says states without news, in repeat periods. No unit. 2: a state needs half of
/// that for a hop. By hand.
pub(crate) const LONGEST_TURN: f64 = 2.0;
/// Of the states that are due, those come first of which the neighbourhood has not heard for longest; differences of less than the period
/// divided by this do not count, so that close drones do not all say the same. No unit. 8. By hand.
pub(crate) const WAITS_PER_PERIOD: f64 = 8.0;
/// While more frames of states than this are due, a drone passes states on less often. 4. Chosen, with the next two, from the first 45 s of
/// `scenarios/hard/wider-than-radio.toml` with 300 drones: how old the states of others are.
pub(crate) const BACKLOG: usize = 4;
/// Factor by which the time between two states of a drone grows with each turn in which more are due. No unit. 1.05. See [`BACKLOG`].
pub(crate) const THIN: f64 = 1.05;
/// Factor by which it falls with each turn in which no more are due. No unit. 0.95. See [`BACKLOG`].
pub(crate) const THICKEN: f64 = 0.95;
/// Greatest product of these factors. No unit. 8: with the default period 13 s. By hand.
pub(crate) const MAX_THINNING: f64 = 8.0;
/// A drone heard directly within this time needs no relay, s. 1. By hand: several beacons.
pub(crate) const DIRECT_S: f64 = 1.0;
/// No first claim is made while further drones became known within this time, s. 0.6. By hand: three hops.
pub(crate) const SETTLED_S: f64 = 0.6;
/// The first claim is not delayed for longer, s. 5. By hand.
pub(crate) const UNSETTLED_S: f64 = 5.0;
/// A leader repeats the assignment of a drone that it does not hear directly in every fourth repetition only. 4. By hand:
/// the drones between them repeat it, too.
pub(crate) const FAR_REPEATS: u32 = 4;

// ---- Formation (`formation_planner.rs`) ----

/// Step by which the anchor moves on while a slot is blocked, m. 5. By hand.
pub(crate) const ANCHOR_STEP_M: f64 = 5.0;
/// A formation in which a drone cannot reach its slot is widened by this factor. No unit. 1.6. By hand.
pub(crate) const OPEN_RANKS: f64 = 1.6;
/// Number of factors that are tried if obstacles are in the way of so wide a formation. No unit. 4: 1.6, 1.45, 1.3 and 1.15. By hand.
pub(crate) const OPENINGS: u32 = 4;
/// A formation in which all drones have been stalled for this long is stuck, s. 3. By hand.
pub(crate) const STALLED_S: f64 = 3.0;
/// A drone that hears no other takes a slot farther back once another one has been in the front slot for this long, s. 30: others that live
/// and that it does not hear have left it by then. By hand.
pub(crate) const FRONT_LOST_S: f64 = 30.0;
/// A beacon that is older than this shows how a drone flew, but not how it goes on flying, if it is to stay in a slot, s. 2. By hand.
pub(crate) const OLD_S: f64 = 2.0;
/// Where drones may be out of reach, one that was not heard for this long counts as dead if a formation is to close, s. 60: the others come back
/// within that time. By hand.
pub(crate) const DEAD_S: f64 = 60.0;

// ---- Routes (`routes.rs`) ----

/// More than the rounding errors of positions within 1000 km, m. 1e-6. Not tuned.
pub(crate) const ROUNDING_M: f64 = 1e-6;

// ---- Paths (`funnel.rs`) ----

/// Distance of a corridor's target behind the last set's exit, m. 60. By hand; `skein reproduce`.
pub(crate) const RUN_OUT_M: f64 = 60.0;
/// Least distance of a corridor's target ahead of the drone, m. 30. By hand.
pub(crate) const LOOK_AHEAD_M: f64 = 30.0;

// ---- Thin-plate matching (`tps.rs`), after Chui and Rangarajan, 2003 ----

/// Initial temperature of the annealing, as a part of the greatest squared distance. No unit. 0.1. Hotter, all drones
/// would be drawn to the centre, and the spline would forget where they are. By hand.
pub(crate) const INITIAL_TEMPERATURE: f64 = 0.1;
/// Final temperature, in the same unit. 1e-5. By hand.
pub(crate) const FINAL_TEMPERATURE: f64 = 1e-5;
/// Factor by which the temperature falls. No unit. 0.8. By hand.
pub(crate) const COOLING: f64 = 0.8;
/// Most Sinkhorn rounds at one temperature. 20. By hand.
pub(crate) const SINKHORN_ROUNDS: usize = 20;
/// Sinkhorn rounds end when no row's scale changes by more than this part of the temperature. No unit. 1e-3. By hand.
pub(crate) const BALANCED: f64 = 1e-3;

/// How far an outline has to reach beyond what is known of it until it counts as grown, m. Chosen by hand: less than the planning
/// distance leaves beyond the clearance. `skein sweep
/// experiments/sensors.toml --set sensors.outline=seen`.
pub(crate) const OUTLINE_GROWTH_M: f64 = 2.0;
/// The same as a part of the distance up to which obstacles are one set, twice the planning distance. The less of the two counts. No
/// unit. 0.05: with the default planning distance, 2 m. By hand.
pub(crate) const OUTLINE_GROWTH: f64 = 0.05;
/// In how many intervals of the gossip a drone says an obstacle that a plan covers, or that it has passed, to drones that may not know it.
/// No unit. 3: within 1.4 s by default. By hand.
pub(crate) const NEWS_TURNS: u32 = 3;

/// With up to so many drones, slots in a bay are assigned by the lengths of ways. A way is searched from each drone to each slot. By hand.
pub(crate) const MAX_WAYS_DRONES: usize = 64;
