//! One flight on a host: the drones of one run.

use crate::begin::{Begin, Reply};
use crate::down::{Down, OpenTick};
use crate::error::HostsError;
use crate::names;
use crate::up::{self, AnswerMessage, Standing};
use crossbeam_channel::{Receiver, RecvTimeoutError, unbounded};
use skein_bus::TickOutcome;
use skein_runtime::{Program, Wing, WingLaunch};
use skein_scenario::Scenario;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

/// Time between two looks at whether a drone has died and whether the host is to end, while no message comes. Chosen by hand.
const POLL: Duration = Duration::from_millis(50);

/// What a relay asked for, and its scenario.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'b> {
    /// The request.
    pub(crate) begin: &'b Begin,
    /// The scenario of the request.
    pub(crate) scenario: &'b Scenario,
}

/// Flies the drones that a relay asked for until the run ends, the relay is gone, or the host ends.
pub(crate) fn fly(
    session: &Session,
    program: &Program,
    query: &Query,
    asked: Asked<'_>,
    ended: &AtomicBool,
) -> Result<(), HostsError> {
    let mut flight = match Flight::begin(session, program, asked, ended) {
        Ok(flight) => flight,
        Err(error) => {
            reply(query, &Reply::Refused(error.to_string()))?;
            return Err(error);
        }
    };
    reply(query, &Reply::Ready)?;
    flight.serve(ended)
}

/// Replies to a request.
pub(crate) fn reply(query: &Query, reply: &Reply) -> Result<(), HostsError> {
    let bytes = serde_json::to_vec(reply).map_err(|_| HostsError::Message("a reply cannot be written"))?;
    query.reply(query.key_expr(), bytes).wait().map_err(HostsError::network("replying to a launcher"))
}

struct Flight<'b> {
    asked: Asked<'b>,
    wing: Wing<'b>,
    standing: Vec<Standing>,
    messages: Receiver<Vec<u8>>,
    lost: Arc<AtomicBool>,
    publisher: Publisher<'b>,
    /// What Zenoh keeps as long as the flight lasts.
    _declared: (Box<dyn std::any::Any>, Box<dyn std::any::Any>, Box<dyn std::any::Any>),
}

impl<'b> Flight<'b> {
    fn begin(
        session: &Session,
        program: &'b Program,
        asked: Asked<'b>,
        ended: &AtomicBool,
    ) -> Result<Self, HostsError> {
        let begin = asked.begin;
        let flight = &begin.flight;
        let (sender, messages) = unbounded();
        let down = session
            .declare_subscriber(names::down(flight))
            .callback(move |sample| _ = sender.send(sample.payload().to_bytes().into_owned()))
            .wait()
            .map_err(HostsError::network("listening to the relay"))?;
        let lost = Arc::new(AtomicBool::new(false));
        let noted = Arc::clone(&lost);
        let watch = session
            .liveliness()
            .declare_subscriber(names::relay(flight))
            .callback(move |sample| noted.store(sample.kind() == SampleKind::Delete, Ordering::Release))
            .wait()
            .map_err(HostsError::network("watching the relay"))?;
        let publisher = session
            .declare_publisher(names::up(flight))
            .congestion_control(CongestionControl::Block)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(HostsError::network("offering to answer"))?;
        let token = session.liveliness().declare_token(names::wing(flight)).wait();
        let token = token.map_err(HostsError::network("declaring the flight"))?;
        if !is_alive(session, flight) {
            return Err(HostsError::Message("its sender is gone"));
        }
        let launch = WingLaunch {
            scenario: asked.scenario,
            drones: begin.drones(),
            pin: begin.pin(),
            wait: begin.wait(),
            per_process: begin.per_process,
            program,
        };
        skein_bus::clean()?;
        let wing = Wing::start(&launch, || lost.load(Ordering::Acquire) || ended.load(Ordering::Acquire))?;
        let standing = vec![Standing::default(); launch.drones.count as usize];
        Ok(Self {
            asked,
            wing,
            standing,
            messages,
            lost,
            publisher,
            _declared: (Box::new(down), Box::new(watch), Box::new(token)),
        })
    }

    fn serve(&mut self, ended: &AtomicBool) -> Result<(), HostsError> {
        let first = self.asked.begin.drones().first.index();
        let (drones, count) = (first..first + self.standing.len(), self.asked.scenario.formation.drones as usize);
        while !self.lost.load(Ordering::Acquire) && !ended.load(Ordering::Acquire) {
            let bytes = match self.messages.recv_timeout(POLL) {
                Ok(bytes) => bytes,
                Err(RecvTimeoutError::Timeout) => {
                    self.wing.reap();
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            let message = match Down::read(&bytes, &drones, count)? {
                Down::Tick(open) => self.tick(&open)?,
                Down::Request(request) => up::done(self.wing.serve(request)),
                Down::End => return Ok(()),
            };
            self.publisher.put(message).wait().map_err(HostsError::network("answering the relay"))?;
        }
        Ok(())
    }

    fn tick(&mut self, open: &OpenTick) -> Result<Vec<u8>, HostsError> {
        self.wing.reap();
        for (tick, words) in &open.downlinks {
            self.wing.send(*tick, bytemuck::cast_slice(words))?;
        }
        self.wing.tick(open.tick, open.limit, self.asked.begin.lossy)?;
        let mut message = AnswerMessage::new(open.tick);
        for (id, before) in self.wing.range().ids().zip(&mut self.standing) {
            let outcome = self.wing.outcome(id);
            let (slot, stats, frames) = self.wing.answer(id);
            let end = self.wing.end(id).filter(|_| outcome == TickOutcome::Dead);
            let said = if outcome == TickOutcome::Done { frames } else { &[] };
            message.push((outcome, end), (before, Standing { slot, stats }), said);
        }
        Ok(message.finish())
    }
}

/// Whether the relay of a flight is there.
fn is_alive(session: &Session, flight: &str) -> bool {
    let found = session.liveliness().get(names::relay(flight)).wait();
    found.is_ok_and(|replies| replies.recv().is_ok_and(|reply| reply.result().is_ok()))
}
