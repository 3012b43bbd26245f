//! What a connection costs on this machine: the time of a message there and back, and of a byte.

use crate::error::BenchError;
use crate::median::median;
use serde::Serialize;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::time::Instant;

/// Messages there and back.
const ROUNDS: usize = 2000;
/// Size of a small message, bytes.
const SMALL: usize = 64;
/// Size of a large message, bytes, and how often it is sent.
const LARGE: (usize, usize) = (1 << 20, 50);

/// What a connection costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wire {
    /// A small message there and back, median, µs.
    pub round_trip_us: f64,
    /// A byte of a large message there and back, per direction, µs.
    pub byte_us: f64,
}

impl Wire {
    /// Measures a TCP connection on the loopback interface, with a thread that echoes.
    pub(super) fn loopback() -> Result<Self, BenchError> {
        measure().map_err(BenchError::system("measuring the loopback interface"))
    }
}

fn measure() -> io::Result<Wire> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let mut near = TcpStream::connect(listener.local_addr()?)?;
    let (far, _) = listener.accept()?;
    near.set_nodelay(true)?;
    far.set_nodelay(true)?;
    let echo = std::thread::spawn(move || echo(far));
    let small: Vec<f64> = (0..ROUNDS).map(|_| there_and_back(&mut near, SMALL)).collect::<io::Result<_>>()?;
    let large: Vec<f64> = (0..LARGE.1).map(|_| there_and_back(&mut near, LARGE.0)).collect::<io::Result<_>>()?;
    drop(near);
    // It ends with the connection.
    let _ = echo.join();
    let round_trip_us = median(small.into_iter());
    let byte_us = (median(large.into_iter()) - round_trip_us).max(0.0) / (2 * LARGE.0) as f64;
    Ok(Wire { round_trip_us, byte_us })
}

/// Sends back each message: its length, and so many bytes.
fn echo(mut line: TcpStream) -> io::Result<()> {
    let mut len = [0; 8];
    let mut bytes = vec![0; LARGE.0];
    while line.read_exact(&mut len).is_ok() {
        let count = (u64::from_le_bytes(len) as usize).min(LARGE.0);
        line.read_exact(&mut bytes[..count])?;
        line.write_all(&bytes[..count])?;
    }
    Ok(())
}

/// The time that a message takes, µs.
fn there_and_back(line: &mut TcpStream, len: usize) -> io::Result<f64> {
    let mut message = (len as u64).to_le_bytes().to_vec();
    message.resize(size_of::<u64>() + len, 1);
    let began = Instant::now();
    line.write_all(&message)?;
    line.read_exact(&mut message[..len])?;
    Ok(began.elapsed().as_secs_f64() * 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_connection_costs_time() {
        let wire = Wire::loopback().unwrap();
        assert!(wire.round_trip_us > 0.5 && wire.byte_us > 1e-6, "{wire:?}");
    }
}
