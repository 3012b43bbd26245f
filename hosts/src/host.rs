//! A host: it offers drones to runs elsewhere, and flies those that are asked for.

use crate::begin::{self, Begin, Reply};
use crate::cli::{HostArgs, Words};
use crate::error::HostsError;
use crate::flight::{Asked, fly, reply};
use crate::network::Side;
use crate::say::say;
use crate::signals::watch_signals;
use crate::{keys, names};
use crossbeam_channel::{RecvTimeoutError, unbounded};
use skein_runtime::Program;
use skein_scenario::Scenario;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// Time between two looks for a signal. Chosen by hand.
const POLL: Duration = Duration::from_millis(50);

/// Offers this machine until a signal comes. Returns the exit code.
///
/// # Errors
/// [`HostsError`] if the machine cannot be offered.
pub(crate) fn run(args: &HostArgs) -> Result<u8, HostsError> {
    if let Some(folder) = &args.init_keys {
        keys::make(folder)?;
        say(&format!(
            "keys are in {0}: hosts need authority.pem, host.pem and host-key.pem, launchers need authority.pem, \
             launcher.pem and launcher-key.pem",
            folder.display()
        ));
        return Ok(0);
    }
    let name = args.name.clone().unwrap_or_else(machine_name);
    if !names::is_name(&name) {
        let expected = "expected at most 64 letters, digits, `.`, `_` or `-`";
        return Err(HostsError::Usage(format!("--name: found {name:?}, {expected}")));
    }
    let signal = watch_signals()?;
    skein_bus::clean()?;
    let session = args.network.open(&args.listen, Side::Host)?;
    let program = Arc::new(program(args)?);
    let host = Host { name, session, program, offered: args.drones, used: Arc::default(), ended: Arc::default() };
    host.serve(args, &signal)
}

/// A machine that is offered.
struct Host {
    name: String,
    session: Session,
    program: Arc<Program>,
    /// Number of drones that it can fly at a time.
    offered: u32,
    /// Number of drones that fly here now.
    used: Arc<AtomicU32>,
    /// Whether all flights are to end.
    ended: Arc<AtomicBool>,
}

impl Host {
    fn serve(&self, args: &HostArgs, signal: &AtomicUsize) -> Result<u8, HostsError> {
        let (sender, queries) = unbounded();
        let _offer = self
            .session
            .declare_queryable(names::begin(&self.name))
            .callback(move |query| _ = sender.send(query))
            .wait()
            .map_err(HostsError::network("offering drones"))?;
        let token = self.session.liveliness().declare_token(names::alive(&self.name)).wait();
        let _token = token.map_err(HostsError::network("offering drones"))?;
        say(&format!("host {} offers {} drones at {}", self.name, self.offered, args.listen.join(", ")));
        let mut flights: Vec<JoinHandle<()>> = Vec::new();
        let number = loop {
            match signal.load(Ordering::Relaxed) {
                0 => {}
                number => break number,
            }
            match queries.recv_timeout(POLL) {
                Ok(query) => flights.extend(self.begin(query)),
                Err(RecvTimeoutError::Timeout) => flights.retain(|flight| !flight.is_finished()),
                Err(RecvTimeoutError::Disconnected) => return Err(HostsError::Message("the session is closed")),
            }
        };
        self.ended.store(true, Ordering::Release);
        for flight in flights {
            // A flight that panicked has ended as well.
            let _ = flight.join();
        }
        Ok(128_u8.wrapping_add(number as u8))
    }

    /// Begins a flight in a thread of its own, or refuses it.
    fn begin(&self, query: Query) -> Option<JoinHandle<()>> {
        match self.accept(&query) {
            Ok((begin, scenario)) => Some(self.spawn(query, begin, scenario)),
            Err(why) => {
                tracing::warn!("a request for drones is refused: {why}");
                if let Err(error) = reply(&query, &Reply::Refused(why)) {
                    tracing::warn!(%error, "the launcher does not know that it is refused");
                }
                None
            }
        }
    }

    /// Reads a request and takes up its drones.
    fn accept(&self, query: &Query) -> Result<(Begin, Scenario), String> {
        let bytes = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
        let begin = begin::parse(&bytes)?;
        let scenario = begin.scenario()?;
        if let Some(why) = begin.objection(&scenario, &self.program) {
            return Err(why);
        }
        let (wanted, used) = (begin.drones().count, self.used.load(Ordering::Acquire));
        if wanted > self.offered.saturating_sub(used) {
            return Err(format!(
                "it offers {} drones, {used} fly already, and {wanted} more were asked for",
                self.offered
            ));
        }
        self.used.fetch_add(wanted, Ordering::AcqRel);
        Ok((begin, scenario))
    }

    fn spawn(&self, query: Query, begin: Begin, scenario: Scenario) -> JoinHandle<()> {
        let (session, program) = (self.session.clone(), Arc::clone(&self.program));
        let (used, ended) = (Arc::clone(&self.used), Arc::clone(&self.ended));
        std::thread::spawn(move || {
            let asked = Asked { begin: &begin, scenario: &scenario };
            if let Err(error) = fly(&session, &program, &query, asked, &ended) {
                tracing::warn!(%error, "a flight ended early");
            }
            used.fetch_sub(begin.drones().count, Ordering::AcqRel);
        })
    }
}

/// The program that flies drones: the one that started this one, or `skein` beside it.
fn program(args: &HostArgs) -> Result<Program, HostsError> {
    if let Some(Words(words)) = &args.program {
        return Ok(Program::of_command(words));
    }
    let own = std::env::current_exe().map_err(HostsError::system("finding this executable"))?;
    Ok(Program::new(vec![own.with_file_name("skein").into()]))
}

fn machine_name() -> String {
    // Without /proc there is no name, and the message that refuses it names the option.
    std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned()
}
