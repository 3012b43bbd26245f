//! A greedy matching of drones and slots. The exact one is [`skein_protocol::matching`].

/// Takes the cheapest pair of what is left, again and again. The lower drone wins a tie, then the lower slot. Returns the
/// slot of each drone by index. `slots` must be at least `drones`.
pub(crate) fn cheapest_first(drones: usize, slots: usize, cost: &impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut free: Vec<usize> = (0..slots).collect();
    let best = |drone: usize, free: &[usize]| {
        let offers = free.iter().map(|&slot| (cost(drone, slot), slot));
        offers.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    };
    let mut waiting: Vec<(usize, (f64, usize))> = (0..drones).map(|drone| (drone, best(drone, &free))).collect();
    let mut taken = vec![0; drones];
    while let Some(next) = (0..waiting.len()).min_by(|&a, &b| waiting[a].1.0.total_cmp(&waiting[b].1.0)) {
        let (drone, (_, slot)) = waiting.remove(next);
        taken[drone] = slot;
        free.retain(|&other| other != slot);
        for (other, offer) in waiting.iter_mut().filter(|(_, offer)| offer.1 == slot) {
            *offer = best(*other, &free);
        }
    }
    taken
}
