//! What the world asks of the supervisor at an exact tick: to kill, freeze, resume or restart a drone's process.

use crate::control::{Control, SLICE};
use crate::error::BusError;
use crate::futex;
use skein_protocol::{DroneId, Tick};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// What is to be done to a drone's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum RequestKind {
    /// SIGKILL, and reap it.
    Kill = 1,
    /// SIGSTOP.
    Freeze = 2,
    /// SIGCONT.
    Resume = 3,
    /// A new process for a dead one.
    Restart = 4,
}

/// One order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessRequest {
    /// What.
    pub kind: RequestKind,
    /// To whom.
    pub drone: DroneId,
    /// In which tick; for [`RequestKind::Resume`] and [`RequestKind::Restart`], the first tick it is to answer.
    pub tick: Tick,
}

impl Control {
    /// The world's part: gives an order and waits, at most `limit`, until the supervisor has carried it out. The value
    /// is the supervisor's reply. One order at a time.
    ///
    /// # Errors
    /// [`BusError::NoAnswer`].
    pub fn give_order(&self, order: ProcessRequest, limit: Duration) -> Result<u32, BusError> {
        let words = self.orders();
        words.kind.store(order.kind as u32, Ordering::Relaxed);
        words.drone.store(order.drone.0, Ordering::Relaxed);
        words.tick.store(u32::try_from(order.tick).unwrap_or(u32::MAX), Ordering::Relaxed);
        let number = words.asked.load(Ordering::Relaxed).wrapping_add(1);
        words.asked.store(number, Ordering::Release);
        futex::wake_all(&words.asked);
        let end = Instant::now() + limit;
        loop {
            let answered = words.answered.load(Ordering::Acquire);
            if answered == number {
                return Ok(words.reply.load(Ordering::Relaxed));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(BusError::NoAnswer { what: format!("{order:?}"), limit_s: limit.as_secs_f64() });
            }
            futex::wait(&words.answered, answered, left.min(SLICE));
        }
    }

    /// The supervisor's part: waits at most `limit` for an order that is not yet answered.
    #[must_use]
    pub fn next_order(&self, limit: Duration) -> Option<ProcessRequest> {
        let words = self.orders();
        let answered = words.answered.load(Ordering::Relaxed);
        let mut asked = words.asked.load(Ordering::Acquire);
        if asked == answered {
            futex::wait(&words.asked, asked, limit);
            asked = words.asked.load(Ordering::Acquire);
        }
        if asked == answered {
            return None;
        }
        let kind = match words.kind.load(Ordering::Relaxed) {
            1 => RequestKind::Kill,
            2 => RequestKind::Freeze,
            3 => RequestKind::Resume,
            _ => RequestKind::Restart,
        };
        let tick = Tick::from(words.tick.load(Ordering::Relaxed));
        Some(ProcessRequest { kind, drone: DroneId(words.drone.load(Ordering::Relaxed)), tick })
    }

    /// The supervisor's part: the order is carried out. `reply` is handed to the world.
    pub fn answer_order(&self, reply: u32) {
        let words = self.orders();
        words.reply.store(reply, Ordering::Relaxed);
        words.answered.store(words.asked.load(Ordering::Relaxed), Ordering::Release);
        futex::wake_all(&words.answered);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{ControlSpec, WaitMode};

    fn control() -> Control {
        Control::create(ControlSpec { drones: 2, cores: 1, per_process: 1, wait: WaitMode::Block }).unwrap()
    }

    #[test]
    fn an_order_is_carried_out_once_and_answered() {
        let launcher = control();
        let world = Control::attach(launcher.fd().unwrap()).unwrap();
        let order = ProcessRequest { kind: RequestKind::Restart, drone: DroneId(1), tick: 70 };
        let supervisor = std::thread::spawn(move || {
            let mut seen = Vec::new();
            while seen.len() < 2 {
                if let Some(order) = launcher.next_order(Duration::from_millis(50)) {
                    seen.push(order);
                    launcher.answer_order(seen.len() as u32 + 6);
                }
            }
            assert_eq!(launcher.next_order(Duration::ZERO), None);
            seen
        });
        assert_eq!(world.give_order(order, Duration::from_secs(5)).unwrap(), 7);
        let kill = ProcessRequest { kind: RequestKind::Kill, ..order };
        assert_eq!(world.give_order(kill, Duration::from_secs(5)).unwrap(), 8);
        assert_eq!(supervisor.join().unwrap(), [order, kill]);
    }

    #[test]
    fn without_a_supervisor_the_world_does_not_wait_for_ever() {
        let order = ProcessRequest { kind: RequestKind::Kill, drone: DroneId(0), tick: 3 };
        let error = control().give_order(order, Duration::from_millis(20)).unwrap_err();
        assert!(matches!(error, BusError::NoAnswer { .. }), "{error}");
    }
}
