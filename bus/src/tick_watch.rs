//! Waiting for ticks in the place of many drones, for a process that flies none of them itself.

use crate::control::Control;
use crate::drone_endpoint::TickSignal;
use crate::futex;
use crate::spec::WaitMode;
use crate::tick_word::{NOT_BEGUN, STOP};
use skein_protocol::Tick;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Waits for the ticks of a core, whatever becomes of the drones there. The drones then begin the tick with
/// [`crate::DroneEndpoint::join_tick`], which says for each whether it may answer. For a process that dies with its launcher.
#[derive(Debug)]
pub struct TickWatch {
    control: Arc<Control>,
    core: usize,
    last: u32,
}

impl TickWatch {
    /// Watches the ticks of the core that this drone is on, see [`Control::core_of`].
    #[must_use]
    pub fn new(control: Arc<Control>, drone: usize) -> Self {
        let core = control.core_of(drone);
        Self { control, core, last: 0 }
    }

    /// Waits for a tick that was not yet returned, and returns the newest one.
    pub fn wait(&mut self) -> TickSignal {
        let block = self.control.spec().wait == WaitMode::Block;
        loop {
            let seen = self.word().load(Ordering::Acquire);
            if seen == STOP {
                return TickSignal::Stop;
            }
            if seen > self.last {
                self.last = seen;
                return TickSignal::Tick(Tick::from(seen - 1));
            }
            if block || seen == NOT_BEGUN {
                futex::wait_on(self.word(), seen);
            } else {
                rustix::thread::sched_yield();
            }
        }
    }

    fn word(&self) -> &AtomicU32 {
        self.control.barrier().tick_word(self.core)
    }
}
