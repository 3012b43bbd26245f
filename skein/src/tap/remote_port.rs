//! Receives what a swarm of another machine publishes.

use super::link::{Heard, Link};
use super::sound;
use crate::exit::Failure;
use skein_protocol::Tick;
use skein_runtime::{LookRequest, LookStream};
use std::cell::{Cell, OnceCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

/// Receives what a swarm publishes. It asks for it when it is to receive for the first time.
pub(crate) struct RemotePort {
    link: Arc<Link>,
    request: LookRequest,
    /// Number of drones of the swarm.
    drones: u32,
    receiver: OnceCell<Receiver<Heard>>,
    /// The tick of the last sample.
    last: Cell<Tick>,
    /// Whether the swarm is gone.
    over: Rc<Cell<bool>>,
}

impl RemotePort {
    /// A port that sets `over` once the swarm is gone.
    pub(crate) fn new(link: Arc<Link>, request: LookRequest, drones: u32, over: Rc<Cell<bool>>) -> Self {
        Self { link, request, drones, receiver: OnceCell::new(), last: Cell::new(0), over }
    }

    /// The oldest sample that is not yet received: its words, and its length in bytes.
    pub(crate) fn receive(&self) -> Result<Option<(Vec<u64>, usize)>, Failure> {
        loop {
            match self.receiver()?.try_recv() {
                Ok(Heard::Sample(words, len)) => match self.check(&bytemuck::cast_slice(&words)[..len]) {
                    Some(tick) => {
                        self.last.set(tick);
                        return Ok(Some((words, len)));
                    }
                    None => tracing::warn!("a sample that came over the network cannot be used, and is skipped"),
                },
                Ok(Heard::Lost(why)) => return Err(Failure::environment(why)),
                Err(TryRecvError::Empty) => return Ok(None),
                Err(TryRecvError::Disconnected) => {
                    self.over.set(true);
                    return self.link.failure().map_or(Ok(None), Err);
                }
            }
        }
    }

    fn receiver(&self) -> Result<&Receiver<Heard>, Failure> {
        if let Some(receiver) = self.receiver.get() {
            return Ok(receiver);
        }
        let receiver = self.link.request(self.request)?;
        Ok(self.receiver.get_or_init(|| receiver))
    }

    fn check(&self, bytes: &[u8]) -> Option<Tick> {
        match self.request.stream {
            LookStream::Record => sound::record(bytes, self.drones, self.last.get()),
            LookStream::Downlink => sound::downlink(bytes, self.drones, self.last.get()),
        }
    }
}
