//! Layouts of iceoryx2 samples. Every layout has a name with a version; a process with another version cannot open the
//! service.
#![allow(unsafe_code)]

use iceoryx2::prelude::ZeroCopySend;
use skein_protocol::frame::Frame;
use std::fmt;

// The names below carry the version of the protocol's payloads: raise both together. Downlinks and records have changed
// once more than frames.
const _: () = assert!(skein_protocol::payload::VERSION == 7);

/// Eight bytes of a byte stream. The type tells the streams apart.
///
/// # Safety
/// The type is a `repr(transparent)` wrapper of `u64`.
pub unsafe trait Word: ZeroCopySend + fmt::Debug + Copy + 'static {}

/// Eight bytes of a downlink.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct DownWord(u64);

/// Eight bytes of a record.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct RecordWord(u64);

// SAFETY: a `repr(transparent)` integer: it has no pointers, and the same layout in every process.
unsafe impl ZeroCopySend for DownWord {
    unsafe fn type_name() -> &'static str {
        "skein.downlink.v8"
    }
}

// SAFETY: a `repr(transparent)` integer: it has no pointers, and the same layout in every process.
unsafe impl ZeroCopySend for RecordWord {
    unsafe fn type_name() -> &'static str {
        "skein.record.v9"
    }
}

// SAFETY: `repr(transparent)` over `u64`.
unsafe impl Word for DownWord {}
// SAFETY: `repr(transparent)` over `u64`.
unsafe impl Word for RecordWord {}

/// A frame as it is published. `Frame` itself belongs to a crate that does not know iceoryx2.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct WireFrame(pub(crate) Frame);

// SAFETY: transparent over `Frame`, which is plain `repr(C)` data without padding or pointers.
unsafe impl ZeroCopySend for WireFrame {
    unsafe fn type_name() -> &'static str {
        "skein.frame.v7"
    }
}

/// User header of a byte stream.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("skein.stream-header.v2")]
pub struct StreamHeader {
    /// The tick that the sample belongs to.
    pub tick: u64,
    /// Bytes in use; the last word may have more.
    pub byte_len: u64,
}

/// User header of an uplink sample.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("skein.uplink-header.v2")]
pub struct UplinkHeader {
    /// The tick in which the frames were sent.
    pub tick: u64,
    /// The drone that sent them.
    pub source: u32,
    /// Incarnation of its process.
    pub incarnation: u32,
}
