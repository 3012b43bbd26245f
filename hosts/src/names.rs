//! The names under which hosts, relays and flights find each other on the network.

/// A queryable of a host that begins a flight.
pub(crate) fn begin(host: &str) -> String {
    format!("skein/host/{host}/begin")
}

/// The liveliness token of a host.
pub(crate) fn alive(host: &str) -> String {
    format!("skein/host/{host}/alive")
}

/// Ticks and requests, from the relay to the host.
pub(crate) fn down(flight: &str) -> String {
    format!("skein/flight/{flight}/down")
}

/// Answers, from the host to the relay.
pub(crate) fn up(flight: &str) -> String {
    format!("skein/flight/{flight}/up")
}

/// The liveliness token of a flight's relay.
pub(crate) fn relay(flight: &str) -> String {
    format!("skein/flight/{flight}/relay")
}

/// The liveliness token of a flight on its host.
pub(crate) fn wing(flight: &str) -> String {
    format!("skein/flight/{flight}/wing")
}

/// A queryable of a share, which says what swarms of its machine publish.
pub(crate) fn share(id: &str) -> String {
    format!("skein/share/{id}")
}

/// Whether a text can be part of a name on the network.
pub(crate) fn is_name(text: &str) -> bool {
    let letter = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    (1..=128).contains(&text.len()) && text.chars().all(letter)
}
