//! messages.csv: the messages of a run as a table, a row for each frame and receiver. Made from the recording.

use crate::error::ReportError;
use crate::files::MESSAGES;
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use crate::mcap;
use crate::scene::SentFrame;
use crate::table::{Cell, Column, ColumnKind, CsvWriter};
use skein_protocol::radio::DropReason;
use std::io::{self, BufWriter, Write};

/// Number of columns.
const COUNT: usize = 7;
/// The columns.
pub(crate) static COLUMNS: [Column; COUNT] = [
    Column::new("t_s", ColumnKind::Number),
    Column::new("source", ColumnKind::Whole),
    Column::new("sequence", ColumnKind::Whole),
    Column::new("kind", ColumnKind::Text),
    Column::new("says", ColumnKind::Text),
    Column::new("receiver", ColumnKind::Whole),
    Column::new("delivery", ColumnKind::Text),
];

/// What the column of a name holds.
pub(crate) fn kind(name: &str) -> ColumnKind {
    COLUMNS.iter().find(|column| column.name == name).map_or(ColumnKind::Text, |column| column.kind)
}

/// Writes the table.
///
/// # Errors
/// [`ReportError`].
pub(crate) fn write(folder: &RunFolder, interrupted: &Interrupted<'_>) -> Result<(), ReportError> {
    let path = folder.path().join(MESSAGES);
    let io = |result: io::Result<()>| result.map_err(ReportError::io(&path));
    let out = BufWriter::new(folder.files().begin(MESSAGES)?);
    let mut table = CsvWriter::new(out, &COLUMNS).map_err(ReportError::io(&path))?;
    let sample =
        |sample: crate::scene::Sample| io(sample.radio.frames.iter().try_for_each(|sent| frame(&mut table, sent)));
    let written = mcap::read(folder, interrupted, sample, |_| {}).and_then(|()| io(table.finish().map(drop)));
    match written {
        Ok(()) => folder.files().keep(MESSAGES),
        Err(error) => {
            folder.files().give_up(MESSAGES);
            Err(error)
        }
    }
}

/// Writes the rows of a frame.
fn frame<W: Write>(table: &mut CsvWriter<W>, frame: &SentFrame) -> io::Result<()> {
    for (receiver, letter) in (0u32..).zip(frame.deliveries.chars()) {
        let Some(delivery) = delivery(letter) else { continue };
        let cells: [Cell<'_>; COUNT] = [
            frame.t_s.into(),
            frame.source.into(),
            frame.sequence.into(),
            (&*frame.kind).into(),
            frame.content.as_str().into(),
            receiver.into(),
            delivery.into(),
        ];
        table.row(&cells)?;
    }
    Ok(())
}

/// The word for a letter of [`SentFrame::deliveries`]; `None` for a receiver that the frame does not concern.
fn delivery(letter: char) -> Option<&'static str> {
    match letter {
        '-' => None,
        'h' => Some("delivered"),
        other => {
            let reason = DropReason::ALL.into_iter().map(crate::scene::drop_reason_name);
            Some(reason.into_iter().find(|name| name.starts_with(other)).unwrap_or("dropped"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_a_row_for_each_receiver_that_it_concerns() {
        let mut table = CsvWriter::new(Vec::new(), &COLUMNS).unwrap();
        let sent = SentFrame {
            t_s: 0.2,
            source: 1,
            sequence: 7,
            kind: "plan".into(),
            content: "avoid N, round 1".to_owned(),
            deliveries: "h-rl-".to_owned(),
        };
        frame(&mut table, &sent).unwrap();
        let text = String::from_utf8(table.finish().unwrap()).unwrap();
        let wanted = "t_s,source,sequence,kind,says,receiver,delivery\n\
            0.2,1,7,plan,\"avoid N, round 1\",0,delivered\n\
            0.2,1,7,plan,\"avoid N, round 1\",2,range\n\
            0.2,1,7,plan,\"avoid N, round 1\",3,loss\n";
        assert_eq!(text, wanted);
    }
}
