//! The tuned numbers of this crate, each with its unit, how it was found, and the command that finds it again.
//!
//! Where a number was chosen by hand, the named command shows what another value does.

/// Time between two looks whether a known obstacle blocks the planned route, s. Chosen by hand: short against the time in which a
/// drone reaches an obstacle that it has just sensed.
pub(crate) const ROUTE_CHECK_S: f64 = 0.5;

/// Age up to which a beacon shows what its drone does now, s. Chosen by hand: a few beacon periods. `skein sweep
/// experiments/delay-loss.toml`.
pub(crate) const FRESH_BEACON_S: f64 = 0.3;

/// Distance up to which a neighbour counts that is known by beacon alone, in safe distances. Chosen by hand. `skein sweep
/// experiments/silence.toml`.
pub(crate) const BEACON_REACH: f64 = 4.0;

/// Radius of the disc that paths keep around a silent drone, in safe distances. Chosen by hand: a little more than the
/// safety filter keeps, so that the filter need not act. `skein sweep experiments/faults.toml`.
pub(crate) const SILENT_DRONE_RADIUS: f64 = 1.1;

/// Speed below which a drone counts as still, m/s, at full [`Scale`](skein_protocol::scale::Scale). Chosen by hand. `skein sweep
/// experiments/wide-scenes.toml`.
pub(crate) const STILL_MPS: f64 = 0.3;

/// How long a drone on its route waits before it escapes from where it is stuck, s. Chosen by hand. `skein sweep
/// experiments/random-scenes.toml`.
pub(crate) const PATIENCE_ON_ROUTE_S: f64 = 3.0;

/// How long a drone in formation waits before it escapes from where it is stuck, s. Chosen by hand: longer than the
/// leader takes to open the formation. `skein sweep experiments/faults.toml`.
pub(crate) const PATIENCE_IN_FORMATION_S: f64 = 8.0;

/// How long a drone keeps to a formation of another term than its leader's, s. Chosen by hand. `skein sweep
/// experiments/silence.toml`.
pub(crate) const STALE_FORMATION_S: f64 = 5.0;

/// Speed at which a drone flies back out of a blocked gap, as a share of its nominal speed. Chosen by hand. `skein sweep
/// experiments/faults.toml`.
pub(crate) const BACK_OUT_SPEED: f64 = 0.5;

/// Least speed at which a drone escapes from where it is stuck, as a share of its nominal speed: its slowest speed in a queue may be 0.
/// Chosen by hand.
pub(crate) const LEAST_ESCAPE_SPEED: f64 = 0.5;

/// How long a leader waits for a follower before it assumes that no drone hears it, s. Chosen by hand. `skein sweep
/// experiments/silence.toml`.
pub(crate) const UNHEARD_S: f64 = 5.0;

/// How far a drone without a task flies ahead of the last drone, as time at nominal speed, s; a headway per drone is added.
/// Chosen by hand: the paper's longest passage takes half of it. `skein sweep experiments/wide-scenes.toml`.
pub(crate) const LEAD_S: f64 = 60.0;

/// A drone without a task stays within this share of the distance over which drones hear each other from the nearest other one. So does a
/// drone that leads a lost one. Chosen by hand.
pub(crate) const IN_REACH: f64 = 0.75;

/// A drone looks for a lost one after it has stayed in one place for this long, s; a headway per drone is added. Chosen by hand: longer
/// than groups take to become one.
pub(crate) const LOOK_FOR_LOST_S: f64 = 30.0;

/// A drone counts as staying in one place while it moves at less than this share of its nominal speed on average. Chosen by hand: a drone
/// that escapes from where it is stuck stays in this place.
pub(crate) const LOST_PACE: f64 = 0.25;

/// How long a drone stays with a lost one that it has found, s. Chosen by hand: twice as long as it waits before it looks for one.
pub(crate) const LEAD_FOUND_S: f64 = 60.0;

/// How far beyond the goal a drone without a task waits, as time at nominal speed, s; a headway per drone is added. Chosen by
/// hand: the length of a formation. `skein sweep experiments/wide-scenes.toml`.
pub(crate) const OVERSHOOT_S: f64 = 10.0;

/// Radius of the disc that a drone's own path keeps around a dead drone that hangs still, in safe distances. No unit. 1.04: slots are farther
/// away ([`SLOT_BERTH`](skein_protocol::formation::SLOT_BERTH)), and the safety filter keeps less. By calculation.
pub(crate) const HANGING_RADIUS: f64 = 1.04;

/// A silent drone that has hung still for this long is dead, as far as paths are concerned, s. 10. By hand: long, because
/// a living drone that waits in a queue may be silent for a while on a bad link.
pub(crate) const HANGS_S: f64 = 10.0;

/// The same for a drone that hears no other, s. 30. By hand: it may be deaf, and the others wait in a queue. If it is the last one, the
/// others hang for ever.
pub(crate) const HANGS_UNHEARD_S: f64 = 30.0;

/// A drone closer than this part of the ranging distance is ranged, unless something is between. No unit. 0.5. By hand.
pub(crate) const NEAR_RANGING: f64 = 0.5;

/// A dead drone that is near and was not ranged for this long has landed, s. 1. By hand: longer than a sensor drops out.
pub(crate) const UNSEEN_S: f64 = 1.0;

/// Once an outline has grown, a drone leaves its route if that is longer than another one by this factor. No unit. 3. By hand: with
/// 1.5 so many drones lose their places in queues that narrow gaps jam.
pub(crate) const LONG_ROUTE: f64 = 3.0;

/// A drone without an obstacle sensor flies on others' word of obstacles if it has heard of one whose sensors work within this time, beside the
/// radio's delay, s. 3. By hand: longer than states take that are passed on.
pub(crate) const GUIDE_S: f64 = 3.0;

/// Drift of a silent drone after which the corridor is drawn again, m. Chosen by hand.
pub(crate) const REDRAW_DRIFT_M: f64 = 1.0;

/// The same as a part of the radius of the disc around that drone. The less of the two counts. Chosen by hand.
pub(crate) const REDRAW_DRIFT: f64 = 0.04;

/// Closing speed per distance to the slot, 1/s. Chosen by hand. `skein reproduce`.
pub(crate) const APPROACH_PER_S: f64 = 0.8;

/// How long a leader simulates before it decides, s: the paper's t_c. Chosen by hand: enough for the alternatives of the
/// paper's scenarios. `skein reproduce`.
pub(crate) const DELIBERATION_S: f64 = 1.0;

/// Length of a simulated step, s; never shorter than a tick. Chosen by hand: the forecast of the pass time stays within a
/// quarter of a second. `cargo test -p skein-runtime --test rehearsal`.
pub(crate) const ROLLOUT_STEP_S: f64 = 0.1;

/// Drone-steps simulated in a second of flight, spread evenly over its ticks. Chosen by hand: what one core can do in real
/// time. `skein bench runtime`.
pub(crate) const DRONE_STEPS_PER_S: f64 = 120_000.0;

/// Simulated time after which an alternative has failed, s. Chosen by hand: several times the length of a flight of the
/// paper. `skein reproduce`.
pub(crate) const ROLLOUT_HORIZON_S: f64 = 200.0;

/// Saving that an alternative needs over the shortest paths, as a share of their cost. Chosen by hand: the accuracy of a
/// forecast. `skein reproduce`.
pub(crate) const MIN_SAVING: f64 = 0.03;

/// The same while unknown obstacles may come, because these may undo a saving. Chosen by hand. `skein sweep
/// experiments/random-scenes.toml`.
pub(crate) const MIN_SAVING_UNSEEN: f64 = 0.2;

/// Share of the shortest paths' pass time that an alternative with [`MIN_SAVING`] has to save while unknown obstacles may
/// come. Chosen by hand. `skein sweep experiments/random-scenes.toml`.
pub(crate) const MIN_TIME_SAVING_UNSEEN: f64 = 0.185;

/// The same for an alternative whose paths are no longer and which costs no more: later obstacles cannot undo that.
/// Chosen by hand. `skein sweep experiments/random-scenes.toml`.
pub(crate) const MIN_TIME_SAVING_SAME_LENGTH: f64 = 0.09;

/// Least length that another obstacle set needs ahead, in planning distances. Chosen by hand. `skein sweep
/// experiments/random-scenes.toml`.
pub(crate) const ROOM_FOR_A_SET: f64 = 3.0;

/// Greatest speed at which a drone returns to its altitude, m/s. Chosen by hand; no command measures it.
pub(crate) const CLIMB_MPS: f64 = 2.0;

/// Climb speed per error of the altitude, 1/s. Chosen by hand; no command measures it.
pub(crate) const ALTITUDE_GAIN_PER_S: f64 = 0.5;

/// Vertical acceleration per error of the climb speed, 1/s. Chosen by hand; no command measures it.
pub(crate) const CLIMB_GAIN_PER_S: f64 = 2.0;

/// Share of the acceleration that the horizontal command leaves which may be vertical. Chosen by hand, below 1, so that rounding never
/// shortens the horizontal part.
pub(crate) const CLIMB_SHARE: f64 = 0.99;

/// Time after which a line is passed on whose two drones may be out of each other's reach, s: at most; less for drones that are nearer to
/// the one it is meant for. Chosen by hand. `skein sweep experiments/wide-presets.toml --set sensors.ranging=false`.
pub(crate) const LINE_FIRST_S: f64 = 0.5;

/// Time after which a drone passes a line on again, s. It is doubled each time. Chosen by hand. The same command.
pub(crate) const LINE_REPEAT_S: f64 = 1.0;

/// Two drones that are nearer to each other than this, as a share of the distance over which a drone hears others, are taken to hear each
/// other: what they say to each other is passed on most rarely. Chosen by hand. The same command.
pub(crate) const LINE_NEAR: f64 = 0.5;

/// Number of nearer drones that have to say a line before a drone does not, in one turn. Chosen by hand: with one, a line would be lost
/// where that one does not reach the drone it is meant for. The same command.
pub(crate) const LINE_REDUNDANCY: u32 = 2;

/// How long a line is not passed on after it was answered, s. Chosen by hand: longer than two drones that hear each other take for an
/// answer. The same command.
pub(crate) const LINE_ANSWERED_S: f64 = 2.0;

/// How long a drone remembers a line that it does not hear any more, s. Chosen by hand: longer than the longest time between two
/// repetitions. The same command.
pub(crate) const LINE_FORGET_S: f64 = 30.0;
