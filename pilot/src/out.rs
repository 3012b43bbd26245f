//! What a pilot says in a tick.

use skein_protocol::telemetry::Telemetry;
use skein_protocol::{Message, MetricName, ShortText, TopicName, UserMessage};

/// Takes what a pilot says in a tick. The runtime empties it before each step.
///
/// ```
/// use skein_pilot::Out;
///
/// let mut out = Out::default();
/// out.say("gossip", 0.5f64.to_le_bytes());
/// out.metric("order", 1.0);
/// out.mark("goal", [100.0, 0.0, 50.0]);
/// assert_eq!(out.misuse(), None);
/// out.say("not a topic's name", b"");
/// assert!(out.misuse().is_some(), "the runtime counts this as a failure of the pilot");
/// ```
#[derive(Clone, Debug, Default)]
pub struct Out {
    messages: Vec<Message>,
    telemetry: Vec<Telemetry>,
    done: bool,
    misuse: Option<String>,
}

impl Out {
    /// Broadcasts bytes under a topic of the pilots' own: they go through the radio like every message. The topic's name has 1 to
    /// 31 characters from `a-z 0-9 _ - . /` and is not that of a built-in topic; there are at most [`skein_protocol::USER_BYTES`]
    /// bytes. Anything else is a failure of the pilot.
    pub fn say(&mut self, topic: &str, bytes: impl AsRef<[u8]>) {
        let name = TopicName::new(topic).map_err(|error| error.to_string());
        let message = name.and_then(|name| {
            let too_long = |error| format!("topic {name}: {error}");
            UserMessage::new(name, bytes.as_ref()).map_err(too_long)
        });
        match message {
            Ok(message) => self.messages.push(Message::User(message)),
            Err(problem) => self.note_misuse(problem),
        }
    }

    /// Reports a figure. It is recorded, and not sent to other drones. The name has 1 to 31 characters from `a-z A-Z 0-9 _ - . /`;
    /// anything else is a failure of the pilot. A value that is not finite is not recorded. If one name comes twice in a tick, the
    /// last value counts. A drone can report [`skein_protocol::telemetry::MAX_METRICS`] names in a tick.
    pub fn metric(&mut self, name: &str, value: f64) {
        match MetricName::new(name) {
            Ok(name) => self.telemetry.push(Telemetry::Metric { name, value }),
            Err(error) => self.note_misuse(error.to_string()),
        }
    }

    /// Shows a point (world frame, m) in the views of the swarm until the next tick. The label is cut to 31 bytes. A drone can
    /// show [`skein_protocol::telemetry::MAX_MARKS`] marks and lines in a tick.
    pub fn mark(&mut self, label: &str, point_m: [f64; 3]) {
        self.telemetry.push(Telemetry::Mark { label: ShortText::cut(label), point_m });
    }

    /// Shows a line (world frame, m) in the views of the swarm until the next tick, like [`Out::mark`].
    pub fn line(&mut self, label: &str, from_m: [f64; 3], to_m: [f64; 3]) {
        self.telemetry.push(Telemetry::Line { label: ShortText::cut(label), from_m, to_m });
    }

    /// Says whether the mission is done, as far as this drone is concerned. It holds for this tick. With `mission.end = "pilots"`,
    /// the mission ends once all living drones say so in the same tick.
    pub fn done(&mut self, done: bool) {
        self.done = done;
    }

    /// Says that the pilot has failed, and why, for a human reader: like a panic. The first reason counts.
    pub fn fail(&mut self, reason: impl Into<String>) {
        self.note_misuse(reason.into());
    }

    /// Broadcasts one of the built-in messages, such as the beacon [`Message::Pose`].
    pub fn message(&mut self, message: Message) {
        self.messages.push(message);
    }

    /// The messages so far, in the order in which they will be sent. The machines of the paper's pilot add theirs here.
    pub fn messages_mut(&mut self) -> &mut Vec<Message> {
        &mut self.messages
    }

    /// The messages so far, in the order in which they will be sent.
    #[must_use]
    pub fn messages(&self) -> &[Message] {
        &self.messages
    }

    /// The figures, marks and lines so far.
    #[must_use]
    pub fn telemetry(&self) -> &[Telemetry] {
        &self.telemetry
    }

    /// Whether the pilot says that the mission is done.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// The first thing that the pilot said and that cannot be sent, for a human reader. It makes the pilot fail.
    #[must_use]
    pub fn misuse(&self) -> Option<&str> {
        self.misuse.as_deref()
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.messages.clear();
        self.telemetry.clear();
        self.done = false;
        self.misuse = None;
    }

    /// Forgets everything but this: the pilot has failed. The runtime says so for a pilot that cannot go on.
    pub fn report_failure(&mut self, reason: String) {
        self.clear();
        self.telemetry.push(Telemetry::Failure { reason });
    }

    fn note_misuse(&mut self, problem: String) {
        self.misuse.get_or_insert(problem);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::USER_BYTES;

    #[test]
    fn what_cannot_be_sent_is_a_misuse_and_the_rest_is_kept() {
        let mut out = Out::default();
        out.say("gossip", [0; USER_BYTES]);
        out.say("gossip", [0; USER_BYTES + 1]);
        out.metric("a b", 1.0);
        out.metric("order", 1.0);
        assert_eq!((out.messages().len(), out.telemetry().len()), (1, 1));
        assert_eq!(out.misuse(), Some("topic gossip: the message has 273 bytes; a frame carries at most 272"));
        out.done(true);
        out.clear();
        assert!(out.misuse().is_none() && !out.is_done() && out.messages().is_empty() && out.telemetry().is_empty());
    }
}
