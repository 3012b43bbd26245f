//! Clients that have connected and not yet sent a request.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpStream};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Greatest number of clients that wait.
const PLACES: usize = 32;

/// The clients that wait. If there are too many, the one that came first is disconnected. So a client that only holds a place,
/// without a request, keeps no one out.
#[derive(Default)]
pub(crate) struct WaitingRoom(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    clients: VecDeque<(u64, TcpStream)>,
    next: u64,
}

impl WaitingRoom {
    /// Lets a client in. Returns its number.
    pub(crate) fn enter(&self, client: &TcpStream) -> std::io::Result<u64> {
        let mut waiting = self.lock();
        if waiting.clients.len() == PLACES
            && let Some((_, first)) = waiting.clients.pop_front()
        {
            // This fails for a client that has disconnected by itself.
            let _ = first.shutdown(Shutdown::Both);
        }
        let number = waiting.next;
        waiting.next += 1;
        waiting.clients.push_back((number, client.try_clone()?));
        Ok(number)
    }

    /// The client with this number waits no more.
    pub(crate) fn leave(&self, number: u64) {
        self.lock().clients.retain(|client| client.0 != number);
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // The list is valid even if a thread panicked while it held the lock.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
