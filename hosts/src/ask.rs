//! What a viewer asks a share for, and what the share replies.

use crate::error::HostsError;
use crate::names;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use skein_bus::Version;
use skein_runtime::LookStream;

/// In a reply to [`Wanted::Next`]: the swarm flies.
const FLIES: u64 = 1;
/// In a reply to [`Wanted::Next`]: the swarm is gone, and these are the last samples.
const OVER: u64 = 2;

/// What a viewer asks for.
#[derive(Debug, Serialize, Deserialize)]
struct Ask {
    /// The version of Skein that the viewer is built with.
    version: String,
    wanted: Wanted,
}

/// What is wanted of a share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Wanted {
    /// The swarms that fly, as a list of [`SharedRun`].
    Runs {
        /// The folders of those whose scenarios the viewer has.
        known: Vec<String>,
    },
    /// The samples that are new, as [`Samples`].
    Next(FeedKey),
}

/// Names what one viewer gets of one swarm.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct FeedKey {
    /// Name of the swarm's folder.
    pub(crate) folder: String,
    /// What is wanted of it.
    pub(crate) stream: LookStream,
    /// The viewer: each gets every sample once.
    pub(crate) viewer: String,
}

/// A swarm that a share offers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SharedRun {
    /// Name of its folder.
    pub(crate) folder: String,
    /// Its scenario as its launcher resolved it; `None` if the viewer has it.
    pub(crate) scenario: Option<Value>,
}

/// Samples that are new.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Samples {
    /// Whether the swarm is gone.
    pub(crate) over: bool,
    /// The samples, as [`skein_runtime::push_sample`] writes them.
    pub(crate) words: Vec<u64>,
}

/// A request as bytes.
pub(crate) fn request(wanted: Wanted) -> Vec<u8> {
    let ask = Ask { version: Version::OWN.to_string(), wanted };
    // It is texts, which JSON can hold.
    serde_json::to_vec(&ask).unwrap_or_default()
}

/// Reads a request. It looks at the version first: another version may have other keys.
pub(crate) fn parse(bytes: &[u8]) -> Result<Wanted, String> {
    #[derive(Deserialize)]
    struct Head {
        version: String,
    }
    let expected = |error| format!("expected a request of `skein view`, `top` or `topic`: {error}");
    let head: Head = serde_json::from_slice(bytes).map_err(expected)?;
    let own = Version::OWN.to_string();
    if head.version != own {
        return Err(format!("this share is built with {own}, the viewer with {}: use one version", head.version));
    }
    let ask: Ask = serde_json::from_slice(bytes).map_err(expected)?;
    match &ask.wanted {
        Wanted::Next(feed) if !names::is_name(&feed.folder) || !names::is_name(&feed.viewer) => {
            Err(format!("expected the names of a swarm and of a viewer, found {:?} and {:?}", feed.folder, feed.viewer))
        }
        _ => Ok(ask.wanted),
    }
}

impl Samples {
    /// The reply as bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let state = if self.over { OVER } else { FLIES };
        let mut bytes = state.to_le_bytes().to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.words));
        bytes
    }

    /// Reads a reply. What is in the samples is for the viewer to check.
    ///
    /// # Errors
    /// [`HostsError::Message`] if it is none.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, HostsError> {
        let (words, []) = bytes.as_chunks() else {
            return Err(HostsError::Message("samples have a length that is no multiple of 8 bytes"));
        };
        let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
        let over = match words.next() {
            Some(FLIES) => false,
            Some(OVER) => true,
            _ => return Err(HostsError::Message("it is of an unknown kind")),
        };
        Ok(Self { over, words: words.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn feed(folder: &str) -> Wanted {
        let (folder, viewer) = (folder.to_owned(), "a1".to_owned());
        Wanted::Next(FeedKey { folder, stream: LookStream::Record, viewer })
    }

    #[test]
    fn a_request_is_read_as_it_was_written() {
        for wanted in [feed("s2-right.7_a_0"), Wanted::Runs { known: vec!["s2-right.7_a_0".to_owned()] }] {
            assert_eq!(parse(&request(wanted.clone())), Ok(wanted));
        }
    }

    #[test]
    fn another_version_is_refused_by_name_whatever_else_it_says() {
        let why = parse(br#"{"version":"Skein 9.1","wanted":"dance"}"#).unwrap_err();
        assert!(why.contains("the viewer with Skein 9.1: use one version"), "{why}");
        assert!(parse(b"{}").is_err());
        for folder in ["../x", "", "a/b"] {
            assert!(parse(&request(feed(folder))).unwrap_err().contains("expected the names"), "{folder}");
        }
    }

    #[test]
    fn samples_are_read_as_they_were_written() {
        for over in [false, true] {
            let samples = Samples { over, words: vec![1, u64::MAX] };
            assert_eq!(Samples::read(&samples.to_bytes()).unwrap(), samples);
        }
        assert!(Samples::read(&[]).is_err() && Samples::read(&[3, 0, 0, 0, 0, 0, 0, 0]).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_samples_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..100)) {
            let _ = (Samples::read(&bytes), parse(&bytes));
        }
    }
}
