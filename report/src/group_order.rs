//! The colours of groups: the order in which groups appear in the samples of a run.

use crate::palette::GROUP_COLOURS;

/// The groups of a run in the order in which they appear. The page, the plots, the animation and the recording colour by it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GroupOrder(Vec<String>);

impl GroupOrder {
    /// The colour of a group, as red, green and blue. A new group gets the next one.
    pub(crate) fn colour(&mut self, group: &str) -> (u8, u8, u8) {
        let place = self.0.iter().position(|known| known == group).unwrap_or_else(|| {
            self.0.push(group.to_owned());
            self.0.len() - 1
        });
        GROUP_COLOURS[place % GROUP_COLOURS.len()]
    }

    /// Adds the groups of the drones of a sample.
    pub(crate) fn note(&mut self, groups: &[String]) {
        for group in groups {
            self.colour(group);
        }
    }

    /// The groups.
    pub(crate) fn names(&self) -> &[String] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_keeps_its_colour() {
        let mut order = GroupOrder::default();
        order.note(&["N".to_owned(), "N2".to_owned(), "N".to_owned()]);
        assert_eq!(order.names(), ["N", "N2"]);
        assert_eq!((order.colour("N2"), order.colour("N1")), (GROUP_COLOURS[1], GROUP_COLOURS[2]));
    }
}
