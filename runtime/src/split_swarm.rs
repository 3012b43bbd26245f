//! A swarm whose world is divided by space, flown by function calls in one thread. It measures what each part would have to do.

use crate::drone_factory::DroneFactory;
use crate::error::RuntimeError;
use crate::mission;
use crate::pilot_host::{PilotHost, StepScratch};
use crate::pilot_registry::PilotRegistry;
use skein_protocol::frame::Frame;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime, Tick};
use skein_scenario::Scenario;
use skein_world::split::{Announcement, Halo, Reaches, SplitDigest, TickShare, Tiles, WorldPart};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What one part did in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PartTick {
    /// Number of its drones.
    pub drones: u32,
    /// Number of bodies of other parts that it knew of.
    pub halo_bodies: u32,
    /// Number of frames that it went through for its drones: those of the tick before that one of them may hear.
    pub frames: u32,
    /// Time for its drones' steps.
    pub steps: Duration,
    /// Time for its world: senses, bodies, what is around them.
    pub world: Duration,
    /// Time to choose and to sort in what is sent to and by other parts.
    pub exchange: Duration,
    /// Bodies that it told other parts of, each as often as it was told.
    pub sent_bodies: u32,
    /// Frames that it passed on to other parts, each as often as it was passed on.
    pub sent_frames: u32,
    /// Bytes of these bodies.
    pub sent_body_bytes: u64,
    /// Bytes of these frames.
    pub sent_frame_bytes: u64,
    /// All bytes that it sent to other parts.
    pub sent_bytes: u64,
    /// Bytes of its share of the digest.
    pub digest_bytes: u64,
}

/// A swarm whose world is divided by space into parts.
pub struct SplitSwarm {
    parts: Vec<WorldPart>,
    drones: Vec<SplitDrone>,
    scratch: StepScratch,
    digest: SplitDigest,
    tick: Tick,
    done: Vec<PartTick>,
}

/// One drone and its answer to the current tick. It reads the downlink of the part that it belongs to, and nothing else.
struct SplitDrone {
    pilot_host: PilotHost,
    slot: Slot,
    frames: Vec<Frame>,
    stats: LinkStats,
}

impl SplitSwarm {
    /// A swarm at the start of its mission, with its world in so many parts.
    ///
    /// # Errors
    /// [`RuntimeError::Split`] if the scenario has what a divided world has not, and as [`crate::inline::run`].
    pub fn new(scenario: &Scenario, pilots: &PilotRegistry, parts: usize) -> Result<Self, RuntimeError> {
        pilots.check(scenario, true)?;
        let factory = DroneFactory::new(scenario, pilots);
        let starts = mission::starts(scenario);
        let places: Vec<_> = starts.iter().map(|(position, _)| position.xy()).collect();
        let tiles = Arc::new(Tiles::new(&places, parts, scenario.drone.speed_mps));
        let reaches = Arc::new(Reaches::new(&scenario.radio(), scenario.formation.drones));
        let (params, shapes) = (mission::world_params(scenario)?, scenario.shapes().map_err(RuntimeError::Shape)?);
        let part = |number| {
            let shared = (Arc::clone(&tiles), Arc::clone(&reaches));
            WorldPart::new(number, shared, &params, &starts, &shapes)
        };
        let drone = |id| {
            let pilot_host = factory.pilot_host(DroneId(id), 1, SimTime::ZERO)?;
            let (slot, frames, stats) = (Slot::default(), Vec::new(), LinkStats::default());
            Ok(SplitDrone { pilot_host, slot, frames, stats })
        };
        Ok(Self {
            parts: (0..tiles.count()).map(part).collect::<Result<_, _>>()?,
            drones: (0..scenario.formation.drones).map(drone).collect::<Result<_, RuntimeError>>()?,
            scratch: StepScratch::default(),
            digest: SplitDigest::default(),
            tick: 0,
            done: Vec::new(),
        })
    }

    /// Flies one tick. Returns what each part did in it.
    ///
    /// # Errors
    /// [`RuntimeError::Split`] if a pilot has failed.
    pub fn tick(&mut self) -> Result<&[PartTick], RuntimeError> {
        self.done.clear();
        self.done.resize(self.parts.len(), PartTick::default());
        let mut shares = Vec::with_capacity(self.parts.len());
        for number in 0..self.parts.len() {
            shares.push(self.step_part(number)?);
        }
        let announcements: Vec<Announcement> = shares.iter().map(|share| share.announcement.clone()).collect();
        let mut halos = Vec::with_capacity(self.parts.len());
        for ((number, part), done) in self.parts.iter_mut().enumerate().zip(&mut self.done) {
            let began = Instant::now();
            let left = part.leave(&announcements);
            done.exchange += began.elapsed();
            for (_, halo) in left.iter().enumerate().filter(|(to, _)| *to != number) {
                done.sent_bodies += halo.bodies() as u32;
                done.sent_frames += halo.frames() as u32;
                done.sent_body_bytes += halo.body_bytes() as u64;
                done.sent_frame_bytes += halo.frame_bytes() as u64;
                done.sent_bytes += halo.byte_len() as u64;
            }
            halos.push(left);
        }
        self.meet(&halos);
        self.digest.fold(self.tick, &shares);
        self.tick += 1;
        Ok(&self.done)
    }

    /// The digest so far: that of [`crate::inline::run`] after as many ticks.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.digest.value()
    }

    fn step_part(&mut self, number: usize) -> Result<TickShare, RuntimeError> {
        let (part, done) = (&mut self.parts[number], &mut self.done[number]);
        let opened = Instant::now();
        let ids = part.ids().to_vec();
        let halo_bodies = part.halo_len() as u32;
        let down = part.downlink().view();
        let frames = down.frames.len() as u32;
        let sensed = Instant::now();
        for &id in &ids {
            let drone = &mut self.drones[id as usize];
            let said = drone.pilot_host.step(&down, &mut self.scratch, &mut drone.slot, &mut drone.stats);
            drone.frames.clear();
            drone.frames.extend(said.frames());
        }
        let stepped = Instant::now();
        for &id in &ids {
            let drone = &self.drones[id as usize];
            part.take_slot(DroneId(id), &drone.slot);
            part.take_frames(DroneId(id), &drone.frames);
        }
        let share = part.advance()?;
        (done.steps, done.world) = (stepped - sensed, (sensed - opened) + stepped.elapsed());
        (done.drones, done.halo_bodies, done.frames) = (ids.len() as u32, halo_bodies, frames);
        done.digest_bytes = share.byte_len() as u64;
        Ok(share)
    }

    fn meet(&mut self, halos: &[Vec<Halo>]) {
        for ((number, part), done) in self.parts.iter_mut().enumerate().zip(&mut self.done) {
            let mine: Vec<&Halo> = halos.iter().map(|left| &left[number]).collect();
            let began = Instant::now();
            part.meet(&mine);
            done.exchange += began.elapsed();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inline;
    use skein_protocol::record::{RecordSink, RecordView, SinkError};
    use skein_scenario::ScenarioSource;

    /// The digest after each tick.
    #[derive(Default)]
    struct Digests(Vec<u64>);

    impl RecordSink for Digests {
        fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
            if !record.rows.is_empty() {
                self.0.push(record.head.digest);
            }
            Ok(())
        }
    }

    fn scenario(text: &str) -> Scenario {
        Scenario::parse(text, ScenarioSource { name: "split", stem: "split" }, &[]).unwrap()
    }

    /// Flies a scenario in one piece and in 1, 2, 4 and 16 parts, and compares the digests of all ticks. Returns how often a drone changed
    /// its part with 16 parts.
    fn compare(text: &str) -> usize {
        let (scenario, pilots) = (scenario(text), PilotRegistry::built_in().unwrap());
        let mut whole = Digests::default();
        inline::run(&scenario, &pilots, &mut whole, || None).unwrap();
        assert!(whole.0.len() > 100, "{} ticks", whole.0.len());
        let mut changes = 0;
        for parts in [1, 2, 4, 16] {
            let mut swarm = SplitSwarm::new(&scenario, &pilots, parts).unwrap();
            changes = 0;
            let mut owned: Vec<Vec<u32>> = Vec::new();
            for (tick, digest) in whole.0.iter().enumerate() {
                swarm.tick().unwrap();
                assert_eq!(swarm.digest(), *digest, "{parts} parts, tick {tick}");
                let now: Vec<Vec<u32>> = swarm.parts.iter().map(|part| part.ids().to_vec()).collect();
                changes += usize::from(!owned.is_empty() && owned != now);
                owned = now;
            }
            assert_eq!(owned.iter().map(Vec::len).sum::<usize>(), scenario.formation.drones as usize);
        }
        changes
    }

    #[test]
    fn a_mission_past_an_obstacle_has_the_same_digest_in_parts() {
        let text = "
            [formation]
            shape = \"v\"
            drones = 12
            spacing_m = 40
            [radio]
            loss = 0.2
            delay_s = 0.05
            [[obstacle]]
            shape = \"circle\"
            centre_m = [200, 5]
            radius_m = 20
        ";
        assert!(compare(text) > 10, "drones change their parts on the way");
    }

    #[test]
    fn with_a_short_range_parts_know_little_and_the_digest_is_the_same() {
        let text = "
            [time]
            timeout_s = 8
            [formation]
            shape = \"grid\"
            drones = 100
            spacing_m = 65
            [mission]
            stop_x_m = 1000000
            reformation = \"identity\"
            [drone]
            safe_distance_m = 37
            [radio]
            range_m = 100
            [[radio.rule]]
            to = [0]
            range_m = 100000
            [[radio.rule]]
            topics = [\"leadership\", \"plan\", \"assignment\"]
            range_m = 100000
        ";
        compare(text);
        let (scenario, pilots) = (scenario(text), PilotRegistry::built_in().unwrap());
        let mut swarm = SplitSwarm::new(&scenario, &pilots, 4).unwrap();
        let known = swarm.tick().unwrap().iter().map(|part| part.drones + part.halo_bodies).max();
        assert!(known.is_some_and(|known| known < 60), "a part knows {known:?} of 100 drones");
    }

    #[test]
    fn faults_and_shared_channels_are_refused() {
        let pilots = PilotRegistry::built_in().unwrap();
        let refusal = |text: &str| SplitSwarm::new(&scenario(text), &pilots, 2).err().map(|error| error.to_string());
        let drones = "[formation]\nshape = \"v\"\ndrones = 3\nspacing_m = 60\n";
        assert_eq!(refusal(drones), None);
        let fault = refusal(&format!("{drones}[[fault]]\nkind = \"kill\"\nat_s = 1\ndrone = 0\n"));
        assert!(fault.is_some_and(|why| why.contains("scheduled faults")));
        let channel = refusal(&format!("{drones}[radio]\nrate_bps = 1000000\n"));
        assert!(channel.is_some_and(|why| why.contains("bandwidth")));
    }
}
