//! What a host sends to a relay.

use crate::changed_words;
use crate::error::HostsError;
use crate::reader::Reader;
use bytemuck::{Pod, Zeroable};
use skein_bus::TickOutcome;
use skein_protocol::Tick;
use skein_protocol::frame::Frame;
use skein_protocol::slot::{LinkStats, Slot};
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

const TICK: u64 = 1;
const DONE: u64 = 2;

/// What a relay gets from a host.
#[derive(Debug, PartialEq)]
pub(crate) enum Up {
    /// How the drones answered a tick.
    Tick(Tick),
    /// A request is carried out, with this reply.
    Done(u32),
}

/// The slot and the counters of a drone, as both ends have them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Standing {
    /// The slot.
    pub(crate) slot: Slot,
    /// The counters.
    pub(crate) stats: LinkStats,
}

/// How a drone answered a tick.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answer {
    /// What became of it.
    pub(crate) outcome: TickOutcome,
    /// How its process ended, if it ended by itself.
    pub(crate) end: Option<ExitStatus>,
    /// What it said.
    pub(crate) frames: Vec<Frame>,
}

/// The beginning of a drone's answer.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AnswerHead {
    outcome: u32,
    /// The wait status plus 1; 0 if the process runs or was ended on purpose.
    end: u32,
    frames: u32,
}

/// A message that answers a tick, while it is written. The drones follow in the order of their numbers.
pub(crate) struct AnswerMessage(Vec<u8>);

impl AnswerMessage {
    /// A message without answers.
    pub(crate) fn new(tick: Tick) -> Self {
        Self([TICK, tick].iter().flat_map(|word| word.to_le_bytes()).collect())
    }

    /// Adds the answer of the next drone; what it stands at now and stood at before counts only if it is done.
    pub(crate) fn push(
        &mut self,
        (outcome, end): (TickOutcome, Option<ExitStatus>),
        (before, now): (&mut Standing, Standing),
        frames: &[Frame],
    ) {
        let end = end.map_or(0, |status| (status.into_raw() as u32).wrapping_add(1));
        let head = AnswerHead { outcome: code(outcome), end, frames: frames.len() as u32 };
        self.0.extend(bytemuck::bytes_of(&head));
        self.0.extend(bytemuck::cast_slice::<Frame, u8>(frames));
        if outcome == TickOutcome::Done {
            changed_words::write(&before.slot, &now.slot, &mut self.0);
            changed_words::write(&before.stats, &now.stats, &mut self.0);
            *before = now;
        }
    }

    /// The message.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// A message that a request is carried out.
pub(crate) fn done(reply: u32) -> Vec<u8> {
    [DONE, u64::from(reply)].iter().flat_map(|word| word.to_le_bytes()).collect()
}

impl Up {
    /// Reads the kind of a message. The answers of a tick are left for [`read_answer`].
    ///
    /// # Errors
    /// [`HostsError::Message`] if it is none.
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, HostsError> {
        match reader.value::<[u64; 2]>()? {
            [TICK, tick] => Ok(Self::Tick(tick)),
            [DONE, reply] => Ok(Self::Done(u32::try_from(reply).unwrap_or(0))),
            _ => Err(HostsError::Message("it is of an unknown kind")),
        }
    }
}

/// Reads the answer of the next drone, and brings what it stands at up to date.
///
/// # Errors
/// [`HostsError::Message`] if there is none.
pub(crate) fn read_answer(reader: &mut Reader<'_>, standing: &mut Standing) -> Result<Answer, HostsError> {
    let head: AnswerHead = reader.value()?;
    let bytes = (head.frames as usize).checked_mul(size_of::<Frame>());
    let bytes = reader.bytes(bytes.ok_or(HostsError::Message("it has too many frames"))?)?;
    let frames = bytes.chunks_exact(size_of::<Frame>()).map(bytemuck::pod_read_unaligned).collect();
    let outcome = outcome(head.outcome)?;
    if outcome == TickOutcome::Done {
        changed_words::read(&mut standing.slot, reader)?;
        changed_words::read(&mut standing.stats, reader)?;
    }
    let end = head.end.checked_sub(1).map(|status| ExitStatus::from_raw(status as i32));
    Ok(Answer { outcome, end, frames })
}

const OUTCOMES: [TickOutcome; 6] = [
    TickOutcome::Pending,
    TickOutcome::Done,
    TickOutcome::Dead,
    TickOutcome::Late,
    TickOutcome::Hung,
    TickOutcome::Absent,
];

fn code(outcome: TickOutcome) -> u32 {
    OUTCOMES.iter().zip(0..).find(|(known, _)| **known == outcome).map_or(0, |(_, code)| code)
}

fn outcome(code: u32) -> Result<TickOutcome, HostsError> {
    OUTCOMES.get(code as usize).copied().ok_or(HostsError::Message("a drone has an unknown outcome"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn message(tick: Tick, (outcome, end): (TickOutcome, Option<i32>), frames: &[Frame]) -> Vec<u8> {
        let slot = Slot { frames_total: tick, ..Slot::default() };
        let mut message = AnswerMessage::new(tick);
        let now = Standing { slot, ..Standing::default() };
        message.push((outcome, end.map(ExitStatus::from_raw)), (&mut Standing::default(), now), frames);
        message.finish()
    }

    #[test]
    fn an_answer_is_read_back() {
        let frame = Frame { kind: 3, len: 2, ..bytemuck::Zeroable::zeroed() };
        let bytes = message(7, (TickOutcome::Done, None), &[frame, frame]);
        let (mut reader, mut standing) = (Reader(&bytes), Standing::default());
        assert_eq!(Up::read(&mut reader).unwrap(), Up::Tick(7));
        let answer = read_answer(&mut reader, &mut standing).unwrap();
        assert_eq!((answer.outcome, answer.end, answer.frames), (TickOutcome::Done, None, vec![frame, frame]));
        assert_eq!((standing.slot.frames_total, reader.0.len()), (7, 0));
        assert!(read_answer(&mut reader, &mut standing).is_err());
        let bytes = message(7, (TickOutcome::Dead, Some(9)), &[]);
        let mut reader = Reader(&bytes[16..]);
        let answer = read_answer(&mut reader, &mut standing).unwrap();
        assert_eq!((answer.outcome, answer.end.and_then(|end| end.signal())), (TickOutcome::Dead, Some(9)));
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_answer_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..4000)) {
            let (mut reader, mut standing) = (Reader(&bytes), Standing::default());
            if Up::read(&mut reader).is_ok() {
                while read_answer(&mut reader, &mut standing).is_ok() {}
            }
            prop_assert!(reader.0.len() <= bytes.len());
        }
    }
}
