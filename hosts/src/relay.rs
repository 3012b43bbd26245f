//! The relay: on the launcher's machine, it takes the place of the drones of one host.

use crate::begin::{Begin, Reply};
use crate::cli::RelayArgs;
use crate::down::{self, TickMessage};
use crate::error::HostsError;
use crate::lateness::Lateness;
use crate::names;
use crate::network::Side;
use crate::reader::Reader;
use crate::seat::Seat;
use crate::up::{Up, read_answer};
use crossbeam_channel::{Receiver, Sender, unbounded};
use skein_bus::{
    Control, Domain, DownlinkSubscriber, PinMode, RequestKind, SHARD_DRONES, Services, TickSignal, TickWatch,
    UplinkPublisher, raise_file_limit,
};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::{DroneId, Tick};
use skein_runtime::{ChildArgs, Clock, DroneRange, HostReport, RelayRequest, RelayWord};
use skein_scenario::Scenario;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

/// How long a relay waits for a host to be found. Chosen by hand: the time for which it tries to connect.
const FIND_LIMIT: Duration = Duration::from_secs(5);
/// Time between two looks for a host. Chosen by hand.
const FIND_POLL: Duration = Duration::from_millis(20);
/// How long the drones of a host may take to start: 30 s, and a tenth of a second for each. Chosen by hand: more than the host waits.
const START_LIMIT: Duration = Duration::from_secs(30);
const START_LIMIT_PER_DRONE: Duration = Duration::from_millis(100);
/// The share of the world's patience that a drone has on its host. The rest is for the network.
const PATIENCE_SHARE: f64 = 0.8;

/// Takes the place of the drones until the mission ends.
///
/// # Errors
/// [`HostsError`]; the launcher notices that the process has ended.
pub(crate) fn run(args: &RelayArgs) -> Result<(), HostsError> {
    let pin = if args.pin == "auto" { PinMode::Auto } else { PinMode::Off };
    let child = ChildArgs { domain: args.domain.clone(), control: args.control, parent: args.parent, pin };
    child.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = child.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    let session = args.network.open(&[], Side::Launcher)?;
    let flight = format!("{}-{}", session.zid(), args.id);
    let (line, gone) = subscribe(&session, &flight)?;
    let over = end_with_host(gone, args.host.clone());
    let _token = session.liveliness().declare_token(names::relay(&flight)).wait();
    let publisher = session
        .declare_publisher(names::down(&flight))
        .congestion_control(CongestionControl::Block)
        .priority(Priority::RealTime)
        .express(true)
        .wait()
        .map_err(HostsError::network("offering to send"))?;
    find(&session, args)?;
    begin(&session, (flight, pin, &control), &scenario, args)?;
    wait_matching(&publisher, args)?;
    let mut relay = Relay::new(args, (&scenario, control), Arc::new(publisher), line)?;
    relay.serve_requests();
    relay.fly()?;
    over.store(true, Ordering::Release);
    relay.send(down::end())?;
    relay.report();
    Ok(())
}

/// What the host says: answers to ticks, and replies to requests.
struct Line {
    answers: Receiver<Vec<u8>>,
    replies: Receiver<u32>,
}

/// Ends this process once its host is gone, whatever it waits for, unless the flight is over.
fn end_with_host(gone: Receiver<()>, host: String) -> Arc<AtomicBool> {
    let over = Arc::new(AtomicBool::new(false));
    let done = Arc::clone(&over);
    std::thread::spawn(move || {
        if gone.recv().is_ok() && !done.load(Ordering::Acquire) {
            eprintln!("warning: {}", HostsError::Gone(host));
            std::process::exit(3);
        }
    });
    over
}

/// Listens to a flight. The subscribers last as long as the session.
fn subscribe(session: &Session, flight: &str) -> Result<(Line, Receiver<()>), HostsError> {
    let (to_answers, answers) = unbounded();
    let (to_replies, replies) = unbounded();
    let (lost, gone) = unbounded();
    session
        .declare_subscriber(names::up(flight))
        .callback(move |sample| sort(sample.payload().to_bytes().into_owned(), &to_answers, &to_replies))
        .background()
        .wait()
        .map_err(HostsError::network("listening to the host"))?;
    session
        .liveliness()
        .declare_subscriber(names::wing(flight))
        .callback(move |sample| {
            if sample.kind() == SampleKind::Delete {
                // No one listens any more once the flight is over.
                let _ = lost.send(());
            }
        })
        .background()
        .wait()
        .map_err(HostsError::network("watching the host"))?;
    Ok((Line { answers, replies }, gone))
}

fn sort(bytes: Vec<u8>, answers: &Sender<Vec<u8>>, replies: &Sender<u32>) {
    // As above: a closed channel means that the flight is over.
    match Up::read(&mut Reader(&bytes)) {
        Ok(Up::Tick(_)) => _ = answers.send(bytes),
        Ok(Up::Done(reply)) => _ = replies.send(reply),
        Err(error) => tracing::warn!(%error, "a message of a host is skipped"),
    }
}

/// Waits until the host is there.
fn find(session: &Session, args: &RelayArgs) -> Result<(), HostsError> {
    let since = Instant::now();
    while since.elapsed() < FIND_LIMIT {
        let found = session.liveliness().get(names::alive(&args.host)).timeout(FIND_LIMIT).wait();
        let found = found.map_err(HostsError::network("looking for the host"))?;
        if found.recv().is_ok_and(|reply| reply.result().is_ok()) {
            return Ok(());
        }
        std::thread::sleep(FIND_POLL);
    }
    Err(HostsError::NotFound { host: args.host.clone(), at: args.network.connect.join(", ") })
}

/// Has the host start the drones.
fn begin(
    session: &Session,
    (flight, pin, control): (String, PinMode, &Control),
    scenario: &Scenario,
    args: &RelayArgs,
) -> Result<(), HostsError> {
    let how = (pin, control.spec().wait, args.per_process);
    let own = args.own_program.clone();
    let begin = Begin::new((flight, range(args)), scenario, how, args.clock != Clock::Lockstep, own)?;
    let refused = |why: String| HostsError::Refused { host: args.host.clone(), why };
    let replies = session
        .get(names::begin(&args.host))
        .payload(serde_json::to_vec(&begin).map_err(|error| refused(error.to_string()))?)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(START_LIMIT + START_LIMIT_PER_DRONE * args.count)
        .wait()
        .map_err(HostsError::network("asking the host for drones"))?;
    let reply = replies.recv().map_err(|_| refused("it did not reply to the request for drones".to_owned()))?;
    let sample = reply
        .into_result()
        .map_err(|error| refused(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()))?;
    match serde_json::from_slice(&sample.payload().to_bytes()) {
        Ok(Reply::Ready) => Ok(()),
        Ok(Reply::Refused(why)) => Err(refused(why)),
        Err(error) => Err(refused(format!("its reply cannot be read: {error}"))),
    }
}

/// Waits until what is sent arrives.
fn wait_matching(publisher: &Publisher<'_>, args: &RelayArgs) -> Result<(), HostsError> {
    let since = Instant::now();
    while !publisher.matching_status().wait().is_ok_and(|status| status.matching()) {
        if since.elapsed() > FIND_LIMIT {
            return Err(HostsError::Gone(args.host.clone()));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

fn range(args: &RelayArgs) -> DroneRange {
    let RelayArgs { id, count, incarnation, first_tick, .. } = *args;
    DroneRange { first: DroneId(id), count, incarnation, first_tick }
}

/// The drones of a host, as the world sees them.
struct Relay {
    host: String,
    range: DroneRange,
    limit: Duration,
    watch: TickWatch,
    downlink: DownlinkSubscriber,
    /// One publisher per shard, from `first_shard` on.
    uplinks: Vec<UplinkPublisher>,
    first_shard: usize,
    seats: Vec<Seat>,
    incarnations: Arc<Vec<Arc<AtomicU32>>>,
    control: Arc<Control>,
    publisher: Arc<Publisher<'static>>,
    line: Line,
    lateness: Lateness,
    bytes: [u64; 2],
    /// Keeps the ports open.
    _services: Services,
    _domain: Domain,
}

impl Relay {
    fn new(
        args: &RelayArgs,
        (scenario, control): (&Scenario, Arc<Control>),
        publisher: Arc<Publisher<'static>>,
        line: Line,
    ) -> Result<Self, HostsError> {
        let range = range(args);
        let domain = Domain::join(&args.domain)?;
        let services = Services::open(&domain, scenario.formation.drones as usize, &format!("relay-{}", args.host))?;
        let shards = (range.first.index() / SHARD_DRONES)..=((range.first.0 + range.count - 1) as usize / SHARD_DRONES);
        let incarnations: Vec<_> = range.ids().map(|_| Arc::new(AtomicU32::new(range.incarnation))).collect();
        let seats = range.ids().zip(&incarnations).map(|(id, own)| Seat::new(&control, id, Arc::clone(own)));
        let limit = match args.clock {
            Clock::Lockstep => args.patience.mul_f64(PATIENCE_SHARE),
            Clock::Realtime { speed } => Duration::from_secs_f64(scenario.time.dt_s / speed),
        };
        let relay = Self {
            host: args.host.clone(),
            limit,
            watch: TickWatch::new(Arc::clone(&control), range.first.index()),
            downlink: services.downlink_subscriber()?,
            first_shard: *shards.start(),
            uplinks: shards.map(|shard| services.uplink_publisher(shard * SHARD_DRONES)).collect::<Result<_, _>>()?,
            seats: seats.collect::<Result<_, _>>()?,
            incarnations: Arc::new(incarnations),
            range,
            publisher,
            line,
            lateness: Lateness::default(),
            bytes: [0; 2],
            _services: services,
            _domain: domain,
            control,
        };
        range.ids().for_each(|id| relay.control.announce(id.index(), range.incarnation));
        Ok(relay)
    }

    /// Serves the supervisor's requests in a thread of its own, because they come between ticks.
    fn serve_requests(&self) {
        let (publisher, replies) = (Arc::clone(&self.publisher), self.line.replies.clone());
        let (control, incarnations, first) =
            (Arc::clone(&self.control), Arc::clone(&self.incarnations), self.range.first.0);
        std::thread::spawn(move || {
            for line in BufReader::new(std::io::stdin()).lines().map_while(Result::ok) {
                let Ok(request) = serde_json::from_str::<RelayRequest>(&line) else { continue };
                // What a request before this one, which took too long, is answered with.
                while replies.try_recv().is_ok() {}
                if publisher.put(down::request(&request)).wait().is_err() {
                    return;
                }
                let Ok(reply) = replies.recv() else { return };
                if (request.kind(), reply) == (Some(RequestKind::Restart), request.incarnation) {
                    if let Some(own) = incarnations.get((request.drone - first) as usize) {
                        own.store(reply, Ordering::Release);
                    }
                    control.announce(request.drone as usize, reply);
                }
                say(&RelayWord::Done(reply));
            }
        });
    }

    fn fly(&mut self) -> Result<(), HostsError> {
        while let TickSignal::Tick(tick) = self.watch.wait() {
            let opened = Instant::now();
            if !self.join(tick) {
                // The world does not wait for any of these drones: they are dead or frozen.
                continue;
            }
            if let Some((tick, message)) = self.message(tick)? {
                self.join(tick);
                self.send(message)?;
                self.take_answers(tick)?;
                self.lateness.note(opened.elapsed());
            }
        }
        Ok(())
    }

    /// Begins a tick in all seats. False if no drone may answer it.
    fn join(&mut self, tick: Tick) -> bool {
        // All of them, not only up to the first that may answer.
        self.seats.iter_mut().filter_map(|seat| seat.join(tick).then_some(())).count() > 0
    }

    /// The message that opens a tick, or by the wall clock a newer one that has been sent meanwhile; `None` if no downlink has come.
    fn message(&self, tick: Tick) -> Result<Option<(Tick, Vec<u8>)>, HostsError> {
        let first = self.range.first.index();
        let mut message = TickMessage::new(first..first + self.range.count as usize, self.limit);
        while let Some(sample) = self.downlink.receive()? {
            // The world sends a downlink before it opens the tick.
            let newest = self.seats.first().map_or(tick, |seat| seat.newest_tick().saturating_add(1));
            match DownlinkView::parse(sample.bytes()) {
                // The world sends no others, and what others send is skipped.
                Err(error) => tracing::warn!(%error, "a downlink is skipped"),
                Ok(_) if sample.tick() > newest => tracing::warn!("a downlink of tick {} is skipped", sample.tick()),
                Ok(down) => {
                    message.push(sample.tick(), &down);
                    if sample.tick() >= tick {
                        return Ok(Some((sample.tick(), message.finish())));
                    }
                }
            }
        }
        Ok(None)
    }

    fn send(&mut self, message: Vec<u8>) -> Result<(), HostsError> {
        self.bytes[0] += message.len() as u64;
        self.publisher.put(message).wait().map_err(HostsError::network("sending to the host"))
    }

    /// Waits for the answers to a tick, however long they take: if the host is gone, this process ends. Answers to earlier ticks come first.
    fn take_answers(&mut self, tick: Tick) -> Result<(), HostsError> {
        loop {
            let bytes = self.line.answers.recv().map_err(|_| HostsError::Gone(self.host.clone()))?;
            self.bytes[1] += bytes.len() as u64;
            let mut reader = Reader(&bytes);
            let Up::Tick(answered) = Up::read(&mut reader)? else { continue };
            for seat in &mut self.seats {
                let answer = read_answer(&mut reader, &mut seat.standing)?;
                let uplink = &self.uplinks[seat.shard() - self.first_shard];
                seat.take(answered, &answer, uplink)?;
            }
            if answered == tick {
                return Ok(());
            }
        }
    }

    /// Tells the supervisor what this relay has counted.
    fn report(&mut self) {
        let lateness = std::mem::take(&mut self.lateness);
        let [bytes_down, bytes_up] = self.bytes;
        let ticks = lateness.ticks();
        say(&RelayWord::End(HostReport { ticks, lateness_us: lateness.percentiles_us(), bytes_down, bytes_up }));
    }
}

/// Says something to the supervisor, at the other end of the standard input. If it is gone, this process ends, too.
fn say(word: &RelayWord) {
    let Ok(mut line) = serde_json::to_vec(word) else { return };
    line.push(b'\n');
    if let Ok(input) = std::io::stdin().as_fd().try_clone_to_owned() {
        let _ = File::from(input).write_all(&line);
    }
}
