//! The report of a small artificial mission: four drones fly straight past a disc, the leader of a group dies, and another
//! drone becomes its leader.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use skein_protocol::formation::Shape;
use skein_protocol::frame::AirFrame;
use skein_protocol::payload::{Assignment, MAX_SET, Plan};
use skein_protocol::record::*;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, Message, ObstacleId, Phase, PlanStamp, SimTime, Vec2};
use skein_report::{
    FlightRecord, Interrupted, Manifest, MissionEnd, Recorder, RunCompletion, RunFacts, RunFolder, Summary,
};

/// Last tick; a tick is 0.1 s.
const LAST: u64 = 99;
/// Tick in which drone 3, the leader of N1, dies. Drone 0 leads N1 from tick `NEW_LEADER`.
const DEATH: u64 = 60;
const NEW_LEADER: u64 = 65;
const BALLOT: Ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
const STAMP: PlanStamp = PlanStamp { ballot: BALLOT, epoch: 2 };

fn facts() -> RunFacts {
    RunFacts {
        scenario: "disc".to_owned(),
        strategy: "congestion-aware".to_owned(),
        seed: u64::MAX,
        runtime: "processes".to_owned(),
        clock: "lockstep".to_owned(),
        drones: 4,
        dt_s: 0.1,
        shape: Shape::Line,
        spacing_m: 30.0,
        end: MissionEnd::Hold,
        course: skein_protocol::Course::East,
        course_y_m: 0.0,
        safe_distance_m: 25.0,
        clearance_m: 4.0,
        planning_distance_m: 20.0,
        arrival_error_m: 0.8,
        radio_range_m: None,
        pilots: Vec::new(),
        obstacles: vec![ConvexShape::circle(Vec2::new(50.0, 30.0), 10.0).unwrap()],
        topics: vec![],
        scene: Default::default(),
    }
}

fn completion() -> RunCompletion {
    RunCompletion { fallback: Outcome::Aborted, wall_s: Some(4.0), startup_s: Some(0.25) }
}

/// The row of a drone. The drones fly abreast at y = 45, 75, 15 and 105 m, at 10 m/s, with a power of 100 W.
fn row(tick: u64, drone: usize) -> DroneRow {
    let dead = drone == 3 && tick >= DEATH;
    let t_s = (if dead { DEATH } else { tick + 1 }) as f64 * 0.1;
    let leads = drone == 2 || if tick < DEATH { drone == 3 } else { drone == 0 && tick >= NEW_LEADER };
    let phase = if tick < 50 { Phase::Avoid } else { Phase::Reform };
    let (group, route) = if drone == 2 { (GroupId::ALL.child(2), 0) } else { (GroupId::ALL.child(1), 1) };
    let queued = (10..50).contains(&tick);
    let flags = [(!dead, ROW_ALIVE), (leads && !dead, ROW_LEADS), (queued, ROW_QUEUED)];
    DroneRow {
        position_m: [10.0 * t_s, [45.0, 75.0, 15.0, 105.0][drone], 50.0],
        velocity_mps: if dead { [0.0; 3] } else { [10.0, 0.0, 0.0] },
        energy_j: 100.0 * t_s,
        led: group,
        term: Ballot { round: 1, incarnation: 1, claimant: DroneId(if drone == 2 { 2 } else { 3 }) },
        obeyed: if tick < 10 { PlanStamp::default() } else { STAMP },
        group,
        flags: flags.into_iter().filter(|flag| flag.0).map(|flag| flag.1).sum(),
        phase: if tick < 10 { Phase::Cruise } else { phase }.to_wire(),
        heard: 3,
        step_ns: 20_000,
        route,
        rank: drone as u16,
        ..DroneRow::default()
    }
}

fn frames(tick: u64) -> Vec<AirFrame> {
    let mut set = [ObstacleId(0); MAX_SET];
    set[0] = ObstacleId(0);
    let plan = Plan {
        stamp: SimTime::from_secs(tick as f64 * 0.1),
        id: STAMP,
        group: GroupId::ALL,
        phase: Phase::Avoid.to_wire(),
        members: 4,
        anchor_m: [0.0; 2],
        anchor_mps: [10.0, 0.0],
        anchor_stop_x_m: f64::INFINITY,
        predicted_s: 3.5,
        candidates: 5,
        routes: 2,
        set_count: 1,
        set,
        course: 0,
    };
    let part = |drone: u32| Assignment {
        id: STAMP,
        scope: GroupId::ALL,
        group: GroupId::ALL.child(1),
        drone: DroneId(drone),
        // The drone that the plan names as leader of N2 never leads.
        leader: DroneId(if drone == 2 { 0 } else { 3 }),
        slot_m: [0.0; 2],
        arrival_s: 1.0,
        route: 1,
        rank: 0,
        reserved: 0,
    };
    let messages = [Message::Plan(plan)].into_iter().chain((0..4).map(|drone| Message::Assignment(part(drone))));
    let frame = |(sequence, message): (usize, Message)| AirFrame {
        tick,
        source: DroneId(0),
        sequence: sequence as u32,
        position_m: [0.0; 3],
        queue_ns: 0,
        link_faults: Default::default(),
        frame: message.encode(),
    };
    // The plan is sent when it is made, and repeated later with another time stamp.
    if tick == 11 || tick == 20 { messages.enumerate().map(frame).collect() } else { Vec::new() }
}

fn events(tick: u64) -> Vec<RunEvent> {
    let at = |t_s: f64, what| RunEvent { t_s, what };
    let leader =
        |leader, leads| EventKind::Leader { group: "N1".to_owned(), ballot: BALLOT, leader: DroneId(leader), leads };
    match tick {
        9 => vec![at(1.0, leader(3, true))],
        10 => vec![at(
            1.0,
            EventKind::Detected { stage: 0, drone: DroneId(2), obstacle: ObstacleId(0), distance_m: 30.0 },
        )],
        30 => vec![at(
            3.1,
            EventKind::Violation {
                kind: ViolationKind::Separation,
                drones: vec![DroneId(0), DroneId(1)],
                value_m: 24.0,
            },
        )],
        49 => vec![at(5.0, EventKind::Passed { stage: 0 })],
        DEATH => vec![
            at(6.0, leader(3, false)),
            at(
                6.0,
                EventKind::Fault {
                    kind: FaultKind::Kill,
                    target: DroneId(3),
                    scheduled: false,
                    detail: "signal 9".to_owned(),
                },
            ),
        ],
        NEW_LEADER => vec![at(6.5, leader(0, true))],
        _ => Vec::new(),
    }
}

fn end() -> RunEvent {
    let totals = Totals {
        sent: 10,
        delivered: 30,
        duplicates: 8,
        dropped: [1, 2, 3, 4, 5, 6, 7],
        delay_s: Percentiles { mean: Some(0.02), p50: Some(0.02), p99: Some(0.04), max: Some(0.04) },
        rejected_commands: 1,
        wall_s: 2.0,
        ..Totals::default()
    };
    RunEvent {
        t_s: 10.0,
        what: EventKind::End {
            outcome: Outcome::Reached,
            reason: "goal met".to_owned(),
            stuck: Vec::new(),
            unfinished: Vec::new(),
            standstill_s: None,
            totals: Box::new(totals),
        },
    }
}

fn give(recorder: &mut Recorder, tick: u64, frames: &[AirFrame], events: &[RunEvent]) -> Result<(), SinkError> {
    let rows: Vec<DroneRow> = (0..4).map(|drone| row(tick, drone)).collect();
    let lines: Vec<String> = events.iter().map(|event| serde_json::to_string(event).unwrap() + "\n").collect();
    let head = RecordHeader {
        tick,
        now: SimTime((tick as i64 + 1) * 100_000_000),
        rows: 4,
        frames: frames.len() as u32,
        telemetry: 0,
        events_len: lines.concat().len() as u32,
        lost: 0,
        reserved: 0,
        digest: 0xabc + tick,
    };
    recorder.take(RecordView { head: &head, rows: &rows, frames, telemetry: &[], events: lines.concat().as_bytes() })
}

fn fly(recorder: &mut Recorder, ticks: std::ops::RangeInclusive<u64>) {
    for tick in ticks {
        give(recorder, tick, &frames(tick), &events(tick)).unwrap();
    }
}

fn flown() -> Summary {
    let mut recorder = Recorder::in_memory(facts());
    fly(&mut recorder, 0..=LAST);
    // The record with the end event repeats the rows of the last tick.
    give(&mut recorder, LAST, &[], &[end()]).unwrap();
    let (summary, record) = recorder.finish(&completion());
    assert!(record.is_none(), "a run without a folder keeps no record");
    summary
}

fn near(value: Option<f64>, wanted: f64) -> bool {
    value.is_some_and(|value| (value - wanted).abs() < 1e-6)
}

#[test]
fn stages_describe_how_the_set_was_passed() {
    let summary = flown();
    let stage = &summary.stages[0];
    assert_eq!((summary.stages.len(), stage.detected_s, stage.passed_s), (1, Some(1.0), Some(5.0)));
    assert!(near(stage.pass_time_s, 4.0));
    assert_eq!((stage.routes, stage.candidates_rehearsed), (Some(2), Some(5)));
    assert_eq!((stage.split.as_deref(), stage.split_left_right), (Some(&[1, 3][..]), Some([3, 1])));
    // The plan was made at 1.1 s and predicts 3.5 s, which is 3.6 s after the detection. Repetitions do not count.
    assert!(near(stage.predicted_s, 3.6), "{:?}", stage.predicted_s);
    let groups = serde_json::to_value(&stage.groups).unwrap();
    let wanted = serde_json::json!([
        {"name": "N1", "route": 1, "drones": [0, 1, 3], "leader": 3},
        {"name": "N2", "route": 0, "drones": [2], "leader": 2},
    ]);
    assert_eq!(groups, wanted);
}

#[test]
fn dead_drones_do_not_count_but_are_bodies() {
    let summary = flown();
    assert_eq!((summary.ticks, summary.sim_s, summary.mission_s), (100, 10.0, 10.0));
    assert!(near(Some(summary.energy_j.total), 3000.0), "{:?}", summary.energy_j);
    assert!(near(summary.energy_j.until_passed, 2000.0) && near(summary.energy_j.detection_to_pass, 1600.0));
    assert!(near(summary.energy_j.per_drone.last().copied(), 600.0));
    assert_eq!((summary.reform_start_s, summary.reform_end_s), (Some(5.1), Some(5.1)));
    assert!(near(summary.formation_error_m, 0.0) && near(summary.formation_rmse_m, 0.0));
    assert!(near(summary.mean_distance_error_m, 0.0));
    assert!(near(summary.min_separation_m, 30.0) && near(summary.min_clearance_m, 5.0), "{summary:?}");
    assert_eq!(summary.metrics.order, Some(1.0));
    assert_eq!((summary.metrics.safety, summary.metrics.union), (Some(1.0), Some(1.0)));
}

#[test]
fn leadership_and_faults_are_in_the_summary() {
    let summary = flown();
    assert_eq!((summary.elections, summary.leaders.len(), summary.split_brain_s), (1, 2, 0.0));
    assert!(summary.failover_s.len() == 1 && near(summary.failover_s[0], 0.5), "{:?}", summary.failover_s);
    let fault = serde_json::to_value(&summary.faults).unwrap();
    let wanted =
        serde_json::json!([{"t_s": 6.0, "kind": "kill", "target": 3, "scheduled": false, "detail": "signal 9"}]);
    assert_eq!(fault, wanted);
    let violations = serde_json::to_value(&summary.violations).unwrap();
    let wanted = serde_json::json!([{"t_s": 3.1, "kind": "separation", "drones": [0, 1], "value_m": 24.0}]);
    assert_eq!(violations, wanted);
}

#[test]
fn the_end_event_determines_outcome_and_counters() {
    let summary = flown();
    assert_eq!((summary.outcome, summary.reason.as_deref()), (Outcome::Reached, Some("goal met")));
    assert_eq!(
        (summary.wall_s, summary.realtime_factor, summary.agent_steps_per_s),
        (Some(2.0), Some(5.0), Some(200.0))
    );
    assert_eq!((summary.messages.sent, summary.messages.delivered, summary.rejected_commands), (10, 30, Some(1)));
    assert_eq!((summary.messages.dropped.burst, summary.messages.dropped.queue), (Some(2), Some(7)));
    assert_eq!((summary.messages.delay_s.p99, summary.messages.age_s.max), (Some(0.04), None));
    assert_eq!(summary.digest.as_deref(), Some("0000000000000b1f"));
    let steps = summary.step_us.unwrap();
    assert!(steps.max == 20.0 && (steps.p50 - 20.0).abs() < 0.7);
}

#[test]
fn without_an_end_event_the_record_is_counted() {
    let mut recorder = Recorder::in_memory(RunFacts { runtime: "inline".to_owned(), ..facts() });
    fly(&mut recorder, 0..=29);
    let (summary, _) = recorder.finish(&completion());
    assert_eq!((summary.outcome, summary.mission_s, summary.wall_s), (Outcome::Aborted, 3.0, Some(4.0)));
    assert_eq!((summary.messages.sent, summary.messages.delivered), (10, 360));
    assert_eq!((summary.messages.dropped.loss, summary.step_us), (None, None));
    let stage = &summary.stages[0];
    assert_eq!((stage.passed_s, stage.split.as_deref(), stage.routes), (None, Some(&[0, 0][..]), Some(2)));
    assert_eq!((summary.energy_j.until_passed, summary.reform_start_s), (None, None));
}

#[test]
fn a_run_without_ticks_has_a_summary() {
    let (summary, _) = Recorder::in_memory(facts()).finish(&RunCompletion { wall_s: None, ..completion() });
    assert_eq!((summary.ticks, summary.digest, summary.formation_error_m), (0, None, None));
    assert_eq!((summary.realtime_factor, summary.stages[0].groups.as_ref()), (None, None));
}

#[test]
fn an_invalid_record_is_refused_with_its_tick() {
    let mut recorder = Recorder::in_memory(RunFacts { drones: 5, ..facts() });
    let error = give(&mut recorder, 3, &[], &[]).unwrap_err();
    assert_eq!(error.to_string(), "tick 3: expected a record of 5 rows, one per drone, found 4");
    let head = RecordHeader { tick: 7, ..RecordHeader::default() };
    let record = RecordView { head: &head, rows: &[], frames: &[], telemetry: &[], events: b"{\"t_s\": 1}\n" };
    let error = recorder.take(record).unwrap_err();
    assert!(error.to_string().starts_with("tick 7: expected an event"), "{error}");
}

/// Every key of the summary: `a.b` is a key of an object, `a[].b` a key of the entries of a list.
const KEYS: &str = "schema scenario strategy seed runtime clock drones dt_s ticks sim_s realtime_factor \
    agent_steps_per_s wall_s startup_s report_s outcome stages[].detected_s stages[].passed_s stages[].pass_time_s \
    stages[].routes stages[].split stages[].split_left_right stages[].predicted_s stages[].forecasts_too_short stages[].candidates_rehearsed \
    stages[].groups[].name stages[].groups[].route stages[].groups[].drones stages[].groups[].leader mission_s \
    reform_start_s reform_end_s formation_error_m formation_rmse_m mean_distance_error_m energy_j.total \
    energy_j.until_passed energy_j.detection_to_pass energy_j.per_drone min_separation_m min_clearance_m min_altitude_m \
    violations[].t_s violations[].kind violations[].drones violations[].value_m metrics.order metrics.safety \
    metrics.union metrics.connectivity elections leaders[].t_s leaders[].group leaders[].ballot.round \
    leaders[].ballot.incarnation leaders[].ballot.claimant leaders[].leader split_brain_s failover_s messages.sent \
    messages.delivered messages.dropped.loss messages.dropped.burst messages.dropped.range messages.dropped.partition \
    messages.dropped.deaf messages.dropped.malformed messages.dropped.queue messages.duplicates \
    messages.delay_s.mean messages.delay_s.p50 messages.delay_s.p99 \
    messages.delay_s.max messages.age_s.mean messages.age_s.p50 messages.age_s.p99 messages.age_s.max faults[].t_s \
    faults[].kind faults[].target faults[].scheduled deadline_misses step_us.p50 step_us.p99 step_us.max digest";

#[test]
fn every_key_is_in_the_summary_and_in_the_schema() {
    let summary = serde_json::to_value(flown()).unwrap();
    let schema = skein_report::schema_summary();
    for key in KEYS.split_whitespace() {
        let pointer = format!("/{}", key.replace("[]", "/0").replace('.', "/"));
        assert!(summary.pointer(&pointer).is_some(), "no key {key}");
        let name = key.rsplit(['.', ']']).next().unwrap();
        assert!(schema.to_string().contains(&format!("\"{name}\":")), "{name} is not in the schema");
    }
    let required = schema["required"].as_array().unwrap();
    assert_eq!(required.len(), summary.as_object().unwrap().len(), "null is not absent: every key is required");
    assert_eq!(summary["seed"], u64::MAX);
    let back: Summary = serde_json::from_value(summary).unwrap();
    assert_eq!(back, flown());
}

/// A recorded flight in a folder of its own.
fn recorded() -> (tempfile::TempDir, RunFolder, Manifest, Summary, FlightRecord) {
    let root = tempfile::tempdir().unwrap();
    let folder = RunFolder::numbered(root.path(), "disc").unwrap();
    let manifest = Manifest::new(facts(), serde_json::json!({}), "0", None);
    folder.begin(&manifest).unwrap();
    let mut recorder = Recorder::in_folder(facts(), &folder).unwrap();
    fly(&mut recorder, 0..=LAST);
    give(&mut recorder, LAST, &[], &[end()]).unwrap();
    let (summary, record) = recorder.finish(&completion());
    (root, folder, manifest, summary, record.unwrap())
}

fn never() -> Interrupted<'static> {
    Interrupted::never()
}

#[test]
fn a_folder_holds_summary_trace_events_recording_and_plots() {
    let (_root, folder, manifest, summary, record) = recorded();
    folder.reserve_summary(4).unwrap().write(&summary).unwrap();
    assert_eq!(folder.read_summary().unwrap(), summary);
    record.write_files(&manifest, &never()).unwrap();
    record.remove().unwrap();
    assert!(!folder.path().join("flight.spool").exists());
    let read = |name| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let trace = read("trace.csv");
    assert_eq!(trace.lines().count() as u64, 1 + 4 * (LAST + 1));
    assert_eq!(trace.lines().filter(|line| line.ends_with(",0,3,0")).count() as u64, LAST + 1 - DEATH, "{trace}");
    let first = trace.lines().nth(1).unwrap();
    assert!(first.starts_with("0.1,0,1.0,45.0,10.0,0.0,N1,,10.0,") && first.ends_with(",cruise,,,1,3,0"), "{first}");
    assert!(trace.lines().nth(4 * LAST as usize + 3).unwrap().starts_with("10.0,2,100.0,15.0,10.0,0.0,N2,0,1000.0,"));
    let events = read("events.jsonl");
    let parsed: Vec<RunEvent> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((parsed.len(), parsed.last()), (8, Some(&end())));
    let manifest = RunFolder::open(folder.path()).unwrap().read_manifest().unwrap();
    let plots = skein_report::plot::write(&folder, &manifest.facts, &never()).unwrap();
    assert_eq!(plots.len(), skein_report::plot::FILES.len() - 1, "all but the figures of pilots");
}

#[test]
fn a_record_stays_until_its_files_are_written() {
    let (_root, folder, manifest, _, record) = recorded();
    let path = |name| folder.path().join(name);
    // No file can be made under the name of a folder.
    std::fs::create_dir(path(".trace.csv.part")).unwrap();
    let error = record.write_files(&manifest, &never()).unwrap_err().to_string();
    assert!(error.contains("trace.csv"), "{error}");
    let stopped = record.write_files(&manifest, &Interrupted::when(&|| true));
    assert!(stopped.is_err() && path("flight.spool").exists());
    drop(record);
    std::fs::remove_dir(path(".trace.csv.part")).unwrap();
    let left = FlightRecord::left_in(&folder).unwrap().unwrap();
    left.write_files(&manifest, &never()).unwrap();
    assert_eq!(std::fs::read_to_string(path("trace.csv")).unwrap().lines().count(), 401);
    left.remove().unwrap();
    assert!(FlightRecord::left_in(&folder).unwrap().is_none());
}

#[test]
fn a_killed_run_gets_the_summary_of_its_record() {
    let (_root, folder, manifest, summary, _) = recorded();
    let spool = folder.path().join("flight.spool");
    let bytes = std::fs::read(&spool).unwrap();
    let of = |bytes: &[u8]| {
        std::fs::write(&spool, bytes).unwrap();
        FlightRecord::left_in(&folder).unwrap().unwrap().summary(&manifest.facts, &never()).unwrap()
    };
    let whole = of(&bytes);
    assert_eq!((whole.digest, whole.outcome, whole.ticks), (summary.digest, Outcome::Reached, 100));
    let cut = of(&bytes[..bytes.len() / 2]);
    assert!(cut.outcome == Outcome::Aborted && (20..80).contains(&cut.ticks) && cut.reason.is_some(), "{cut:?}");
    // After a power failure, the end of the file may hold anything.
    let foreign = of(&[&bytes[..bytes.len() / 2], &[0; 4096]].concat());
    assert!(foreign.ticks >= cut.ticks, "{foreign:?}");
    assert_eq!(of(&[]).ticks, 0);
}

#[test]
fn the_text_of_a_summary_starts_with_the_outcome() {
    let text = skein_report::text::summary(&flown(), false);
    let wanted = "\
reached after 10.00 s: goal met and every invariant held

  run           disc: 4 drones, congestion-aware, seed 18446744073709551615, processes, lockstep
  stage 1       passed in 4.00 s from 1.00 s; split 3/1, left to right; predicted 3.60 s, 5 groupings simulated
                N1    route 1: drones 0 1 3, led by 3
                N2    route 0: drones 2, led by 2
  reformation   from 5.10 s, closed at 5.10 s
  formation     largest slot error 0.00 m, root mean square 0.00 m
  energy        3.000 kJ; 2.000 kJ until the last obstacle was passed, 1.600 kJ of it since the first detection
  distances     minimum: 30.00 m between drones, 5.00 m to obstacles
  leadership    1 election; time without a leader after a leader's death or freeze: 0.50 s
  messages      10 sent, 30 received, 8 duplicates, 1 dropped (loss), 2 dropped (burst), 3 dropped (range), 4 dropped (partition), \
5 dropped (deaf), 6 dropped (malformed), 7 dropped (queue); delay: median 20 ms, p99 40 ms
  fault         6.00 s: kill, drone 3 (not scheduled; signal 9)
  speed         2.00 s of wall time, 5.0 × real time; step of a drone: median 20 µs, p99 20 µs
  digest        0000000000000b1f
";
    assert_eq!(text, wanted);
    let violated = Summary { outcome: Outcome::Unsafe, reason: None, ..flown() };
    let text = skein_report::text::summary(&violated, true);
    let wanted = "\x1b[1;31munsafe\x1b[0m after 10.00 s: an invariant was violated, first at 3.10 s: separation \
        of drones 0 1, 24.00 m\n";
    assert!(text.starts_with(wanted), "{text}");
}
