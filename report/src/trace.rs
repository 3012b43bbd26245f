//! trace.csv: the state of each drone in each tick.

use crate::error::ReportError;
use crate::files::TRACE;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use crate::table::{Cell, Column, ColumnKind, CsvReader, CsvWriter};
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::record::DroneRow;
use skein_protocol::telemetry::TelemetryRow;
use skein_protocol::{MetricName, Vec2};
use std::collections::BTreeSet;
use std::io::{self, BufReader, Write};

/// Number of columns.
const COUNT: usize = 20;
/// The columns. New ones come last, and readers find a column by its name.
pub(crate) static COLUMNS: [Column; COUNT] = [
    Column::new("t_s", ColumnKind::Number),
    Column::new("drone", ColumnKind::Whole),
    Column::new("x_m", ColumnKind::Number),
    Column::new("y_m", ColumnKind::Number),
    Column::new("vx_mps", ColumnKind::Number),
    Column::new("vy_mps", ColumnKind::Number),
    Column::new("group", ColumnKind::Text),
    Column::new("leader", ColumnKind::Whole),
    Column::new("energy_j", ColumnKind::Number),
    Column::new("z_m", ColumnKind::Number),
    Column::new("vz_mps", ColumnKind::Number),
    Column::new("ax_mps2", ColumnKind::Number),
    Column::new("ay_mps2", ColumnKind::Number),
    Column::new("az_mps2", ColumnKind::Number),
    Column::new("phase", ColumnKind::Text),
    Column::new("route", ColumnKind::Whole),
    Column::new("rank", ColumnKind::Whole),
    Column::new("alive", ColumnKind::Flag),
    Column::new("heard", ColumnKind::Whole),
    Column::new("dropped", ColumnKind::Whole),
];

/// What the column of a name holds. A column that is not in [`COLUMNS`] is a figure of a pilot's own.
pub(crate) fn kind(name: &str) -> ColumnKind {
    COLUMNS.iter().find(|column| column.name == name).map_or(ColumnKind::Number, |column| column.kind)
}

/// Writes the trace.
pub(crate) struct TraceWriter<W: Write> {
    out: CsvWriter<W>,
    /// The figures of pilots, each of which has a column.
    metrics: Vec<MetricName>,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header. `metrics` are the figures that pilots report.
    pub(crate) fn new(out: W, metrics: &BTreeSet<MetricName>) -> io::Result<Self> {
        let own = |name| Column { name: format!("metric.{name}").into(), kind: ColumnKind::Number };
        let columns: Vec<Column> = COLUMNS.iter().cloned().chain(metrics.iter().map(own)).collect();
        Ok(Self { out: CsvWriter::new(out, &columns)?, metrics: metrics.iter().copied().collect() })
    }

    /// Writes all drones of one tick, and the figures that they report.
    pub(crate) fn tick(&mut self, t_s: f64, rows: &[DroneRow], telemetry: &[TelemetryRow]) -> io::Result<()> {
        rows.iter().zip(0..).try_for_each(|(row, drone)| self.row(t_s, drone, row, telemetry))
    }

    fn row(&mut self, t_s: f64, drone: u32, row: &DroneRow, telemetry: &[TelemetryRow]) -> io::Result<()> {
        let group = row.group.to_string();
        let [x, y, z] = row.position_m.map(Cell::from);
        let [vx, vy, vz] = row.velocity_mps.map(Cell::from);
        let [ax, ay, az] = row.commanded_mps2.map(Cell::from);
        let route = (row.route != NO_ROUTE && row.obeyed.ballot.is_some()).then_some(row.route);
        let dropped = row.dropped.iter().fold(0u32, |sum, &count| sum.saturating_add(count));
        let leader = row.leader().map(|leader| leader.0);
        let cells: [Cell<'_>; COUNT] = [
            t_s.into(),
            drone.into(),
            x,
            y,
            vx,
            vy,
            group.as_str().into(),
            leader.into(),
            row.energy_j.into(),
            z,
            vz,
            ax,
            ay,
            az,
            row.phase().name().into(),
            route.into(),
            route.map(|_| row.rank).into(),
            row.alive().into(),
            row.heard.into(),
            dropped.into(),
        ];
        let cells: Vec<Cell<'_>> = cells.into_iter().chain(self.metrics(drone, telemetry)).collect();
        self.out.row(&cells)
    }

    /// The figures of a drone, empty where it reports none.
    fn metrics<'c>(&self, drone: u32, telemetry: &[TelemetryRow]) -> Vec<Cell<'c>> {
        let first = telemetry.partition_point(|row| row.drone.0 < drone);
        let own = telemetry[first..].iter().take_while(|row| row.drone.0 == drone);
        let of = |name: &MetricName| own.clone().filter_map(TelemetryRow::metric).find(|(known, _)| known == name);
        self.metrics.iter().map(|name| of(name).map(|(_, value)| value).into()).collect()
    }

    /// Writes what is still buffered.
    pub(crate) fn finish(self) -> io::Result<()> {
        self.out.finish().map(drop)
    }
}

/// The state of a living drone in a tick, as read from the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TraceRow {
    pub t_s: f64,
    pub drone: usize,
    pub position_m: Vec2,
    pub velocity_mps: Vec2,
    pub altitude_m: f64,
    pub group: String,
    pub energy_j: f64,
    /// The figures that its pilot reports, in the order of the columns.
    pub metrics: Vec<Option<f64>>,
}

/// What the names of the columns of figures begin with.
const METRIC: &str = "metric.";
/// What a trace must have.
const EXPECTED: &str = "a trace with the columns t_s, drone, x_m, y_m, vx_mps, vy_mps, z_m, group and energy_j";

/// Places of the columns that are read.
struct Places {
    numbers: [usize; 8],
    group: usize,
    /// A trace without this column has only living drones.
    alive: Option<usize>,
    /// The columns of figures that pilots report.
    metrics: Vec<usize>,
    count: usize,
}

impl Places {
    fn of(header: &[String]) -> Option<Self> {
        let place = |name: &str| header.iter().position(|column| column == name);
        let mut numbers = [0; 8];
        let names = ["t_s", "drone", "x_m", "y_m", "vx_mps", "vy_mps", "z_m", "energy_j"];
        for (number, name) in numbers.iter_mut().zip(names) {
            *number = place(name)?;
        }
        let metrics = (0..header.len()).filter(|&i| header[i].starts_with(METRIC)).collect();
        Some(Self { numbers, group: place("group")?, alive: place("alive"), metrics, count: header.len() })
    }

    /// The row of these fields: `Some(None)` for a dead drone, `None` for an invalid row.
    fn row(&self, fields: &[String]) -> Option<Option<TraceRow>> {
        if fields.len() != self.count {
            return None;
        }
        if self.alive.is_some_and(|alive| fields[alive] == "0") {
            return Some(None);
        }
        let mut numbers = [0.0; 8];
        for (number, &place) in numbers.iter_mut().zip(&self.numbers) {
            *number = fields[place].parse().ok().filter(|value: &f64| value.is_finite())?;
        }
        let [t_s, drone, x, y, vx, vy, altitude_m, energy_j] = numbers;
        let (position_m, velocity_mps) = (Vec2::new(x, y), Vec2::new(vx, vy));
        let group = fields[self.group].clone();
        let metrics = self.metrics.iter().map(|&place| fields[place].parse().ok()).collect();
        let drone = drone as usize;
        Some(Some(TraceRow { t_s, drone, position_m, velocity_mps, altitude_m, group, energy_j, metrics }))
    }
}

/// Reads the trace of a run, and calls `tick` with the rows of the living drones in each tick, in which any lives. Returns the
/// names of the figures that pilots report.
pub(crate) fn read(
    folder: &RunFolder,
    interrupted: &Interrupted<'_>,
    mut tick: impl FnMut(&[TraceRow]) -> Result<(), ReportError>,
) -> Result<Vec<String>, ReportError> {
    let path = folder.path().join(TRACE);
    let (mut lines, mut fields) = (CsvReader::new(BufReader::new(folder.files().read(TRACE)?)), Vec::new());
    let content = |found: String| ReportError::Content { path: path.clone(), expected: EXPECTED, found };
    let found = |lines: &CsvReader<_>| content(format!("line {} is \"{}\"", lines.line_number(), lines.line()));
    lines.read(&mut fields).map_err(ReportError::io(&path))?;
    let places = Places::of(&fields).ok_or_else(|| found(&lines))?;
    let names = places.metrics.iter().map(|&place| fields[place][METRIC.len()..].to_owned()).collect();
    let mut rows: Vec<TraceRow> = Vec::new();
    while lines.read(&mut fields).map_err(ReportError::io(&path))? {
        let Some(row) = places.row(&fields).ok_or_else(|| found(&lines))? else { continue };
        if rows.first().is_some_and(|first| first.t_s != row.t_s) {
            interrupted.check()?;
            tick(&rows)?;
            rows.clear();
        }
        rows.push(row);
    }
    if !rows.is_empty() {
        tick(&rows)?;
    }
    Ok(names)
}

/// Leaves every `every`-th tick of the trace in the file, beginning with the first one, and the last tick.
pub(crate) fn thin(folder: &RunFolder, every: u64, interrupted: &Interrupted<'_>) -> Result<(), ReportError> {
    let written = begin_thinned(folder, every, interrupted);
    if written.is_err() {
        folder.files().give_up(TRACE);
    }
    written.and_then(|()| folder.files().keep(TRACE))
}

fn begin_thinned(folder: &RunFolder, every: u64, interrupted: &Interrupted<'_>) -> Result<(), ReportError> {
    let path = folder.path().join(TRACE);
    let io = || ReportError::io(&path);
    let (mut lines, mut fields) = (CsvReader::new(BufReader::new(folder.files().read(TRACE)?)), Vec::new());
    let mut out = io::BufWriter::new(folder.files().begin(TRACE)?);
    lines.read(&mut fields).map_err(io())?;
    writeln!(out, "{}", lines.line()).map_err(io())?;
    // The lines of the present tick, and its time. The first column is the time.
    let (mut tick, mut t_s, mut place) = (String::new(), None, 0u64);
    while lines.read(&mut fields).map_err(io())? {
        if t_s.as_ref() != fields.first() {
            interrupted.check()?;
            if t_s.is_some() && place.is_multiple_of(every) {
                out.write_all(tick.as_bytes()).map_err(io())?;
            }
            place += u64::from(t_s.is_some());
            tick.clear();
            t_s = fields.first().cloned();
        }
        tick += lines.line();
        tick.push('\n');
    }
    out.write_all(tick.as_bytes()).and_then(|()| out.flush()).map_err(io())
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::ROW_ALIVE;
    use skein_protocol::telemetry::Telemetry;
    use skein_protocol::{Ballot, DroneId, GroupId, Phase, PlanStamp};

    fn rows() -> [DroneRow; 3] {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(2) };
        let row = DroneRow {
            position_m: [0.1, -35.0, 50.0],
            velocity_mps: [10.0, 1e-7, -2.0],
            energy_j: 2.5,
            commanded_mps2: [f64::NAN; 3],
            flags: ROW_ALIVE,
            ..DroneRow::default()
        };
        let led = DroneRow {
            obeyed: PlanStamp { ballot, epoch: 1 },
            group: GroupId::ALL.child(1).child(2),
            commanded_mps2: [0.5, -0.25, 0.0],
            phase: Phase::Avoid.to_wire(),
            route: 1,
            rank: 3,
            heard: 4,
            dropped: [1, 2, 3, 0, 0, 0, 0],
            ..row
        };
        [row, DroneRow::default(), led]
    }

    #[test]
    fn all_drones_are_written_in_full() {
        let mut bytes = Vec::new();
        TraceWriter::new(&mut bytes, &BTreeSet::new()).unwrap().tick(0.02, &rows(), &[]).unwrap();
        let wanted = "t_s,drone,x_m,y_m,vx_mps,vy_mps,group,leader,energy_j,z_m,vz_mps,ax_mps2,ay_mps2,az_mps2,phase,route,\
            rank,alive,heard,dropped\n\
            0.02,0,0.1,-35.0,10.0,1e-7,N,,2.5,50.0,-2.0,,,,cruise,,,1,0,0\n\
            0.02,1,0.0,0.0,0.0,0.0,N,,0.0,0.0,0.0,0.0,0.0,0.0,cruise,,,0,0,0\n\
            0.02,2,0.1,-35.0,10.0,1e-7,N12,2,2.5,50.0,-2.0,0.5,-0.25,0.0,avoid,1,3,1,4,6\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), wanted);
    }

    #[test]
    fn a_written_trace_is_read_tick_by_tick() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut writer = TraceWriter::new(folder.files().create(TRACE).unwrap(), &BTreeSet::new()).unwrap();
        writer.tick(0.02, &rows(), &[]).unwrap();
        writer.tick(0.04, &rows(), &[]).unwrap();
        writer.finish().unwrap();
        let mut ticks = Vec::new();
        let take = |rows: &[TraceRow]| {
            ticks.push(rows.to_vec());
            Ok(())
        };
        read(&folder, &Interrupted::never(), take).unwrap();
        assert_eq!(ticks.len(), 2);
        assert_eq!((ticks[1][1].t_s, ticks[1][1].drone, ticks[1][1].group.as_str()), (0.04, 2, "N12"));
        assert_eq!((ticks[0][0].velocity_mps, ticks[0][0].altitude_m), (Vec2::new(10.0, 1e-7), 50.0));
        let stop = read(&folder, &Interrupted::when(&|| true), |_| Ok(()));
        assert!(matches!(stop, Err(ReportError::Interrupted)));
    }

    /// The header of a trace without the columns that were added since.
    const OLD: &str = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j\n";

    #[test]
    fn a_thinned_trace_keeps_its_first_and_its_last_tick() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let line = |tick: u32| format!("0.{tick},0,1,1,1,1,50,0,N,,0\n0.{tick},1,2,1,1,1,50,0,N,,0\n");
        let text = |ticks: &[u32]| OLD.to_owned() + &ticks.iter().map(|&tick| line(tick)).collect::<String>();
        for (every, kept) in [(1, &[1, 2, 3, 4, 5, 6][..]), (2, &[1, 3, 5, 6]), (3, &[1, 4, 6]), (9, &[1, 6])] {
            folder.files().write(TRACE, text(&[1, 2, 3, 4, 5, 6]).as_bytes()).unwrap();
            thin(&folder, every, &Interrupted::never()).unwrap();
            assert_eq!(std::fs::read_to_string(folder.path().join(TRACE)).unwrap(), text(kept), "{every}");
        }
        let stop = thin(&folder, 2, &Interrupted::when(&|| true));
        assert!(matches!(stop, Err(ReportError::Interrupted)));
        assert_eq!(std::fs::read_to_string(folder.path().join(TRACE)).unwrap(), text(&[1, 6]));
    }

    #[test]
    fn an_invalid_line_is_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        for (text, place) in [("x\n", "line 1"), (&format!("{OLD}0.0,0,1,1,1,1,50,0,N,,0\n0.0,x\n"), "line 3")] {
            folder.files().write(TRACE, text.as_bytes()).unwrap();
            let error = read(&folder, &Interrupted::never(), |_| Ok(())).unwrap_err().to_string();
            assert!(error.contains(place), "{error}");
        }
    }

    #[test]
    fn figures_of_pilots_are_columns_that_are_empty_where_there_is_none() {
        let name = |name| MetricName::new(name).unwrap();
        let metric = |drone, of, value| {
            let metric = Telemetry::Metric { name: name(of), value };
            TelemetryRow::new(DroneId(drone), &metric).unwrap()
        };
        let rows = [DroneRow { flags: ROW_ALIVE, ..DroneRow::default() }; 2];
        let mut bytes = Vec::new();
        let names = [name("order"), name("gap")].into();
        let telemetry = [metric(0, "gap", 2.5), metric(1, "order", 1.0)];
        TraceWriter::new(&mut bytes, &names).unwrap().tick(0.02, &rows, &telemetry).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let ends: Vec<String> =
            text.lines().map(|line| line.rsplitn(3, ',').take(2).collect::<Vec<_>>().join(" ")).collect();
        assert_eq!(ends, ["metric.order metric.gap", " 2.5", "1.0 "]);
    }
}
