//! trace.csv: the state of each living drone in each tick.

use crate::error::ReportError;
use crate::files::TRACE;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use skein_protocol::record::DroneRow;
use skein_protocol::telemetry::TelemetryRow;
use skein_protocol::{MetricName, Vec2};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};

const HEADER: &str = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j";

/// Writes the trace. Reuses its buffers, so that a row costs no allocation.
pub(crate) struct TraceWriter<W: Write> {
    out: W,
    lines: Vec<u8>,
    number: zmij::Buffer,
    /// The figures of pilots, each of which has a column.
    metrics: Vec<MetricName>,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header. `metrics` are the figures that pilots report.
    pub(crate) fn new(mut out: W, metrics: &BTreeSet<MetricName>) -> std::io::Result<Self> {
        write!(out, "{HEADER}")?;
        for name in metrics {
            write!(out, ",metric.{name}")?;
        }
        writeln!(out)?;
        let metrics = metrics.iter().copied().collect();
        Ok(Self { out, lines: Vec::new(), number: zmij::Buffer::new(), metrics })
    }

    /// Writes the living drones of one tick, and the figures that they report.
    pub(crate) fn tick(&mut self, t_s: f64, rows: &[DroneRow], telemetry: &[TelemetryRow]) -> std::io::Result<()> {
        self.lines.clear();
        for (drone, row) in rows.iter().enumerate().filter(|(_, row)| row.alive()) {
            self.field(t_s);
            write!(self.lines, "{drone},")?;
            let ([x, y, z], [vx, vy, vz]) = (row.position_m, row.velocity_mps);
            for value in [x, y, vx, vy, z, vz] {
                self.field(value);
            }
            write!(self.lines, "{},", row.group)?;
            if let Some(leader) = row.leader() {
                write!(self.lines, "{leader}")?;
            }
            self.lines.push(b',');
            self.lines.extend_from_slice(self.number.format(row.energy_j).as_bytes());
            self.metrics(drone, telemetry);
            self.lines.push(b'\n');
        }
        self.out.write_all(&self.lines)
    }

    /// Writes what is still buffered.
    pub(crate) fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }

    /// The figures of a drone, empty where it reports none.
    fn metrics(&mut self, drone: usize, telemetry: &[TelemetryRow]) {
        let Self { metrics, lines, number, .. } = self;
        let first = telemetry.partition_point(|row| row.drone.index() < drone);
        let own = telemetry[first..].iter().take_while(|row| row.drone.index() == drone);
        for name in metrics {
            lines.push(b',');
            let value = own.clone().filter_map(TelemetryRow::metric).find(|(known, _)| known == name);
            if let Some((_, value)) = value {
                lines.extend_from_slice(number.format(value).as_bytes());
            }
        }
    }

    fn field(&mut self, value: f64) {
        self.lines.extend_from_slice(self.number.format(value).as_bytes());
        self.lines.push(b',');
    }
}

/// The state of a drone in a tick, as read from the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TraceRow {
    pub t_s: f64,
    pub drone: usize,
    pub position_m: Vec2,
    pub velocity_mps: Vec2,
    pub altitude_m: f64,
    pub group: String,
    pub energy_j: f64,
}

/// Reads the trace of a run, and calls `tick` with the rows of each tick.
pub(crate) fn read(
    folder: &RunFolder,
    interrupted: &Interrupted<'_>,
    mut tick: impl FnMut(&[TraceRow]) -> Result<(), ReportError>,
) -> Result<(), ReportError> {
    let path = folder.path().join(TRACE);
    let mut lines = BufReader::new(folder.files().read(TRACE)?).lines();
    let content = |found: String| ReportError::Content { path: path.clone(), expected: HEADER, found };
    let header = lines.next().transpose().map_err(ReportError::io(&path))?.unwrap_or_default();
    let rest = header.strip_prefix(HEADER);
    if !rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(",metric.")) {
        return Err(content(format!("line 1 is \"{header}\"")));
    }
    let mut rows: Vec<TraceRow> = Vec::new();
    for (number, line) in lines.enumerate() {
        let line = line.map_err(ReportError::io(&path))?;
        let row = parse(&line).ok_or_else(|| content(format!("line {} is \"{line}\"", number + 2)))?;
        if rows.first().is_some_and(|first| first.t_s != row.t_s) {
            interrupted.check()?;
            tick(&rows)?;
            rows.clear();
        }
        rows.push(row);
    }
    if rows.is_empty() { Ok(()) } else { tick(&rows) }
}

fn parse(line: &str) -> Option<TraceRow> {
    let mut fields = line.split(',');
    let mut number = || fields.next()?.parse::<f64>().ok().filter(|value| value.is_finite());
    let (t_s, drone) = (number()?, number()?);
    let (position_m, velocity_mps) = (Vec2::new(number()?, number()?), Vec2::new(number()?, number()?));
    let (altitude_m, _) = (number()?, number()?);
    let group = fields.next()?.to_owned();
    let energy_j = fields.nth(1)?.parse().ok()?;
    // The figures of pilots follow.
    Some(TraceRow { t_s, drone: drone as usize, position_m, velocity_mps, altitude_m, group, energy_j })
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::ROW_ALIVE;
    use skein_protocol::telemetry::Telemetry;
    use skein_protocol::{Ballot, DroneId, GroupId, PlanStamp};

    fn rows() -> [DroneRow; 3] {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(2) };
        let row = DroneRow {
            position_m: [0.1, -35.0, 50.0],
            velocity_mps: [10.0, 1e-7, -2.0],
            energy_j: 2.5,
            flags: ROW_ALIVE,
            ..DroneRow::default()
        };
        let led = DroneRow { obeyed: PlanStamp { ballot, epoch: 1 }, group: GroupId::ALL.child(1).child(2), ..row };
        [row, DroneRow::default(), led]
    }

    #[test]
    fn living_drones_are_written_in_full() {
        let mut bytes = Vec::new();
        TraceWriter::new(&mut bytes, &BTreeSet::new()).unwrap().tick(0.02, &rows(), &[]).unwrap();
        let wanted = "t_s,drone,x_m,y_m,vx_mps,vy_mps,z_m,vz_mps,group,leader,energy_j\n\
            0.02,0,0.1,-35.0,10.0,1e-7,50.0,-2.0,N,,2.5\n\
            0.02,2,0.1,-35.0,10.0,1e-7,50.0,-2.0,N12,2,2.5\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), wanted);
    }

    #[test]
    fn a_written_trace_is_read_tick_by_tick() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut writer = TraceWriter::new(folder.files().create(TRACE).unwrap(), &BTreeSet::new()).unwrap();
        writer.tick(0.02, &rows(), &[]).unwrap();
        writer.tick(0.04, &rows(), &[]).unwrap();
        writer.flush().unwrap();
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

    #[test]
    fn an_invalid_line_is_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        for (text, place) in [("x\n", "line 1"), (&format!("{HEADER}\n0.0,0,1,1,1,1,50,0,N,,0\n0.0,x\n"), "line 3")] {
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
