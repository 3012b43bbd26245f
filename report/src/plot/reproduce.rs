//! Figures that compare a mission with a paper: snapshots of the swarm from above, and bar charts.

use super::style::{PALETTE, hex};
use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::formation::mean_distance;
use crate::geometry::outline;
use crate::interruption::Interrupted;
use crate::markup::escaped;
use crate::trace;
use plotters::style::RGBColor;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Length of the track that a snapshot shows behind each drone, s.
const TAIL_S: f64 = 8.0;
/// Time between two points of that track, s.
const STEP_S: f64 = 0.25;
/// Width of a figure, px.
const WIDTH: f64 = 1100.0;

/// A drone in a snapshot.
struct SnapshotDrone {
    position_m: Vec2,
    group: String,
    /// Its track in the last seconds, m.
    tail: Vec<Vec2>,
}

/// The extent of the swarm in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwarmExtent {
    /// Time, s.
    pub t_s: f64,
    /// Extent across the flight direction, m.
    pub width_m: f64,
    /// Mean distance over all pairs of drones, m; 0 for a single drone.
    pub distance_m: f64,
}

/// The living drones at one time.
struct Snapshot {
    t_s: f64,
    drones: Vec<SnapshotDrone>,
}

/// Snapshots of a recorded run, and the extents of the swarm over the whole run.
pub struct Snapshots {
    /// In order of time.
    snapshots: Vec<Snapshot>,
    /// Least and greatest corner of the box around all tracks, m.
    corners: (Vec2, Vec2),
    /// Of each tick.
    extents: Vec<SwarmExtent>,
}

impl Snapshots {
    /// Reads the trace of a run and takes snapshots at these times, s, which must ascend. For times after the end of the
    /// run, the snapshot is of its last tick.
    ///
    /// # Errors
    /// [`ReportError::Io`], or [`ReportError::Content`] for an invalid trace.
    pub fn read(folder: &RunFolder, times_s: &[f64]) -> Result<Self, ReportError> {
        let mut tails: BTreeMap<usize, Vec<(f64, Vec2)>> = BTreeMap::new();
        let mut found = Self {
            snapshots: Vec::new(),
            corners: (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY)),
            extents: Vec::new(),
        };
        let mut last: Vec<trace::TraceRow> = Vec::new();
        trace::read(folder, &Interrupted::never(), |rows| {
            found.measure(rows);
            for row in rows {
                let tail = tails.entry(row.drone).or_default();
                if tail.last().is_none_or(|(t_s, _)| row.t_s - t_s >= STEP_S) {
                    tail.push((row.t_s, row.position_m));
                }
            }
            while times_s.get(found.snapshots.len()).is_some_and(|&t_s| rows[0].t_s >= t_s) {
                found.snapshots.push(snapshot(rows, &tails));
            }
            last = rows.to_vec();
            Ok(())
        })?;
        if !last.is_empty() {
            let missing = times_s.len().saturating_sub(found.snapshots.len());
            found.snapshots.extend((0..missing).map(|_| snapshot(&last, &tails)));
        }
        Ok(found)
    }

    /// Adds the extent of a tick.
    fn measure(&mut self, rows: &[trace::TraceRow]) {
        let empty = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        let join = |(low, high): (Vec2, Vec2), at: &Vec2| (low.inf(at), high.sup(at));
        let (low, high) = rows.iter().map(|row| &row.position_m).fold(empty, join);
        self.corners = join(join(self.corners, &low), &high);
        let positions: Vec<Vec2> = rows.iter().map(|row| row.position_m).collect();
        let distance_m = mean_distance(&positions);
        self.extents.push(SwarmExtent { t_s: rows[0].t_s, width_m: high.y - low.y, distance_m });
    }

    /// The extents of all ticks between these times, s.
    pub fn extents(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &SwarmExtent> {
        self.extents.iter().filter(move |extent| (from_s..=to_s).contains(&extent.t_s))
    }

    /// Names of the groups in the snapshot with this index, sorted.
    #[must_use]
    pub fn groups(&self, index: usize) -> Vec<&str> {
        let drones = self.snapshots.get(index).map_or(&[][..], |snapshot| &snapshot.drones);
        let mut groups: Vec<&str> = drones.iter().map(|drone| drone.group.as_str()).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    /// Draws a panel per snapshot, two in a row, all at the same scale. Returns the SVG.
    #[must_use]
    pub fn draw(&self, facts: &RunFacts, title: &str) -> String {
        let (mut low, mut high) = self.corners;
        for (from, to) in facts.obstacles.iter().map(ConvexShape::bounds) {
            (low, high) = (low.inf(&from), high.sup(&to));
        }
        let edge = Vec2::repeat(15.0);
        let view = View { low: low - edge, high: high + edge };
        let rows = self.snapshots.len().div_ceil(2);
        let height = 70.0 + rows as f64 * view.pitch();
        let mut svg = opening(height, title);
        let colours = self.colours();
        self.draw_legend(&mut svg, &colours);
        for (i, snapshot) in self.snapshots.iter().enumerate() {
            let (x, y) = (14.0 + (i % 2) as f64 * (WIDTH / 2.0), 70.0 + LABEL + (i / 2) as f64 * view.pitch());
            let _ = writeln!(svg, "<g transform=\"translate({x:.0} {y:.0})\">");
            view.draw(&mut svg, facts, &snapshot.drones, &colours);
            let label = format!("t = {:.0} s: {}", snapshot.t_s, self.groups(i).join(", "));
            let _ = writeln!(svg, "<text x=\"0\" y=\"-6\">{}</text></g>", escaped(&label));
        }
        svg.push_str("</svg>\n");
        svg
    }

    fn colours(&self) -> BTreeMap<&str, RGBColor> {
        let groups = (0..self.snapshots.len()).flat_map(|i| self.groups(i));
        let mut colours: BTreeMap<&str, RGBColor> = groups.map(|group| (group, PALETTE[0])).collect();
        for (colour, &next) in colours.values_mut().zip(PALETTE.iter().cycle()) {
            *colour = next;
        }
        colours
    }

    fn draw_legend(&self, svg: &mut String, colours: &BTreeMap<&str, RGBColor>) {
        let mut x = 20.0;
        for (group, colour) in colours {
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.0}\" cy=\"51\" r=\"5\" fill=\"{}\"/><text x=\"{:.0}\" y=\"56\">{}</text>",
                hex(*colour),
                x + 10.0,
                escaped(group)
            );
            x += 34.0 + 8.0 * group.chars().count() as f64;
        }
        let note = format!("behind each drone, its track of the last {TAIL_S:.0} s; flight to the right");
        let _ = writeln!(svg, "<text x=\"{:.0}\" y=\"56\">{note}</text>", x + 10.0);
    }
}

fn snapshot(rows: &[trace::TraceRow], tails: &BTreeMap<usize, Vec<(f64, Vec2)>>) -> Snapshot {
    let t_s = rows[0].t_s;
    let drone = |row: &trace::TraceRow| {
        let tail = tails.get(&row.drone).into_iter().flatten().filter(|point| point.0 >= t_s - TAIL_S);
        let tail = tail.map(|point| point.1).chain([row.position_m]).collect();
        SnapshotDrone { position_m: row.position_m, group: row.group.clone(), tail }
    };
    Snapshot { t_s, drones: rows.iter().map(drone).collect() }
}

/// Room for the label above a panel, px.
const LABEL: f64 = 18.0;

/// The part of the world that each panel shows, m.
struct View {
    low: Vec2,
    high: Vec2,
}

impl View {
    /// Width of a panel, px.
    const PANEL: f64 = WIDTH / 2.0 - 28.0;

    fn scale(&self) -> f64 {
        Self::PANEL / (self.high.x - self.low.x).max(1.0)
    }

    fn height(&self) -> f64 {
        (self.high.y - self.low.y) * self.scale()
    }

    /// From one row of panels to the next, px.
    fn pitch(&self) -> f64 {
        LABEL + self.height() + 18.0
    }

    /// Place of a point in the panel, px.
    fn at(&self, point: Vec2) -> (f64, f64) {
        ((point.x - self.low.x) * self.scale(), (self.high.y - point.y) * self.scale())
    }

    /// Points in the notation of SVG.
    fn path(&self, points: impl Iterator<Item = Vec2>) -> String {
        let places: Vec<String> = points.map(|point| self.at(point)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        places.join(" ")
    }

    fn draw(&self, svg: &mut String, facts: &RunFacts, drones: &[SnapshotDrone], colours: &BTreeMap<&str, RGBColor>) {
        let (width, height) = (Self::PANEL, self.height());
        let _ = writeln!(svg, "<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"none\" stroke=\"#e8e8e8\"/>");
        for shape in &facts.obstacles {
            let corners = self.path(outline(shape).into_iter().map(|(x, y)| Vec2::new(x, y)));
            let _ = writeln!(svg, "<polygon points=\"{corners}\" fill=\"#bebebe\"/>");
        }
        for drone in drones {
            let colour = hex(colours.get(drone.group.as_str()).copied().unwrap_or(PALETTE[0]));
            let tail = self.path(drone.tail.iter().copied());
            let (x, y) = self.at(drone.position_m);
            let _ = writeln!(
                svg,
                "<polyline points=\"{tail}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>\
                 <circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>"
            );
        }
    }
}

/// A bar chart: groups of bars, with one bar of each kind per group.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Title.
    pub title: String,
    /// The quantity and its unit.
    pub y_label: String,
    /// Labels of the kinds in the legend; each kind has a colour.
    pub kinds: Vec<String>,
    /// The groups from left to right.
    pub groups: Vec<BarGroup>,
}

/// A group of [`Bars`].
#[derive(Clone, Debug, PartialEq)]
pub struct BarGroup {
    /// Name, two lines below the bars.
    pub name: [String; 2],
    /// Note above the bars.
    pub note: String,
    /// One value per kind, not negative.
    pub values: Vec<f64>,
}

impl Bars {
    /// Left edge of the bars, px.
    const LEFT: f64 = 30.0;
    /// Upper edge of the tallest bar, px.
    const TOP: f64 = 120.0;
    /// Height of the tallest bar, px.
    const TALL: f64 = 300.0;

    /// Draws each bar with its value above it. Returns the SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let bottom = Self::TOP + Self::TALL;
        let mut svg = opening(bottom + 58.0, &self.title);
        let mut x = Self::LEFT;
        for (kind, colour) in self.kinds.iter().zip(PALETTE.iter().cycle()) {
            let (fill, after) = (hex(*colour), x + 20.0);
            let kind_text = escaped(kind);
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.0}\" y=\"46\" width=\"14\" height=\"14\" fill=\"{fill}\"/>\
                 <text x=\"{after:.0}\" y=\"58\">{kind_text}</text>"
            );
            x += 50.0 + 7.5 * kind.chars().count() as f64;
        }
        let _ = writeln!(svg, "<text x=\"{x:.0}\" y=\"58\">{}</text>", escaped(&self.y_label));
        let highest = self.groups.iter().flat_map(|group| &group.values).fold(f64::MIN_POSITIVE, |a, &b| a.max(b));
        let pitch = (WIDTH - 2.0 * Self::LEFT) / self.groups.len().max(1) as f64;
        for (i, group) in self.groups.iter().enumerate() {
            self.draw_group(&mut svg, group, Self::LEFT + i as f64 * pitch, pitch, Self::TALL / highest);
        }
        let right = WIDTH - Self::LEFT;
        let _ = writeln!(svg, "<path d=\"M{} {bottom}H{right}\" stroke=\"#333\"/>\n</svg>", Self::LEFT);
        svg
    }

    fn draw_group(&self, svg: &mut String, group: &BarGroup, left: f64, pitch: f64, scale: f64) {
        let bottom = Self::TOP + Self::TALL;
        let width = (pitch * 0.84) / group.values.len().max(1) as f64;
        for (i, (value, colour)) in group.values.iter().zip(PALETTE.iter().cycle()).enumerate() {
            let (x, height, fill) = (left + pitch * 0.08 + i as f64 * width, value.max(0.0) * scale, hex(*colour));
            let _ = writeln!(
                svg,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\" fill=\"{fill}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{value:.1}</text>",
                x + 2.0,
                bottom - height,
                width - 4.0,
                x + width / 2.0,
                bottom - height - 6.0
            );
        }
        let middle = left + pitch / 2.0;
        let top = group.values.iter().fold(0.0f64, |a, &b| a.max(b)) * scale;
        let lines =
            [(bottom - top - 26.0, &group.note), (bottom + 20.0, &group.name[0]), (bottom + 38.0, &group.name[1])];
        // The font is small enough for the longest name.
        for (y, line) in lines {
            let text = escaped(line);
            let _ = writeln!(
                svg,
                "<text x=\"{middle:.1}\" y=\"{y:.1}\" font-size=\"12\" text-anchor=\"middle\">{text}</text>"
            );
        }
    }
}

/// The start of an SVG: canvas and title.
fn opening(height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH:.0}\" height=\"{height:.0}\" viewBox=\"0 0 \
         {WIDTH:.0} {height:.0}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"14\" fill=\"#333\">\n\
         <rect width=\"{WIDTH:.0}\" height=\"{height:.0}\" fill=\"#fff\"/>\n\
         <text x=\"20\" y=\"30\" font-size=\"18\">{}</text>\n",
        escaped(title)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    #[test]
    fn snapshots_are_at_the_given_times_or_at_the_end() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut csv = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j\n".to_owned();
        for (t_s, y, group) in [(0.02, 10.0, "N"), (1.0, 40.0, "N1"), (2.0, 20.0, "N1")] {
            writeln!(csv, "{t_s},0,{t_s},0,1,0,50,0,N,,0\n{t_s},1,{t_s},{y},1,0,50,0,{group},,0").unwrap();
        }
        std::fs::write(folder.path().join("trace.csv"), csv).unwrap();
        let found = Snapshots::read(&folder, &[0.0, 0.5, 9.0]).unwrap();
        assert_eq!(found.snapshots.iter().map(|snapshot| snapshot.t_s).collect::<Vec<_>>(), [0.02, 1.0, 2.0]);
        assert_eq!((found.groups(0), found.groups(1)), (vec!["N"], vec!["N", "N1"]));
        let extent = |t_s, m| SwarmExtent { t_s, width_m: m, distance_m: m };
        assert_eq!(found.extents(0.5, 9.0).copied().collect::<Vec<_>>(), [extent(1.0, 40.0), extent(2.0, 20.0)]);
        let svg = found.draw(&facts(2), "a < b");
        assert_eq!(svg.matches("<g ").count(), 3);
        assert!(svg.contains("a &lt; b") && svg.contains("t = 2 s: N, N1"), "{svg}");
    }

    #[test]
    fn bar_heights_are_proportional_to_their_values() {
        let group = BarGroup { name: ["S1".into(), "total".into()], note: "1.50".into(), values: vec![20.0, 30.0] };
        let bars = Bars {
            title: "energy".into(),
            y_label: "kJ".into(),
            kinds: vec!["a".into(), "b".into()],
            groups: vec![group],
        };
        let svg = bars.draw();
        for text in ["height=\"300.0\"", "height=\"200.0\"", ">30.0<", ">1.50<", ">S1<", ">total<", ">kJ<"] {
            assert!(svg.contains(text), "{text} is not in {svg}");
        }
    }
}
