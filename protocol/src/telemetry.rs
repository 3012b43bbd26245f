//! What a pilot reports about itself: figures, marks, lines, and its own failure. A drone sends it in frames like its messages, but
//! the world takes these frames out: they are never on the air, they have no sequence number and are not part of the digest.

use crate::decode_error::{DecodeError, MAX_ABS};
use crate::frame::{FRAME_PAYLOAD, Frame};
use crate::ids::DroneId;
use crate::metric_name::MetricName;
use crate::payload;
use crate::short_text::ShortText;
use bytemuck::{Pod, Zeroable};

/// [`Frame::kind`] of a figure.
pub const METRIC_KIND: u16 = 0x4001;
/// [`Frame::kind`] of a mark.
pub const MARK_KIND: u16 = 0x4002;
/// [`Frame::kind`] of a line.
pub const LINE_KIND: u16 = 0x4003;
/// [`Frame::kind`] of a failure.
pub const FAILURE_KIND: u16 = 0x4004;

/// The most figures of different names that one drone can report in one tick.
pub const MAX_METRICS: usize = 16;
/// The most marks and lines together that one drone can show in one tick.
pub const MAX_MARKS: usize = 64;

/// Something that a pilot reports about itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Telemetry {
    /// A figure. If a drone reports the same figure twice in a tick, the last value counts.
    Metric {
        /// Name of the figure.
        name: MetricName,
        /// Its value, finite.
        value: f64,
    },
    /// A point to be shown until the drone's next tick.
    Mark {
        /// What it is; may be empty.
        label: ShortText,
        /// Where it is, world frame, m.
        point_m: [f64; 3],
    },
    /// A line to be shown until the drone's next tick.
    Line {
        /// What it is; may be empty.
        label: ShortText,
        /// One end, world frame, m.
        from_m: [f64; 3],
        /// The other end, world frame, m.
        to_m: [f64; 3],
    },
    /// The pilot has failed: the reason, for a human reader. A frame carries its first 304 bytes.
    Failure {
        /// Why it failed.
        reason: String,
    },
}

/// The payload of all telemetry but failures.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Body {
    label: ShortText,
    /// The value of a figure in the first place; a mark's point; a line's first end.
    first: [f64; 3],
    /// A line's other end.
    second: [f64; 3],
}

impl Telemetry {
    /// Whether a frame of this kind is telemetry. Such a frame is not a message.
    #[must_use]
    #[inline]
    pub fn is_kind(kind: u16) -> bool {
        (METRIC_KIND..=FAILURE_KIND).contains(&kind)
    }

    /// Encodes the telemetry as a frame.
    #[must_use]
    pub fn encode(&self) -> Frame {
        let body = self.body();
        let bytes = match self {
            Self::Failure { reason } => &reason.as_bytes()[..reason.floor_char_boundary(FRAME_PAYLOAD)],
            _ => bytemuck::bytes_of(&body),
        };
        let mut frame = Frame {
            kind: self.kind(),
            version: payload::VERSION,
            len: bytes.len() as u32,
            payload: [0; FRAME_PAYLOAD],
        };
        frame.payload[..bytes.len()].copy_from_slice(bytes);
        frame
    }

    /// Checks and copies the telemetry in a frame that another process wrote.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame does not contain valid telemetry. No content of a frame causes a panic.
    pub fn decode(frame: &Frame) -> Result<Self, DecodeError> {
        if frame.version != payload::VERSION {
            return Err(DecodeError::Version(frame.version));
        }
        let bytes = frame.payload.get(..frame.len as usize);
        if frame.kind == FAILURE_KIND {
            let reason = bytes.ok_or(DecodeError::Length(frame.len, FRAME_PAYLOAD))?;
            return Ok(Self::Failure { reason: String::from_utf8_lossy(reason).into_owned() });
        }
        let bytes = bytes.filter(|bytes| bytes.len() == size_of::<Body>());
        let bytes = bytes.ok_or(DecodeError::Length(frame.len, size_of::<Body>()))?;
        Self::of_body(frame.kind, &bytemuck::pod_read_unaligned(bytes))
    }

    fn kind(&self) -> u16 {
        match self {
            Self::Metric { .. } => METRIC_KIND,
            Self::Mark { .. } => MARK_KIND,
            Self::Line { .. } => LINE_KIND,
            Self::Failure { .. } => FAILURE_KIND,
        }
    }

    fn body(&self) -> Body {
        match *self {
            Self::Metric { name, value } => Body { label: name.into(), first: [value, 0.0, 0.0], ..Body::default() },
            Self::Mark { label, point_m } => Body { label, first: point_m, ..Body::default() },
            Self::Line { label, from_m, to_m } => Body { label, first: from_m, second: to_m },
            Self::Failure { .. } => Body::default(),
        }
    }

    fn of_body(kind: u16, body: &Body) -> Result<Self, DecodeError> {
        let &Body { label, first, second } = body;
        let place = first.iter().chain(&second).all(|value| value.abs() <= MAX_ABS);
        let check = |valid: bool, name| if valid { Ok(()) } else { Err(DecodeError::Field(name)) };
        match kind {
            METRIC_KIND => {
                let name = MetricName::try_from(label).map_err(|_| DecodeError::Field("metric name"))?;
                check(first[0].is_finite(), "metric")?;
                Ok(Self::Metric { name, value: first[0] })
            }
            MARK_KIND => {
                check(label.is_clean(), "label")?;
                check(place, "mark")?;
                Ok(Self::Mark { label, point_m: first })
            }
            LINE_KIND => {
                check(label.is_clean(), "label")?;
                check(place, "line")?;
                Ok(Self::Line { label, from_m: first, to_m: second })
            }
            kind => Err(DecodeError::Kind(kind)),
        }
    }
}

/// A figure, a mark or a line of one drone, as it is recorded.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TelemetryRow {
    /// The drone that reports it.
    pub drone: DroneId,
    /// [`METRIC_KIND`], [`MARK_KIND`] or [`LINE_KIND`].
    kind: u32,
    body: Body,
}

impl TelemetryRow {
    /// The row of a drone's report. A failure has no row: it is an event.
    #[must_use]
    pub fn new(drone: DroneId, telemetry: &Telemetry) -> Option<Self> {
        let row = Self { drone, kind: u32::from(telemetry.kind()), body: telemetry.body() };
        (!matches!(telemetry, Telemetry::Failure { .. })).then_some(row)
    }

    /// The figure's name and value; `None` if the row is no figure.
    #[must_use]
    pub fn metric(&self) -> Option<(MetricName, f64)> {
        if self.kind != u32::from(METRIC_KIND) {
            return None;
        }
        match self.telemetry()? {
            Telemetry::Metric { name, value } => Some((name, value)),
            _ => None,
        }
    }

    /// What the drone reports; `None` if the row is not valid.
    #[must_use]
    pub fn telemetry(&self) -> Option<Telemetry> {
        Telemetry::of_body(u16::try_from(self.kind).ok()?, &self.body).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all() -> [Telemetry; 4] {
        let label = ShortText::cut("goal");
        [
            Telemetry::Metric { name: MetricName::new("order").unwrap(), value: 0.5 },
            Telemetry::Mark { label, point_m: [1.0, 2.0, 3.0] },
            Telemetry::Line { label, from_m: [1.0, 2.0, 3.0], to_m: [4.0, 5.0, 6.0] },
            Telemetry::Failure { reason: "the pilot panicked".to_owned() },
        ]
    }

    #[test]
    fn telemetry_comes_through_its_frame_and_its_row() {
        for telemetry in all() {
            let frame = telemetry.encode();
            assert!(Telemetry::is_kind(frame.kind) && crate::Message::decode(&frame).is_err());
            assert_eq!(Telemetry::decode(&frame), Ok(telemetry.clone()));
            let row = TelemetryRow::new(DroneId(3), &telemetry);
            let back = row.and_then(|row| row.telemetry());
            assert_eq!(back, Some(telemetry).filter(|what| !matches!(what, Telemetry::Failure { .. })));
        }
    }

    #[test]
    fn values_that_are_no_numbers_are_refused() {
        let [Telemetry::Metric { name, .. }, ..] = all() else { panic!("the first is a metric") };
        let nan = Telemetry::Metric { name, value: f64::NAN };
        assert_eq!(Telemetry::decode(&nan.encode()), Err(DecodeError::Field("metric")));
        let far = Telemetry::Mark { label: ShortText::default(), point_m: [0.0, 0.0, f64::INFINITY] };
        assert_eq!(Telemetry::decode(&far.encode()), Err(DecodeError::Field("mark")));
        assert_eq!(TelemetryRow::new(DroneId(0), &nan).and_then(|row| row.telemetry()), None);
    }

    #[test]
    fn a_long_reason_is_cut_at_a_letter() {
        let Ok(Telemetry::Failure { reason }) =
            Telemetry::decode(&Telemetry::Failure { reason: "€".repeat(200) }.encode())
        else {
            panic!("a failure")
        };
        assert_eq!(reason, "€".repeat(101));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(kind in METRIC_KIND - 1..=FAILURE_KIND + 1, len in prop_oneof![Just(80u32), 0u32..400], bytes in prop::collection::vec(any::<u8>(), FRAME_PAYLOAD)) {
            let mut frame = Frame { kind, version: payload::VERSION, len, payload: [0; FRAME_PAYLOAD] };
            frame.payload.copy_from_slice(&bytes);
            if let Ok(telemetry) = Telemetry::decode(&frame) {
                prop_assert!(Telemetry::is_kind(telemetry.encode().kind));
            }
            let row: TelemetryRow = bytemuck::pod_read_unaligned(&bytes[..size_of::<TelemetryRow>()]);
            let _ = row.telemetry();
        }
    }
}
