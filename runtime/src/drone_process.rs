//! A drone process: it waits for a tick, receives, steps its pilots, sends and answers. It flies one drone or several.

use crate::child_args::ChildArgs;
use crate::drone_factory::DroneFactory;
use crate::drone_range::DroneRange;
use crate::error::RuntimeError;
use crate::mission;
use crate::pilot_host::{PilotHost, StepScratch};
use crate::pilot_registry::PilotRegistry;
use skein_bus::{
    BusError, Control, Domain, DownlinkSubscriber, DroneEndpoint, SHARD_DRONES, Services, TickSignal, UplinkHeader,
    UplinkPublisher, pin_to_core, raise_file_limit,
};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, SimTime, Tick};
use std::sync::Arc;

/// Flies drones with the pilots that the scenario names until the mission ends.
///
/// # Errors
/// [`RuntimeError`]; the launcher notices that the process has ended.
pub fn run(args: &ChildArgs, range: DroneRange, pilots: &PilotRegistry) -> Result<(), RuntimeError> {
    args.bind_to_parent()?;
    raise_file_limit()?;
    let scenario = args.scenario()?;
    let control = Arc::new(Control::attach(args.control)?);
    pin_to_core(control.core_of(range.first.index()), args.pin)?;
    let domain = Domain::join(&args.domain)?;
    let services = Services::open(&domain, mission::drones(&scenario), &format!("drone-{}", range.first))?;
    let factory = DroneFactory::new(&scenario, pilots);
    let start = SimTime(range.first_tick as i64 * mission::dt_ns(&scenario));
    let mut drones = Vec::with_capacity(range.count as usize);
    for id in range.ids() {
        let barrier = DroneEndpoint::new(Arc::clone(&control), id.index())?.bound();
        drones.push(DroneHandle {
            id,
            pilot_host: factory.pilot_host(id, range.incarnation, start)?,
            barrier,
            slot: Slot::default(),
            ended: false,
        });
    }
    let mut process = DroneProcess::new(&services, range.incarnation, drones)?;
    process.announce();
    process.fly()
}

/// The shard of the uplink on which a drone sends.
fn shard(id: DroneId) -> usize {
    id.index() / SHARD_DRONES
}

/// The drones of this process, and the ports that they share.
struct DroneProcess {
    incarnation: u32,
    downlink: DownlinkSubscriber,
    /// One publisher per shard, from `first_shard` on.
    uplinks: Vec<UplinkPublisher>,
    first_shard: usize,
    drones: Vec<DroneHandle>,
    scratch: StepScratch,
    /// Number of downlinks that could not be used.
    skipped: u64,
}

impl DroneProcess {
    fn new(services: &Services, incarnation: u32, drones: Vec<DroneHandle>) -> Result<Self, RuntimeError> {
        let shard_of = |drone: Option<&DroneHandle>| drone.map_or(0, |drone| shard(drone.id));
        let (first_shard, last_shard) = (shard_of(drones.first()), shard_of(drones.last()));
        let uplinks = (first_shard..=last_shard).map(|shard| services.uplink_publisher(shard * SHARD_DRONES));
        Ok(Self {
            incarnation,
            uplinks: uplinks.collect::<Result<_, _>>()?,
            downlink: services.downlink_subscriber()?,
            first_shard,
            drones,
            scratch: StepScratch::default(),
            skipped: 0,
        })
    }

    /// Tells the launcher that the drones are ready.
    fn announce(&self) {
        for drone in &self.drones {
            drone.barrier.announce(self.incarnation);
        }
    }

    fn fly(&mut self) -> Result<(), RuntimeError> {
        loop {
            let Some((first, others)) = self.drones.split_first_mut() else { return Ok(()) };
            let TickSignal::Tick(tick) = first.barrier.wait_tick(|| true) else { return Ok(()) };
            for drone in others {
                drone.barrier.join_tick(tick);
            }
            self.answer(tick)?;
        }
    }

    /// Counts a downlink that cannot be used, and says so at the first, the second, the fourth …
    fn skip(&mut self, what: &str) {
        self.skipped += 1;
        if self.skipped.is_power_of_two() {
            let drone = self.drones.first().map(|drone| drone.id.0);
            tracing::warn!(?drone, "{what}: skipped; {} so far", self.skipped);
        }
    }

    /// Reads the downlinks up to that of `tick`, and answers that one.
    fn answer(&mut self, tick: Tick) -> Result<(), RuntimeError> {
        let resume_from = self.drones.first().map_or(0, |drone| drone.barrier.resume_from());
        while let Some(sample) = self.downlink.receive()? {
            if sample.tick() < resume_from {
                // Its frames were sent while this process was stopped: they are lost.
                continue;
            }
            let down = match DownlinkView::parse(sample.bytes()) {
                Ok(down) => down,
                Err(error) => {
                    self.skip(&format!("the downlink of tick {}: {error}", sample.tick()));
                    continue;
                }
            };
            // The world sends a downlink before it opens the tick.
            let newest = self.drones.first().map_or(tick, |drone| drone.barrier.newest_tick().saturating_add(1));
            if sample.tick() > newest {
                self.skip(&format!("a downlink of tick {}, which has not come", sample.tick()));
                continue;
            }
            if sample.tick() < tick {
                for drone in &mut self.drones {
                    drone.pilot_host.receive_late(&down, &mut self.scratch, drone.barrier.stats_mut());
                }
                continue;
            }
            for drone in self.drones.iter_mut().filter(|drone| !drone.pilot_host.has_failed()) {
                let header = UplinkHeader { tick, source: drone.id.0, incarnation: self.incarnation };
                let uplink = &self.uplinks[shard(drone.id) - self.first_shard];
                drone.step(&down, &mut self.scratch, header, uplink)?;
            }
            // The world waits for drones in the order of their ids. Once the first has answered, all have.
            for drone in self.drones.iter_mut().rev().filter(|drone| !drone.ended) {
                drone.barrier.finish(tick, &drone.slot);
                // The tick in which its pilot failed is the last one that it answers.
                drone.ended = drone.pilot_host.has_failed();
            }
            break;
        }
        Ok(())
    }
}

/// One drone of the process.
struct DroneHandle {
    id: DroneId,
    pilot_host: PilotHost,
    barrier: DroneEndpoint,
    slot: Slot,
    /// Whether it has answered its last tick.
    ended: bool,
}

impl DroneHandle {
    /// Steps the pilot and sends what it says.
    fn step(
        &mut self,
        down: &DownlinkView<'_>,
        scratch: &mut StepScratch,
        header: UplinkHeader,
        uplink: &UplinkPublisher,
    ) -> Result<(), RuntimeError> {
        let watch = self.barrier.stopwatch();
        let lap = watch.start();
        let said = self.pilot_host.step(down, scratch, &mut self.slot, self.barrier.stats_mut());
        if !said.is_empty() {
            let encode_all = |out: &mut [Frame]| {
                for (place, frame) in out.iter_mut().zip(said.frames()) {
                    *place = frame;
                }
            };
            match uplink.send(header, said.len(), encode_all) {
                // This happens by the wall clock only: the world is far behind, and these frames are lost.
                Err(BusError::Full { .. }) => {}
                sent => sent?,
            }
        }
        self.slot.step_ns = watch.ns(lap);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run::TestRun;
    use skein_bus::{ControlSpec, DownlinkPublisher, Patience, TickOutcome, WaitMode};
    use skein_world::World;
    use std::time::Duration;

    /// The process of the only drone of a run, and what the world would have.
    struct OneDrone {
        process: DroneProcess,
        downlink: DownlinkPublisher,
        world: World,
        control: Arc<Control>,
    }

    impl OneDrone {
        fn of(run: &TestRun) -> Self {
            let spec = ControlSpec { drones: 1, cores: 1, per_process: 1, wait: WaitMode::Block };
            let control = Arc::new(Control::create(spec).unwrap());
            let pilots = PilotRegistry::built_in().unwrap();
            let (id, barrier) = (DroneId(0), DroneEndpoint::new(Arc::clone(&control), 0).unwrap());
            let pilot_host = DroneFactory::new(run.scenario(), &pilots).pilot_host(id, 1, SimTime(0)).unwrap();
            let drone = DroneHandle { id, pilot_host, barrier, slot: Slot::default(), ended: false };
            let downlink = run.services().downlink_publisher().unwrap();
            let process = DroneProcess::new(run.services(), 1, vec![drone]).unwrap();
            Self { process, downlink, world: mission::world(run.scenario()).unwrap(), control }
        }

        fn publish(&self, tick: Tick, bytes: &[u8]) {
            assert_eq!(self.downlink.send(tick, bytes.len(), |place| place.copy_from_slice(bytes)).unwrap(), 1);
        }

        /// Opens a tick and lets the drone answer. What the world then has of it.
        fn answer(&mut self, tick: Tick) -> TickOutcome {
            self.control.open_tick(tick).unwrap();
            let drone = &mut self.process.drones[0].barrier;
            assert_eq!(drone.wait_tick(|| true), TickSignal::Tick(tick));
            self.process.answer(tick).unwrap();
            let mut outcomes = [TickOutcome::Pending];
            self.control.wait_done(tick, Patience::For(Duration::from_millis(50)), &mut outcomes).unwrap();
            outcomes[0]
        }
    }

    #[test]
    fn malformed_and_foreign_downlinks_are_skipped_and_counted() {
        let run = TestRun::new("[formation]\ndrones = 1\n");
        let mut one = OneDrone::of(&run);
        let mut honest = vec![0; one.world.downlink().byte_len().next_multiple_of(8)];
        let len = one.world.downlink().byte_len();
        one.world.downlink().write_to(&mut honest[..len]);
        let honest = honest[..len].to_vec();
        let hostile = [&honest[..40], &[0xff; 512], &[][..]];
        for bytes in hostile {
            one.publish(0, bytes);
        }
        // Well-formed, and of a tick that has not come.
        one.publish(1 << 40, &honest);
        one.publish(0, &honest);
        assert_eq!(one.answer(0), TickOutcome::Done, "the honest one is answered");
        assert_eq!(one.process.skipped, 4);
    }

    #[test]
    fn a_drone_without_an_honest_downlink_does_not_answer_and_lives() {
        let run = TestRun::new("[formation]\ndrones = 1\n");
        let mut one = OneDrone::of(&run);
        one.publish(0, &[0xff; 64]);
        assert_eq!(one.answer(0), TickOutcome::Hung, "it has nothing to answer to");
        assert_eq!(one.process.skipped, 1);
    }
}
