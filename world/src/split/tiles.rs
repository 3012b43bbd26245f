//! How space is divided among parts.

use crate::tuning::ROUNDING_M;
use skein_protocol::Vec2;

/// A division of the plane into tiles, one per part. The tiles move along x with the swarm.
#[derive(Clone, Debug)]
pub struct Tiles {
    root: Tile,
    count: usize,
    speed_mps: f64,
}

#[derive(Clone, Debug)]
enum Tile {
    Part(usize),
    /// A cut across x (axis 0) or y (axis 1) at this coordinate, m: what is below it, and the rest.
    Cut {
        axis: usize,
        at_m: f64,
        below: Box<Tile>,
        rest: Box<Tile>,
    },
}

impl Tiles {
    /// Divides the plane into `count` tiles with about as many of these places (m) each, by cuts across the longer side. The tiles
    /// move along x with this speed, m/s.
    #[must_use]
    pub fn new(places_m: &[Vec2], count: usize, speed_mps: f64) -> Self {
        let count = count.max(1);
        let mut places = places_m.to_vec();
        Self { root: divide(&mut places, 0, count), count, speed_mps }
    }

    /// Number of tiles.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The part whose tile holds a place (m) at a time, s.
    #[must_use]
    pub fn owner(&self, place_m: Vec2, now_s: f64) -> usize {
        let place = self.moved(place_m, now_s);
        let mut tile = &self.root;
        loop {
            match tile {
                Tile::Part(part) => return *part,
                Tile::Cut { axis, at_m, below, rest } => tile = if place[*axis] < *at_m { below } else { rest },
            }
        }
    }

    /// Calls `visit` with each part whose tile comes within a distance (m) of a place (m) at a time, s; perhaps with some others.
    pub fn each_near(&self, place_m: Vec2, distance_m: f64, now_s: f64, visit: &mut impl FnMut(usize)) {
        near(&self.root, self.moved(place_m, now_s), distance_m + ROUNDING_M, visit);
    }

    fn moved(&self, place_m: Vec2, now_s: f64) -> Vec2 {
        Vec2::new(place_m.x - self.speed_mps * now_s, place_m.y)
    }
}

fn near(tile: &Tile, place: Vec2, distance_m: f64, visit: &mut impl FnMut(usize)) {
    match tile {
        Tile::Part(part) => visit(*part),
        Tile::Cut { axis, at_m, below, rest } => {
            if place[*axis] - distance_m < *at_m {
                near(below, place, distance_m, visit);
            }
            if place[*axis] + distance_m >= *at_m {
                near(rest, place, distance_m, visit);
            }
        }
    }
}

fn divide(places: &mut [Vec2], first: usize, count: usize) -> Tile {
    if count == 1 {
        return Tile::Part(first);
    }
    let extent = |axis: usize| {
        let values = places.iter().map(|place| place[axis]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    let axis = usize::from(extent(1) > extent(0));
    places.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
    let below = count / 2;
    let cut = places.len() * below / count;
    // Between two places, so that a drone does not begin on the edge.
    let at_m = match (cut.checked_sub(1).and_then(|before| places.get(before)), places.get(cut)) {
        (Some(before), Some(after)) => (before[axis] + after[axis]) / 2.0,
        (_, Some(after)) => after[axis],
        (Some(before), None) => before[axis],
        (None, None) => 0.0,
    };
    let (low, high) = places.split_at_mut(cut);
    Tile::Cut {
        axis,
        at_m,
        below: Box::new(divide(low, first, below)),
        rest: Box::new(divide(high, first + below, count - below)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn tiles_hold_about_as_many_places_each_and_move() {
        let places: Vec<Vec2> = (0..64).map(|i| Vec2::new(f64::from(i % 8) * 10.0, f64::from(i / 8) * 10.0)).collect();
        for count in [1, 2, 3, 4, 16] {
            let tiles = Tiles::new(&places, count, 12.0);
            let mut held = vec![0; count];
            places.iter().for_each(|&place| held[tiles.owner(place, 0.0)] += 1);
            let (least, most) = (held.iter().min().unwrap(), held.iter().max().unwrap());
            assert!(most - least <= 8, "{count} tiles: {held:?}");
            for &place in &places {
                let later = place + Vec2::new(24.0, 0.0);
                assert_eq!(tiles.owner(place, 0.0), tiles.owner(later, 2.0));
            }
        }
    }

    proptest! {
        #[test]
        fn whoever_is_near_a_place_is_in_a_tile_near_it(
            places in prop::collection::vec([-200f64..200.0, -200f64..200.0], 1..60),
            here in [-300f64..300.0, -300f64..300.0],
            there in [-300f64..300.0, -300f64..300.0],
            (count, now_s) in (1usize..17, 0f64..100.0),
        ) {
            let places: Vec<Vec2> = places.into_iter().map(Vec2::from).collect();
            let (here, there) = (Vec2::from(here), Vec2::from(there));
            let tiles = Tiles::new(&places, count, 10.0);
            let mut found = Vec::new();
            tiles.each_near(here, (there - here).norm(), now_s, &mut |part| found.push(part));
            prop_assert!(found.contains(&tiles.owner(there, now_s)));
            prop_assert!(found.iter().all(|&part| part < count));
        }
    }
}
