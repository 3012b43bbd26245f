//! What a sweep takes of the figures that pilots report.

use skein_protocol::MetricName;
use skein_report::OwnMetric;
use std::collections::{BTreeMap, BTreeSet};

/// A number that stands for a figure of a run, over its drones and its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OwnStatistic {
    /// The mean of all values.
    Mean,
    /// The mean over drones, in the last tick with a value.
    Last,
    /// The least value.
    Min,
    /// The greatest value.
    Max,
}

/// A name behind `metric.`, which is that of a figure, or of one of its statistics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OwnColumn<'a> {
    /// Name of the figure.
    pub figure: &'a str,
    /// What is taken of it.
    pub statistic: OwnStatistic,
}

impl OwnStatistic {
    const ALL: [Self; 4] = [Self::Mean, Self::Last, Self::Min, Self::Max];

    /// What follows the figure's name.
    fn suffix(self) -> &'static str {
        match self {
            Self::Mean => "",
            Self::Last => ".last",
            Self::Min => ".min",
            Self::Max => ".max",
        }
    }

    /// The number itself.
    pub(crate) fn of(self, figure: &OwnMetric) -> f64 {
        match self {
            Self::Mean => figure.mean,
            Self::Last => figure.last,
            Self::Min => figure.min,
            Self::Max => figure.max,
        }
    }

    /// It in words.
    fn words(self) -> &'static str {
        match self {
            Self::Mean => "mean over drones and time",
            Self::Last => "mean over drones at the end",
            Self::Min => "least over drones and time",
            Self::Max => "greatest over drones and time",
        }
    }
}

impl<'a> OwnColumn<'a> {
    /// What a name stands for: `gap_m.last` for the last value of `gap_m`. `None` if it cannot stand for anything.
    pub(crate) fn parse(name: &'a str) -> Option<Self> {
        let is_name = |figure: &&str| MetricName::new(figure).is_ok();
        let of = |statistic: OwnStatistic| {
            let figure = name.strip_suffix(statistic.suffix()).filter(is_name)?;
            Some(Self { figure, statistic })
        };
        OwnStatistic::ALL.into_iter().rev().find_map(of)
    }

    /// It in words, for an axis.
    pub(crate) fn label(self) -> String {
        format!("{}, {}", self.figure, self.statistic.words())
    }
}

/// The columns of these figures: each figure's mean under its own name, and its other statistics. A figure that is called like a
/// statistic of another one takes its place.
pub(crate) fn own_columns<'a>(figures: &BTreeSet<&'a str>) -> BTreeMap<String, OwnColumn<'a>> {
    let mut columns = BTreeMap::new();
    for statistic in OwnStatistic::ALL.into_iter().rev() {
        let of = |&figure: &&'a str| (format!("{figure}{}", statistic.suffix()), OwnColumn { figure, statistic });
        columns.extend(figures.iter().map(of));
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_ends_in_its_statistic() {
        let parsed = |name| OwnColumn::parse(name).map(|column| (column.figure, column.statistic));
        let (longest, too_long) = (format!("{}.max", "n".repeat(31)), "n".repeat(32));
        assert_eq!(parsed("gap_m"), Some(("gap_m", OwnStatistic::Mean)));
        assert_eq!(parsed("gap_m.last"), Some(("gap_m", OwnStatistic::Last)));
        assert_eq!(parsed("a.b.min"), Some(("a.b", OwnStatistic::Min)));
        assert_eq!(parsed(&longest).map(|found| found.1), Some(OwnStatistic::Max));
        assert_eq!(parsed(&too_long), None);
        assert_eq!(parsed(".last"), Some((".last", OwnStatistic::Mean)));
        assert_eq!((parsed(""), parsed("a b")), (None, None));
        assert_eq!(OwnColumn::parse("gap_m.max").unwrap().label(), "gap_m, greatest over drones and time");
    }

    #[test]
    fn a_figure_takes_the_place_of_a_statistic_that_is_called_like_it() {
        let figures = ["gap", "gap.last"].into();
        let columns = own_columns(&figures);
        let names: Vec<&str> = columns.keys().map(String::as_str).collect();
        assert_eq!(names, ["gap", "gap.last", "gap.last.last", "gap.last.max", "gap.last.min", "gap.max", "gap.min"]);
        assert_eq!(columns["gap.last"], OwnColumn { figure: "gap.last", statistic: OwnStatistic::Mean });
        assert_eq!(columns["gap.max"], OwnColumn { figure: "gap", statistic: OwnStatistic::Max });
    }
}
