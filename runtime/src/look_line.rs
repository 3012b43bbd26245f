//! The line between a command that looks at swarms of other machines and `skein-hosts look`, which fetches what they publish. Requests
//! go one way, as one JSON object a line. Words come back: a line of JSON each, and behind some of them samples as bytes.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::{self, BufRead, ErrorKind, Read, Write};

/// Greatest length of the line of a word, bytes: scenarios are in it.
const MAX_LINE: u64 = 256 << 20;
/// Greatest size of the samples behind a word, 8-byte words: 1 GiB.
const MAX_WORDS: u64 = 128 << 20;

/// Something that a swarm publishes and that can be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LookStream {
    /// The records of its ticks.
    Record,
    /// What the world sends to the drones.
    Downlink,
}

/// A request for what a swarm publishes from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LookRequest {
    /// Number of the swarm, as in [`LookRun`].
    pub run: u32,
    /// What is wanted of it.
    pub stream: LookStream,
}

/// A swarm that another machine shares.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LookRun {
    /// Its number on this line.
    pub run: u32,
    /// Name of its folder on the other machine.
    pub folder: String,
    /// Its scenario, as its launcher resolved it.
    pub scenario: Value,
}

/// What `skein-hosts look` says.
#[derive(Clone, Debug, PartialEq)]
pub enum LookWord {
    /// The swarms that fly now. Said at the beginning, and when they change.
    Runs(Vec<LookRun>),
    /// Samples that were asked for, in their order, each as [`push_sample`] writes it.
    Samples(LookRequest, Vec<u64>),
    /// What was asked for has ended: the swarm is gone.
    Over(LookRequest),
    /// What was asked for does not come any more, and why.
    Lost(LookRequest, String),
    /// Nothing comes any more.
    Failed {
        /// Whether the command line asks for what may not be.
        usage: bool,
        /// Why, in words.
        why: String,
    },
}

/// The line of a word.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Line {
    Runs(Vec<LookRun>),
    /// And the number of 8-byte words that follow.
    Samples(LookRequest, u64),
    Over(LookRequest),
    Lost(LookRequest, String),
    Failed {
        usage: bool,
        why: String,
    },
}

impl LookWord {
    /// Writes the word.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let (line, words): (Line, &[u64]) = match self {
            Self::Runs(runs) => (Line::Runs(runs.clone()), &[]),
            Self::Samples(request, words) => (Line::Samples(*request, words.len() as u64), words),
            Self::Over(request) => (Line::Over(*request), &[]),
            Self::Lost(request, why) => (Line::Lost(*request, why.clone()), &[]),
            Self::Failed { usage, why } => (Line::Failed { usage: *usage, why: why.clone() }, &[]),
        };
        let mut bytes = serde_json::to_vec(&line)?;
        bytes.push(b'\n');
        out.write_all(&bytes)?;
        out.write_all(bytemuck::cast_slice(words))?;
        out.flush()
    }

    /// Reads the next word; `None` at the end.
    ///
    /// # Errors
    /// Those of the reader; [`ErrorKind::InvalidData`] if what comes is no word.
    pub fn read(from: &mut impl BufRead) -> io::Result<Option<Self>> {
        let mut line = Vec::new();
        if from.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        Ok(Some(match serde_json::from_slice(&line)? {
            Line::Runs(runs) => Self::Runs(runs),
            Line::Samples(request, count) => Self::Samples(request, read_words(from, count)?),
            Line::Over(request) => Self::Over(request),
            Line::Lost(request, why) => Self::Lost(request, why),
            Line::Failed { usage, why } => Self::Failed { usage, why },
        }))
    }
}

/// Reads so many words. Memory is taken for what has come, and not for what is announced.
fn read_words(from: &mut impl BufRead, count: u64) -> io::Result<Vec<u64>> {
    if count > MAX_WORDS {
        let why = format!("expected at most {MAX_WORDS} words of samples, found {count}");
        return Err(io::Error::new(ErrorKind::InvalidData, why));
    }
    let mut words = Vec::new();
    let mut piece = [0_u64; 1024];
    for first in (0..count).step_by(piece.len()) {
        let piece = &mut piece[..(count - first).min(1024) as usize];
        from.read_exact(bytemuck::cast_slice_mut(piece))?;
        words.extend_from_slice(piece);
    }
    Ok(words)
}

/// Appends a sample to others: its length in bytes, then its bytes, filled up with zeros to a whole word.
pub fn push_sample(words: &mut Vec<u64>, sample: &[u8]) {
    words.push(sample.len() as u64);
    let begin = words.len();
    words.resize(begin + sample.len().div_ceil(size_of::<u64>()), 0);
    bytemuck::cast_slice_mut(&mut words[begin..])[..sample.len()].copy_from_slice(sample);
}

/// The samples in these words, as [`push_sample`] wrote them, each as its words and its length in bytes. `None` in the place of a
/// sample that is longer than what is left; it is the last one.
pub fn samples(words: &[u64]) -> impl Iterator<Item = Option<(&[u64], usize)>> {
    let mut left = words;
    std::iter::from_fn(move || {
        let (&len, rest) = left.split_first()?;
        let sample = usize::try_from(len).ok().and_then(|len| Some((rest.split_at_checked(len.div_ceil(8))?, len)));
        left = sample.map_or(&[], |((_, rest), _)| rest);
        Some(sample.map(|((sample, _), len)| (sample, len)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ASKED: LookRequest = LookRequest { run: 3, stream: LookStream::Downlink };

    #[test]
    fn words_are_read_as_they_were_written() {
        let mut samples = Vec::new();
        push_sample(&mut samples, b"one sample");
        let run = LookRun { run: 0, folder: "forest.1_2_3".to_owned(), scenario: serde_json::json!({ "seed": 7 }) };
        let words = [
            LookWord::Runs(vec![run]),
            LookWord::Samples(ASKED, samples),
            LookWord::Over(ASKED),
            LookWord::Lost(ASKED, "the network\nis gone".to_owned()),
            LookWord::Failed { usage: true, why: "no".to_owned() },
        ];
        let mut bytes = Vec::new();
        words.iter().for_each(|word| word.write(&mut bytes).unwrap());
        let mut from = bytes.as_slice();
        for word in words {
            assert_eq!(LookWord::read(&mut from).unwrap(), Some(word));
        }
        assert_eq!(LookWord::read(&mut from).unwrap(), None);
    }

    #[test]
    fn a_sample_that_is_longer_than_what_is_left_is_none() {
        let mut words = Vec::new();
        push_sample(&mut words, &[1; 8]);
        push_sample(&mut words, &[2; 11]);
        let lens = |words: &[u64]| samples(words).map(|sample| sample.map(|(_, len)| len)).collect::<Vec<_>>();
        assert_eq!(lens(&words), [Some(8), Some(11)]);
        assert_eq!(lens(&words[..4]), [Some(8), None]);
        assert_eq!(lens(&[u64::MAX, 0]), [None]);
    }

    #[test]
    fn more_samples_than_can_be_are_refused() {
        let line = format!("{{\"samples\":[{{\"run\":0,\"stream\":\"record\"}},{}]}}\n", u64::MAX);
        assert_eq!(LookWord::read(&mut line.as_bytes()).unwrap_err().kind(), ErrorKind::InvalidData);
        let line = "{\"samples\":[{\"run\":0,\"stream\":\"record\"},9]}\n12345678";
        assert_eq!(LookWord::read(&mut line.as_bytes()).unwrap_err().kind(), ErrorKind::UnexpectedEof);
    }

    proptest! {
        #[test]
        fn any_bytes_are_words_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut from = bytes.as_slice();
            while let Ok(Some(_)) = LookWord::read(&mut from) {}
            let words: Vec<u64> = bytes.iter().map(|byte| u64::from(*byte)).collect();
            prop_assert!(samples(&words).count() <= words.len());
        }
    }
}
