//! What every benchmark needs from its caller.

use skein_runtime::PilotRegistry;

/// Asked again and again whether to stop: gives the number of the signal that asks for it, or `None`.
pub type Interrupted<'a> = dyn Fn() -> Option<i32> + Sync + 'a;

/// What every benchmark needs from its caller.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// The pilots, and their program, which plays the roles `run`, `world`, `drone` and `baseline-peer`.
    pub pilots: &'a PilotRegistry,
    /// When to stop.
    pub interrupted: &'a Interrupted<'a>,
}

impl Context<'_> {
    /// Whether the benchmark is to stop.
    pub(crate) fn stopped(&self) -> bool {
        (self.interrupted)().is_some()
    }
}
