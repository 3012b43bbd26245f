//! trace.csv: the state of each living drone in each tick.

use crate::error::ReportError;
use crate::files::TRACE;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use skein_protocol::Vec2;
use skein_protocol::record::DroneRow;
use std::io::{BufRead, BufReader, Write};

const HEADER: &str = "t_s,drone,x_m,y_m,vx_mps,vy_mps,group,leader,energy_j";

/// Writes the trace. Reuses its buffers, so that a row costs no allocation.
pub(crate) struct TraceWriter<W: Write> {
    out: W,
    lines: Vec<u8>,
    number: zmij::Buffer,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the header.
    pub(crate) fn new(mut out: W) -> std::io::Result<Self> {
        writeln!(out, "{HEADER}")?;
        Ok(Self { out, lines: Vec::new(), number: zmij::Buffer::new() })
    }

    /// Writes the living drones of one tick.
    pub(crate) fn tick(&mut self, t_s: f64, rows: &[DroneRow]) -> std::io::Result<()> {
        self.lines.clear();
        for (drone, row) in rows.iter().enumerate().filter(|(_, row)| row.alive()) {
            self.field(t_s);
            write!(self.lines, "{drone},")?;
            for value in [row.position_m, row.velocity_mps].into_iter().flat_map(|[x, y, _]| [x, y]) {
                self.field(value);
            }
            write!(self.lines, "{},", row.group)?;
            if let Some(leader) = row.leader() {
                write!(self.lines, "{leader}")?;
            }
            self.lines.push(b',');
            self.lines.extend_from_slice(self.number.format(row.energy_j).as_bytes());
            self.lines.push(b'\n');
        }
        self.out.write_all(&self.lines)
    }

    /// Writes what is still buffered.
    pub(crate) fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
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
    if header != HEADER {
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
    let group = fields.next()?.to_owned();
    let energy_j = fields.nth(1)?.parse().ok()?;
    (fields.count() == 0).then_some(TraceRow { t_s, drone: drone as usize, position_m, velocity_mps, group, energy_j })
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::ROW_ALIVE;
    use skein_protocol::{Ballot, DroneId, GroupId, PlanStamp};

    fn rows() -> [DroneRow; 3] {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(2) };
        let row = DroneRow {
            position_m: [0.1, -35.0, 50.0],
            velocity_mps: [10.0, 1e-7, 0.0],
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
        TraceWriter::new(&mut bytes).unwrap().tick(0.02, &rows()).unwrap();
        let wanted = "t_s,drone,x_m,y_m,vx_mps,vy_mps,group,leader,energy_j\n\
            0.02,0,0.1,-35.0,10.0,1e-7,N,,2.5\n\
            0.02,2,0.1,-35.0,10.0,1e-7,N12,2,2.5\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), wanted);
    }

    #[test]
    fn a_written_trace_is_read_tick_by_tick() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        let mut writer = TraceWriter::new(folder.files().create(TRACE).unwrap()).unwrap();
        writer.tick(0.02, &rows()).unwrap();
        writer.tick(0.04, &rows()).unwrap();
        writer.flush().unwrap();
        let mut ticks = Vec::new();
        let take = |rows: &[TraceRow]| {
            ticks.push(rows.to_vec());
            Ok(())
        };
        read(&folder, &Interrupted::never(), take).unwrap();
        assert_eq!(ticks.len(), 2);
        assert_eq!((ticks[1][1].t_s, ticks[1][1].drone, ticks[1][1].group.as_str()), (0.04, 2, "N12"));
        assert_eq!(ticks[0][0].velocity_mps, Vec2::new(10.0, 1e-7));
        let stop = read(&folder, &Interrupted::when(&|| true), |_| Ok(()));
        assert!(matches!(stop, Err(ReportError::Interrupted)));
    }

    #[test]
    fn an_invalid_line_is_named() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        for (text, place) in [("x\n", "line 1"), (&format!("{HEADER}\n0.0,0,1,1,1,1,N,,0\n0.0,x\n"), "line 3")] {
            folder.files().write(TRACE, text.as_bytes()).unwrap();
            let error = read(&folder, &Interrupted::never(), |_| Ok(())).unwrap_err().to_string();
            assert!(error.contains(place), "{error}");
        }
    }
}
