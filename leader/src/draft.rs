//! A new plan of a leader, before its assignments are made.

use crate::obstacles::set_array;
use crate::situation::Situation;
use skein_protocol::payload::Plan;
use skein_protocol::{ObstacleId, Phase, PlanStamp, Vec2};

/// The part of a new plan that all its drones share, under the next epoch of the leader's term. `anchor`: where the front
/// slot is now, world frame, m; not used while avoiding. An anchor that is already at its stop does not move.
pub(crate) fn draft(s: &Situation<'_>, phase: Phase, set: &[ObstacleId], anchor: Vec2) -> Plan {
    let stop_x_m = s.params.destination.stop_x_m();
    let moving = phase != Phase::Avoid && anchor.x < stop_x_m;
    let newest = s.ledger.newest();
    let epoch = if newest.ballot == s.ballot { newest.epoch.saturating_add(1) } else { 1 };
    let (set, set_count) = set_array(set);
    Plan {
        stamp: s.now,
        id: PlanStamp { ballot: s.ballot, epoch },
        group: s.scope,
        phase: phase.to_wire(),
        members: s.members.len() as u32,
        anchor_m: if phase == Phase::Avoid { [0.0; 2] } else { anchor.into() },
        anchor_mps: [if moving { s.params.speed_mps } else { 0.0 }, 0.0],
        anchor_stop_x_m: stop_x_m,
        predicted_s: f64::NAN,
        candidates: 0,
        routes: 0,
        set_count,
        set,
        course: 0,
    }
}
