//! A drone that nobody hears gets no part in the formation. It joins all the same: at the end of it.

use crate::guidance::anchor;
use skein_protocol::formation::Shape;
use skein_protocol::payload::Plan;
use skein_protocol::{GroupId, MessageRef, Phase, SimTime, Vec2};

/// Who is followed by nobody for so long is heard by nobody, s.
const UNHEARD_S: f64 = 5.0;

/// What a drone knows of the formation of others, and since when none of them follows it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stray {
    /// The latest formation of all, in whatever term.
    formation: Option<Plan>,
    unfollowed: Option<SimTime>,
}

impl Stray {
    /// Hears of formations.
    pub fn hear(&mut self, message: MessageRef<'_>) {
        let MessageRef::Plan(plan) = message else { return };
        let later = self.formation.is_none_or(|known| plan.stamp > known.stamp);
        if later && plan.phase() == Phase::Reform && plan.group == GroupId::ALL {
            self.formation = Some(*plan);
        }
    }

    /// Where it is to fly, m, and how that place moves, m/s, once it has been `unfollowed` for long: one slot more than
    /// the others' formation has.
    pub fn slot(&mut self, now: SimTime, unfollowed: bool, shape: &Shape, spacing_m: f64) -> Option<(Vec2, Vec2)> {
        self.unfollowed = unfollowed.then(|| self.unfollowed.unwrap_or(now));
        let unheard = self.unfollowed.is_some_and(|since| now.since(since) >= UNHEARD_S);
        let plan = self.formation.as_ref().filter(|_| unheard)?;
        let (front, velocity) = anchor(plan, now);
        Some((front + *shape.slots(plan.members as usize + 1, spacing_m).last()?, velocity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn who_is_not_heard_takes_the_next_slot_until_it_is_followed() {
        let plan = Plan { phase: Phase::Reform.to_wire(), members: 2, anchor_m: [50.0, 7.0], ..Plan::zeroed() };
        let shape = Shape::Offsets(vec![[0.0, 0.0], [-10.0, 0.0], [-20.0, 5.0]]);
        let mut stray = Stray::default();
        let slot =
            |stray: &mut Stray, now_s, unfollowed| stray.slot(SimTime::from_secs(now_s), unfollowed, &shape, 10.0);
        assert_eq!(slot(&mut stray, 0.0, true), None);
        assert_eq!(slot(&mut stray, 6.0, true), None, "it knows of no formation");
        stray.hear(MessageRef::Plan(&plan));
        assert_eq!(slot(&mut stray, 6.1, true), Some((Vec2::new(30.0, 12.0), Vec2::zeros())));
        assert_eq!(slot(&mut stray, 6.2, false), None);
        assert_eq!(slot(&mut stray, 6.3, true), None, "it may be for a moment only");
    }
}
