//! The tag of a run: the end of its folder's name, and part of its prefix in shared memory.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// `<pid of the launcher>_<time>_<count>`: unique, and with a `_` appended never the beginning of another tag.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RunTag {
    text: String,
    launcher: u32,
}

impl RunTag {
    /// One that no run has.
    pub(crate) fn unique() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
        let launcher = std::process::id();
        Self { text: format!("{launcher}_{:x}_{count}", since.as_nanos() as u64), launcher }
    }

    /// `None` for a text that is no tag.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('_');
        let launcher = parts.next()?.parse().ok()?;
        let mut part = |radix| parts.next().is_some_and(|part| u64::from_str_radix(part, radix).is_ok());
        let whole = part(16) && part(10) && parts.next().is_none();
        whole.then(|| Self { text: text.to_owned(), launcher })
    }

    /// That of the run which has a file of this name in shared memory.
    pub(crate) fn of_file(name: &str) -> Option<Self> {
        let rest = name.strip_prefix("skein_")?;
        let (end, _) = rest.match_indices('_').nth(2)?;
        Self::parse(&rest[..end])
    }

    /// Its text.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// With what the names of the run's files in shared memory begin.
    pub(crate) fn prefix(&self) -> String {
        format!("skein_{}_", self.text)
    }

    /// The process that made the run.
    pub(crate) fn launcher(&self) -> u32 {
        self.launcher
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_of_a_runs_files_tell_its_tag() {
        let tag = RunTag::unique();
        assert_eq!(RunTag::parse(tag.text()), Some(tag.clone()));
        assert_eq!(RunTag::of_file(&format!("{}home", tag.prefix())), Some(tag.clone()));
        assert_eq!(RunTag::of_file(&format!("{}abc_node.0_10_0.global_mgmt", tag.prefix())), Some(tag));
        for other in ["skein_1_2", "skein_1_2_3", "skein-1000", "skein_x_2_3_home", "skein_1_2_z_home", "iox2_1_2_3_a"]
        {
            assert_eq!(RunTag::of_file(other), None, "{other}");
        }
    }
}
