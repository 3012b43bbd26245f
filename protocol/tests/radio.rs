//! Statistical tests of the radio against its models: rates, means, deviations and lengths. All seeds are fixed, so the tests
//! are deterministic. Each statistic must be within five standard errors of the value that its model predicts. A wrong model
//! would exceed this bound.
#![allow(clippy::unwrap_used, reason = "a test that cannot continue must fail")]

use proptest::prelude::*;
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::radio::{
    BLOCK_BURSTS, Burst, BurstScope, ChannelModel, Delay, DelayModel, Delivery, DropReason, Link, Radio, Range, Rule,
    TopicSet,
};
use skein_protocol::{DroneId, SimTime, TopicName, Vec3};
use std::collections::BTreeSet;

/// Number of standard errors by which a statistic may differ from its model.
const ERRORS: f64 = 5.0;
/// Number of frames in one experiment.
const MANY: u32 = 40_000;
/// Time between two frames, s: the period of pose beacons.
const PERIOD_S: f64 = 0.1;

fn link(source: u32, destination: u32, sequence: u32) -> Link {
    Link { source: DroneId(source), destination: DroneId(destination), topic: Topic::Pose as u16, sequence }
}

fn radio(channel: ChannelModel) -> Radio {
    Radio { seed: 3, channel, ..Radio::default() }
}

/// The outcomes of frames on one link, one frame every [`PERIOD_S`], over the distance `path_m`.
fn deliveries(radio: &Radio, (source, destination): (u32, u32), path_m: f64) -> Vec<Delivery> {
    let at = |sequence| SimTime::from_secs(f64::from(sequence) * PERIOD_S);
    (0..MANY).map(|s| radio.outcome(link(source, destination, s), Vec3::new(path_m, 0.0, 0.0), at(s))).collect()
}

/// For each outcome, whether the frame was dropped for this reason.
fn dropped(deliveries: &[Delivery], reason: DropReason) -> Vec<bool> {
    deliveries.iter().map(|delivery| *delivery == Delivery::Drop(reason)).collect()
}

fn rate(hits: &[bool]) -> f64 {
    hits.iter().filter(|hit| **hit).count() as f64 / hits.len() as f64
}

/// Delays of the delivered frames, s.
fn delays(radio: &Radio, pair: (u32, u32)) -> Vec<f64> {
    let sent = |sequence: usize| SimTime::from_secs(sequence as f64 * PERIOD_S);
    let delay = |(sequence, delivery): (usize, Delivery)| match delivery {
        Delivery::Deliver { due, .. } => Some(due.since(sent(sequence))),
        Delivery::Drop(_) => None,
    };
    deliveries(radio, pair, 0.0).into_iter().enumerate().filter_map(delay).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Central moment of this order.
fn moment(values: &[f64], order: i32) -> f64 {
    let centre = mean(values);
    values.iter().map(|value| (value - centre).powi(order)).sum::<f64>() / values.len() as f64
}

#[track_caller]
fn assert_near(what: &str, found: f64, wanted: f64, standard_error: f64) {
    let off = (found - wanted).abs() / standard_error;
    assert!(
        off < ERRORS,
        "{what}: found {found}, the model predicts {wanted} ± {standard_error}: {off:.1} standard errors off"
    );
}

/// Checks a share of `count` independent draws.
#[track_caller]
fn assert_rate(what: &str, found: f64, wanted: f64, count: f64) {
    assert_near(what, found, wanted, (wanted * (1.0 - wanted) / count).sqrt());
}

/// Checks mean and variance. The standard errors come from the sample's own variance and fourth moment.
#[track_caller]
fn assert_moments(what: &str, values: &[f64], wanted_mean: f64, wanted_variance: f64) {
    let (count, variance) = (values.len() as f64, moment(values, 2));
    assert_near(what, mean(values), wanted_mean, (variance / count).sqrt());
    let error = ((moment(values, 4) - variance * variance) / count).sqrt();
    assert_near(what, variance, wanted_variance, error);
}

#[test]
fn an_ideal_radio_delivers_each_frame_once_and_without_delay() {
    let delivery = Radio::default().outcome(link(0, 1, 0), Vec3::new(1e6, 0.0, 0.0), SimTime(5));
    assert_eq!(delivery, Delivery::Deliver { due: SimTime(5), again: None });
}

#[test]
fn deliveries_do_not_depend_on_the_order_of_the_calls() {
    let channel = ChannelModel {
        delay: Delay { model: DelayModel::Gamma, mean_s: 0.1, jitter_s: 0.05 },
        loss: 0.3,
        burst: Some(Burst { share: 0.2, length_s: 0.5, loss: 1.0, scope: BurstScope::Link }),
        range: Some(Range { half_m: 100.0, shadowing_db: 6.0, exponent: 2.0 }),
        duplicate: 0.2,
    };
    let radio = Radio { asymmetry: 1.0, ..radio(channel) };
    let outcome = |s| radio.outcome(link(2, 3, s), Vec3::new(60.0, 0.0, 0.0), SimTime::from_secs(f64::from(s)));
    let forward: Vec<_> = (0..200).map(outcome).collect();
    let mut backward: Vec<_> = (0..200).rev().map(outcome).collect();
    backward.reverse();
    assert_eq!(forward, backward);
    let other = Radio { seed: 4, ..radio.clone() };
    let differ = (0..200).filter(|&s| {
        other.outcome(link(2, 3, s), Vec3::new(60.0, 0.0, 0.0), SimTime::from_secs(f64::from(s))) != outcome(s)
    });
    assert!(differ.count() > 100, "another seed gives other outcomes");
}

/// The losses must equal those of the first version, which had only a fixed delay and Bernoulli losses. The digests of such
/// missions depend on them.
#[test]
fn bernoulli_losses_equal_those_of_the_first_version() {
    let radio = Radio { seed: 9, channel: ChannelModel { loss: 0.5, ..ChannelModel::default() }, ..Radio::default() };
    let lost: String = (0..32)
        .map(|s| match radio.outcome(link(2, 3, s), Vec3::zeros(), SimTime::ZERO) {
            Delivery::Drop(DropReason::Loss) => 'x',
            _ => '.',
        })
        .collect();
    assert_eq!(lost, "..x.x...xxxx.x......x.x..x...xx.");
}

#[test]
fn losses_have_the_given_rate_on_every_link_and_are_independent() {
    let radio = radio(ChannelModel { loss: 0.2, ..ChannelModel::default() });
    for pair in [(0, 1), (1, 0), (6, 7)] {
        let lost = dropped(&deliveries(&radio, pair, 0.0), DropReason::Loss);
        assert_rate("loss", rate(&lost), 0.2, f64::from(MANY));
        let twice: Vec<bool> = lost.windows(2).map(|pair| pair[0] && pair[1]).collect();
        assert_rate("two consecutive losses", rate(&twice), 0.04, f64::from(MANY) / 2.0);
    }
}

#[test]
fn links_are_independent_of_each_other() {
    let burst = Burst { share: 0.3, length_s: 0.2, loss: 1.0, scope: BurstScope::Direction };
    let channels = [
        ChannelModel { loss: 0.3, ..ChannelModel::default() },
        ChannelModel { burst: Some(burst), ..ChannelModel::default() },
    ];
    for (channel, reason) in channels.into_iter().zip([DropReason::Loss, DropReason::Burst]) {
        let radio = radio(channel);
        let [forward, reverse, other] =
            [(0, 1), (1, 0), (0, 2)].map(|pair| dropped(&deliveries(&radio, pair, 0.0), reason));
        for second in [&reverse, &other] {
            let both: Vec<bool> = forward.iter().zip(second).map(|(a, b)| *a && *b).collect();
            // Bursts last two periods on average, so only about a quarter of the frames count as independent.
            assert_rate("lost on both links", rate(&both), 0.09, f64::from(MANY) / 4.0);
        }
    }
}

#[test]
fn delays_have_the_moments_of_their_models() {
    let (mean_s, jitter_s) = (0.2, 0.08);
    for model in [DelayModel::Uniform, DelayModel::Gamma] {
        let values = delays(
            &radio(ChannelModel { delay: Delay { model, mean_s, jitter_s }, ..ChannelModel::default() }),
            (0, 1),
        );
        assert_moments(&format!("{model:?}"), &values, mean_s, jitter_s * jitter_s);
        assert!(values.iter().all(|value| *value >= 0.0));
        let skew = moment(&values, 3) / moment(&values, 2).powf(1.5);
        // Uniform: 0. Gamma: 2 / √shape = 2 σ / m.
        let wanted = if model == DelayModel::Gamma { 2.0 * jitter_s / mean_s } else { 0.0 };
        assert!((skew - wanted).abs() < 0.1, "{model:?}: skewness {skew}, wanted {wanted}");
    }
    // Shape 1/4 gives a long tail.
    let delay = Delay { model: DelayModel::Gamma, mean_s: 0.1, jitter_s: 0.2 };
    assert_moments("long tail", &delays(&radio(ChannelModel { delay, ..ChannelModel::default() }), (0, 1)), 0.1, 0.04);
    let fixed = Delay { model: DelayModel::Fixed, mean_s: 0.25, jitter_s: 0.0 };
    assert!(
        delays(&radio(ChannelModel { delay: fixed, ..ChannelModel::default() }), (0, 1))
            .iter()
            .all(|value| *value == 0.25)
    );
    let half_width = 3f64.sqrt() * 0.08;
    let uniform = Delay { model: DelayModel::Uniform, mean_s, jitter_s };
    let values = delays(&radio(ChannelModel { delay: uniform, ..ChannelModel::default() }), (0, 1));
    assert!(
        values.iter().all(|value| (value - mean_s).abs() <= half_width + 1e-9),
        "uniform stays within √3 standard deviations"
    );
}

#[test]
fn a_normal_delay_is_truncated_at_zero() {
    let normal_delays = |mean_s, jitter_s| {
        let delay = Delay { model: DelayModel::Normal, mean_s, jitter_s };
        delays(&radio(ChannelModel { delay, ..ChannelModel::default() }), (0, 1))
    };
    // Far from zero the distribution is not truncated: a share of 0.6827 is within one standard deviation.
    let values = normal_delays(1.0, 0.1);
    assert_moments("normal", &values, 1.0, 0.01);
    let within: Vec<bool> = values.iter().map(|value| (value - 1.0).abs() < 0.1).collect();
    assert_rate("within one standard deviation", rate(&within), 0.682_689, f64::from(MANY));
    // With mean 0 the upper half remains. Its mean is σ √(2/π), its variance σ² (1 − 2/π).
    let two_over_pi = 2.0 / std::f64::consts::PI;
    assert_moments("half-normal", &normal_delays(0.0, 0.1), 0.1 * two_over_pi.sqrt(), 0.01 * (1.0 - two_over_pi));
}

/// Samples the burst state in steps of a twentieth of the mean burst length. Returns the sampled states and the lengths of
/// the observed bursts, s.
fn bursts_s(burst: Burst) -> (Vec<bool>, Vec<f64>) {
    let step_s = burst.length_s / 20.0;
    let at = |step: u32| burst.is_active(5, link(0, 1, 0), SimTime::from_secs(f64::from(step) * step_s));
    let states: Vec<bool> = (0..400_000).map(at).collect();
    let runs = states.chunk_by(|a, b| a == b).filter(|run| run[0]);
    let lengths = runs.map(|run| run.len() as f64 * step_s).collect();
    (states, lengths)
}

#[test]
fn bursts_have_the_given_share_and_mean_length() {
    for (share, length_s) in [(0.1, 0.5), (0.5, 2.0), (0.8, 0.1)] {
        let (states, lengths) = bursts_s(Burst { share, length_s, loss: 1.0, scope: BurstScope::Direction });
        let count = lengths.len() as f64;
        // Standard error of the time share over n cycles of two exponentially distributed times.
        assert_near("share", rate(&states), share, share * (1.0 - share) * (2.0 / count).sqrt());
        // Probability that the next sample finds no burst. Pauses shorter than a step are not observed.
        let end_probability = (1.0 - share) * -f64::exp_m1(-1.0 / (20.0 * (1.0 - share)));
        let seen_s = length_s / 20.0 / end_probability;
        assert_near("length", mean(&lengths), seen_s, moment(&lengths, 2).sqrt() / count.sqrt());
        // The process has no memory, so the observed lengths have a geometric distribution with this variance.
        assert_moments("lengths", &lengths, seen_s, seen_s * seen_s * (1.0 - end_probability));
    }
}

#[test]
fn each_block_draws_its_first_state_independently() {
    let burst = Burst { share: 0.3, length_s: 1.0, loss: 1.0, scope: BurstScope::Direction };
    let block_s = BLOCK_BURSTS * burst.length_s;
    assert_eq!(burst.block_s(), block_s);
    let at = |seconds| burst.is_active(5, link(0, 1, 0), SimTime::from_secs(seconds));
    let around = |edge_s: f64| (at(edge_s - 1e-6), at(edge_s));
    let edges: Vec<(bool, bool)> = (1..4000).map(|block| around(f64::from(block) * block_s)).collect();
    let both: Vec<bool> = edges.iter().map(|(before, after)| *before && *after).collect();
    assert_rate("bursts on both sides of an edge", rate(&both), 0.09, edges.len() as f64);
    let within: Vec<(bool, bool)> = (1..4000).map(|block| around((f64::from(block) + 0.5) * block_s)).collect();
    assert!(
        within.iter().all(|(before, after)| before == after),
        "the state in the middle of a block does not change within a microsecond"
    );
}

#[test]
fn bursts_affect_the_links_in_their_scope() {
    let burst = |scope| Burst { share: 0.4, length_s: 0.3, loss: 1.0, scope };
    let states = |scope, pair| -> Vec<bool> {
        let channel = ChannelModel { burst: Some(burst(scope)), ..ChannelModel::default() };
        dropped(&deliveries(&radio(channel), pair, 0.0), DropReason::Burst)
    };
    assert_ne!(states(BurstScope::Direction, (0, 1)), states(BurstScope::Direction, (1, 0)));
    assert_eq!(states(BurstScope::Link, (0, 1)), states(BurstScope::Link, (1, 0)));
    assert_ne!(states(BurstScope::Link, (0, 1)), states(BurstScope::Link, (0, 2)));
    assert_eq!(states(BurstScope::Swarm, (0, 1)), states(BurstScope::Swarm, (7, 3)));
    // Bursts lose 70 % of the frames. The independent loss takes 10 % of the rest. Each loss has its own reason.
    let partly = Burst { loss: 0.7, ..burst(BurstScope::Direction) };
    let deliveries =
        deliveries(&radio(ChannelModel { burst: Some(partly), loss: 0.1, ..ChannelModel::default() }), (0, 1), 0.0);
    // Bursts last three periods on average, so only about a sixth of the frames count as independent.
    assert_rate("lost in bursts", rate(&dropped(&deliveries, DropReason::Burst)), 0.28, f64::from(MANY) / 6.0);
    assert_rate("lost independently", rate(&dropped(&deliveries, DropReason::Loss)), 0.072, f64::from(MANY) / 6.0);
    for (share, wanted) in [(0.0, 0.0), (1.0, 1.0)] {
        let constant =
            ChannelModel { burst: Some(Burst { share, ..burst(BurstScope::Link) }), ..ChannelModel::default() };
        assert_eq!(rate(&dropped(&self::deliveries(&radio(constant), (0, 1), 0.0), DropReason::Burst)), wanted);
    }
}

#[test]
fn a_hard_range_drops_frames_beyond_its_distance() {
    let radio = radio(ChannelModel {
        range: Some(Range { half_m: 100.0, shadowing_db: 0.0, exponent: 2.0 }),
        ..ChannelModel::default()
    });
    let at = |x| radio.outcome(link(0, 1, 0), Vec3::new(x, 0.0, 0.0), SimTime::ZERO);
    assert_eq!(at(100.0), Delivery::Deliver { due: SimTime::ZERO, again: None });
    assert_eq!(at(100.1), Delivery::Drop(DropReason::Range));
}

#[test]
fn a_gradual_range_follows_the_path_loss() {
    let range = Range { half_m: 100.0, shadowing_db: 6.0, exponent: 3.0 };
    let radio = radio(ChannelModel { range: Some(range), ..ChannelModel::default() });
    // One standard deviation of the shadowing is a factor of 10^(6 / 30) in distance. The shares heard are the upper tails of
    // the normal distribution beyond -2 … 2 standard deviations.
    for (deviations, heard) in [(-2.0, 0.977_25), (-1.0, 0.841_345), (0.0, 0.5), (1.0, 0.158_655), (2.0, 0.022_75)] {
        let path_m = 100.0 * 10f64.powf(0.2 * deviations);
        let lost = dropped(&deliveries(&radio, (0, 1), path_m), DropReason::Range);
        assert_rate("out of range", rate(&lost), 1.0 - heard, f64::from(MANY));
    }
    assert!(range.heard(0.0) == 1.0 && range.heard(1e12) < 1e-9);
}

#[test]
fn copies_arrive_later_and_at_the_given_rate() {
    let delay = Delay { model: DelayModel::Uniform, mean_s: 0.5, jitter_s: 0.1 };
    let deliveries =
        deliveries(&radio(ChannelModel { delay, loss: 0.5, duplicate: 0.15, ..ChannelModel::default() }), (0, 1), 0.0);
    let heard = deliveries.iter().filter_map(|delivery| match *delivery {
        Delivery::Deliver { due, again } => Some((due, again)),
        Delivery::Drop(_) => None,
    });
    let heard: Vec<(SimTime, Option<SimTime>)> = heard.collect();
    let twice: Vec<bool> = heard.iter().map(|(_, again)| again.is_some()).collect();
    assert_rate("share of heard frames with a copy", rate(&twice), 0.15, heard.len() as f64);
    let gaps: Vec<f64> = heard.iter().filter_map(|(due, again)| Some(again.as_ref()?.since(*due))).collect();
    assert!(gaps.iter().all(|gap| *gap >= 0.0));
    // Two uniform draws from an interval are on average a third of its width apart. The width is 2√3 σ.
    let width = 2.0 * 3f64.sqrt() * 0.1;
    assert_near(
        "gap between a frame and its copy",
        mean(&gaps),
        width / 3.0,
        (moment(&gaps, 2) / gaps.len() as f64).sqrt(),
    );
}

#[test]
fn jitter_reorders_and_a_fixed_delay_does_not() {
    let overtaken = |model, jitter_s| -> Vec<bool> {
        let values = delays(
            &radio(ChannelModel { delay: Delay { model, mean_s: 1.0, jitter_s }, ..ChannelModel::default() }),
            (0, 1),
        );
        values.windows(2).map(|pair| pair[1] + PERIOD_S < pair[0]).collect()
    };
    // Probability that two normal delays differ by more than a period: Q(0.1 / (0.1 √2)) = 0.239 75.
    assert_rate("overtaken", rate(&overtaken(DelayModel::Normal, 0.1)), 0.239_75, f64::from(MANY) / 2.0);
    assert_eq!(rate(&overtaken(DelayModel::Fixed, 0.0)), 0.0);
}

#[test]
fn the_factors_of_the_two_directions_of_a_link_are_inverse() {
    let delay = Delay { model: DelayModel::Fixed, mean_s: 0.2, jitter_s: 0.0 };
    let radio = Radio { asymmetry: 1.5, ..radio(ChannelModel { loss: 0.2, delay, ..ChannelModel::default() }) };
    let pairs = (0..100).flat_map(|a| (a + 1..100).map(move |b| (a, b)));
    let logs: Vec<f64> = pairs.map(|(a, b)| radio.factor(link(a, b, 0)).ln() / 2.5f64.ln()).collect();
    assert_moments("log of the factor", &logs, 0.0, 1.0 / 3.0);
    assert!(logs.iter().all(|log| log.abs() <= 1.0));
    for pair in [(0, 1), (1, 0), (4, 2)] {
        let factor = radio.factor(link(pair.0, pair.1, 0));
        assert!((factor * radio.factor(link(pair.1, pair.0, 77)) - 1.0).abs() < 1e-12);
        let lost = dropped(&deliveries(&radio, pair, 0.0), DropReason::Loss);
        assert_rate("loss", rate(&lost), 0.2 * factor, f64::from(MANY));
        assert!(delays(&radio, pair).iter().all(|delay| (delay - 0.2 * factor).abs() < 1e-8));
    }
    assert_eq!(Radio { asymmetry: 0.0, ..radio }.factor(link(0, 1, 0)), 1.0);
}

#[test]
fn the_last_rule_that_covers_a_frame_applies() {
    let rule = |topics: &[Topic], to: &[u32], delay_s| Rule {
        topics: (!topics.is_empty()).then(|| topics.iter().copied().collect::<TopicSet>()),
        from: None,
        to: (!to.is_empty()).then(|| to.iter().copied().map(DroneId).collect::<BTreeSet<_>>()),
        channel: ChannelModel { delay: Delay { mean_s: delay_s, ..Delay::default() }, ..ChannelModel::default() },
    };
    let rules = vec![rule(&[Topic::Pose, Topic::Plan], &[], 1.0), rule(&[], &[3], 2.0)];
    let radio = Radio { rules, ..Radio::default() };
    let due_s = |topic: u16, destination| match radio.outcome(
        Link { topic, ..link(0, destination, 0) },
        Vec3::zeros(),
        SimTime::ZERO,
    ) {
        Delivery::Deliver { due, .. } => due.secs(),
        Delivery::Drop(reason) => panic!("{reason:?}"),
    };
    let (pose, assignment, unknown) = (Topic::Pose as u16, Topic::Assignment as u16, 99);
    assert_eq!([due_s(pose, 1), due_s(assignment, 1), due_s(unknown, 1)], [1.0, 0.0, 0.0]);
    assert_eq!([due_s(pose, 3), due_s(assignment, 3), due_s(unknown, 3)], [2.0, 2.0, 2.0]);
}

/// A topic that pilots define.
fn gossip() -> TopicName {
    TopicName::new("gossip").unwrap()
}

#[test]
fn a_rule_names_the_topics_of_pilots_too() {
    let delayed = |delay_s| {
        let delay = Delay { mean_s: delay_s, ..Delay::default() };
        ChannelModel { delay, ..ChannelModel::default() }
    };
    let rule = Rule { topics: Some(TopicSet::from_iter([gossip()])), channel: delayed(1.0), ..Rule::default() };
    let radio = Radio { rules: vec![rule], ..Radio::default() };
    let due = |topic| radio.outcome(Link { topic, ..link(0, 1, 0) }, Vec3::zeros(), SimTime::ZERO);
    assert_eq!(due(gossip().kind()), Delivery::Deliver { due: SimTime::from_secs(1.0), again: None });
    for other in [gossip().kind() ^ 1, Topic::Pose as u16] {
        assert_eq!(due(other), Delivery::Deliver { due: SimTime::ZERO, again: None });
    }
}

#[test]
fn topics_of_pilots_are_local_if_all_of_them_are_heard_no_farther_than_beacons() {
    let within = |half_m: Option<f64>| {
        let range = half_m.map(|half_m| Range { half_m, shadowing_db: 0.0, exponent: 2.0 });
        ChannelModel { range, ..ChannelModel::default() }
    };
    let gossip_range = |half_m| {
        let topics = Some(TopicSet::from_iter([gossip()]));
        let rules = vec![Rule { topics, channel: within(half_m), ..Rule::default() }];
        Radio { channel: within(Some(100.0)), rules, ..Radio::default() }
    };
    assert!(gossip_range(Some(80.0)).locality().holds_own());
    let far = gossip_range(None);
    assert!(!far.locality().holds_own() && far.locality().holds(Topic::Pose as u16));
    assert_eq!(far.own_reach_m(DroneId(0)), f64::INFINITY);
    assert_eq!(gossip_range(Some(120.0)).own_reach_m(DroneId(0)), 120.0);
    assert_eq!(gossip_range(Some(80.0)).own_reach_m(DroneId(0)), 100.0, "other topics are heard from there");
}

proptest! {
    #[test]
    fn channels_looked_up_beforehand_give_the_same_delivery(
        conditions in prop::collection::vec((any::<u16>(), 0u8..16, 0u8..16), 0..5),
        kind in prop_oneof![0u16..11, Just(gossip().kind()), Just(gossip().kind() ^ 1)],
        (source, destination) in (0u32..4, 0u32..4),
    ) {
        let drones = |bits: u8| (bits > 7).then(|| (0..3).filter(|i| bits >> i & 1 == 1).map(DroneId).collect());
        let topics = |bits: u16| (bits > 15).then(|| {
            let mut set: TopicSet = Topic::ALL.into_iter().filter(|&t| bits >> t as u16 & 1 == 1).collect();
            if bits & 1 == 1 {
                set.insert_own(gossip());
            }
            set
        });
        // Each channel model has its own delay, which identifies it.
        let with_delay = |s: usize| {
            let delay = Delay { mean_s: 1.0 + s as f64, ..Delay::default() };
            ChannelModel { delay, ..ChannelModel::default() }
        };
        let rule = |(i, &(t, from, to)): (usize, &(u16, u8, u8))| Rule {
            topics: topics(t),
            from: drones(from),
            to: drones(to),
            channel: with_delay(i),
        };
        let radio = Radio { rules: conditions.iter().enumerate().map(rule).collect(), ..Radio::default() };
        let mut frame: AirFrame = bytemuck::Zeroable::zeroed();
        (frame.source, frame.frame.kind) = (DroneId(source), kind);
        let (receiver, here) = (DroneId(destination), Vec3::zeros());
        let channels = radio.channels_at(receiver);
        prop_assert_eq!(radio.delivery_at(&channels, &frame, here, 20), radio.delivery(&frame, receiver, here, 20));
    }
}

#[test]
fn the_range_is_a_distance_in_space() {
    let range = Range { half_m: 50.0, shadowing_db: 0.0, exponent: 2.0 };
    let radio = Radio { channel: ChannelModel { range: Some(range), ..ChannelModel::default() }, ..Radio::default() };
    let at = |z| radio.outcome(link(0, 1, 0), Vec3::new(30.0, 0.0, z), SimTime::ZERO);
    assert!(matches!(at(40.0), Delivery::Deliver { .. }));
    assert_eq!(at(40.1), Delivery::Drop(DropReason::Range));
    assert_eq!(at(-40.1), Delivery::Drop(DropReason::Range));
}

/// Two strategies send different frames, so their frames have different numbers at the same time.
#[test]
fn keyed_by_time_a_link_meets_the_same_air_whatever_was_sent_before() {
    let delay = Delay { mean_s: 0.2, jitter_s: 0.1, model: DelayModel::Gamma };
    let by_frame = radio(ChannelModel { loss: 0.3, delay, ..ChannelModel::default() });
    let by_time = Radio { keyed_by_time: true, ..by_frame.clone() };
    let outcomes = |radio: &Radio, ahead: u32| -> Vec<Delivery> {
        let at = |tick: u32| SimTime::from_secs(f64::from(tick) * PERIOD_S);
        (0..MANY).map(|tick| radio.outcome(link(0, 1, tick + ahead), Vec3::zeros(), at(tick))).collect()
    };
    assert_eq!(outcomes(&by_time, 0), outcomes(&by_time, 7));
    assert_ne!(outcomes(&by_frame, 0), outcomes(&by_frame, 7));
    // The rate is that of the model, and moments, directions and topics are independent of each other.
    let lost = |link: Link, ahead_s: f64| -> Vec<bool> {
        let at = |tick: u32| SimTime::from_secs(f64::from(tick) * PERIOD_S + ahead_s);
        let outcome = |tick| by_time.outcome(link, Vec3::zeros(), at(tick));
        (0..MANY).map(|tick| outcome(tick) == Delivery::Drop(DropReason::Loss)).collect()
    };
    let base = lost(link(0, 1, 0), 0.0);
    let other_topic = Link { topic: Topic::Plan as u16, ..link(0, 1, 0) };
    let error = (0.3 * 0.7 / f64::from(MANY)).sqrt();
    assert!((rate(&base) - 0.3).abs() < ERRORS * error);
    for other in [lost(link(1, 0, 0), 0.0), lost(other_topic, 0.0), lost(link(0, 1, 0), 0.02)] {
        let both: Vec<bool> = base.iter().zip(&other).map(|(a, b)| *a && *b).collect();
        let error = (0.09 * 0.91 / f64::from(MANY)).sqrt();
        assert!((rate(&both) - 0.09).abs() < ERRORS * error, "{}", rate(&both));
    }
}
