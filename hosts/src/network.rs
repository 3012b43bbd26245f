//! How a host or a relay reaches the network, and who may.

use crate::error::HostsError;
use clap::Args;
use serde_json::Value;
use std::net::{IpAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use zenoh::config::EndPoint;
use zenoh::{Config, Session, Wait};

/// A peer that is silent for this long is gone, ms. Chosen by hand: drones of a launcher that is gone end within two seconds, and TCP
/// repeats what was lost in a second without network after 1.4 s.
const LEASE_MS: u64 = 1_750;

/// How long a relay tries to reach hosts, ms. Chosen by hand.
const CONNECT_MS: u64 = 5_000;

/// How to reach the network.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct NetworkArgs {
    /// Zenoh endpoints to connect to, such as a router's
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',')]
    pub(crate) connect: Vec<String>,
    /// Folder with certificates and keys, as `skein host --init-keys` makes them
    #[arg(long, value_name = "DIR")]
    pub(crate) keys: Option<PathBuf>,
    /// Let anyone on the network in, without TLS
    #[arg(long)]
    pub(crate) insecure: bool,
    /// Zenoh configuration file (JSON5): routers, access control, QUIC
    #[arg(long, value_name = "FILE")]
    pub(crate) zenoh_config: Option<PathBuf>,
}

/// Which of the keys in a folder are this process's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// Those of hosts.
    Host,
    /// Those of launchers.
    Launcher,
}

impl Side {
    /// The name of the files of its certificate and key.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Launcher => "launcher",
        }
    }
}

impl NetworkArgs {
    /// Opens a session that listens on these endpoints.
    ///
    /// # Errors
    /// [`HostsError::Usage`] if an endpoint is none, or others than this machine could reach it without a certificate;
    /// [`HostsError::Network`].
    pub(crate) fn open(&self, listen: &[String], side: Side) -> Result<Session, HostsError> {
        let config = self.config(listen, side)?;
        zenoh::open(config).wait().map_err(HostsError::network("joining the network"))
    }

    fn config(&self, listen: &[String], side: Side) -> Result<Config, HostsError> {
        for text in listen.iter().chain(&self.connect) {
            endpoint(text)?;
        }
        let mut config = match &self.zenoh_config {
            Some(path) => {
                Config::from_file(path).map_err(HostsError::network(format!("reading {}", path.display())))?
            }
            None => quiet()?,
        };
        if self.zenoh_config.is_none() || !listen.is_empty() {
            set(&mut config, "listen/endpoints", &serde_json::json!(listen))?;
        }
        if !self.connect.is_empty() {
            set(&mut config, "connect/endpoints", &serde_json::json!(self.connect))?;
        }
        set(&mut config, "connect/timeout_ms", &CONNECT_MS.into())?;
        set(&mut config, "connect/exit_on_failure", &false.into())?;
        set(&mut config, "transport/link/tx/lease", &LEASE_MS.into())?;
        if let Some(folder) = &self.keys {
            use_keys(&mut config, folder, side)?;
        }
        if !self.insecure {
            check(&config)?;
        }
        Ok(config)
    }
}

/// A configuration that searches for no one and answers no search.
fn quiet() -> Result<Config, HostsError> {
    let mut config = Config::default();
    set(&mut config, "mode", &"peer".into())?;
    set(&mut config, "scouting/multicast/enabled", &false.into())?;
    set(&mut config, "scouting/gossip/enabled", &false.into())?;
    Ok(config)
}

fn set(config: &mut Config, key: &str, value: &Value) -> Result<(), HostsError> {
    config.insert_json5(key, &value.to_string()).map_err(HostsError::network(format!("setting {key} of Zenoh")))
}

fn use_keys(config: &mut Config, folder: &Path, side: Side) -> Result<(), HostsError> {
    let file = |name: String| {
        let path = folder.join(name);
        match path.is_file() {
            true => Ok(Value::from(path.to_string_lossy().into_owned())),
            false => Err(HostsError::Usage(format!(
                "--keys: expected the file {}; `skein host --init-keys DIR` makes it",
                path.display()
            ))),
        }
    };
    let (own, key) = (file(format!("{}.pem", side.word()))?, file(format!("{}-key.pem", side.word()))?);
    let tls = |name: &str| format!("transport/link/tls/{name}");
    set(config, &tls("root_ca_certificate"), &file("authority.pem".to_owned())?)?;
    set(config, &tls("enable_mtls"), &true.into())?;
    // The authority is the user's own, and signs nothing but hosts and launchers.
    set(config, &tls("verify_name_on_connect"), &false.into())?;
    for role in ["listen", "connect"] {
        set(config, &tls(&format!("{role}_certificate")), &own)?;
        set(config, &tls(&format!("{role}_private_key")), &key)?;
    }
    Ok(())
}

/// Refuses endpoints that others than this machine could use without a certificate.
fn check(config: &Config) -> Result<(), HostsError> {
    let mutual = config.get_json("transport/link/tls/enable_mtls").is_ok_and(|value| value == "true");
    for key in ["listen/endpoints", "connect/endpoints"] {
        let json = config.get_json(key).map_err(HostsError::network(format!("reading {key} of Zenoh")))?;
        let value: Value = serde_json::from_str(&json).unwrap_or_default();
        for endpoint in strings(&value) {
            if !is_protected(endpoint, mutual)? {
                return Err(HostsError::Usage(format!(
                    "{endpoint} is reached from other machines, and lets anyone in: expected tls/ADDRESS:PORT with --keys DIR \
                     (`skein host --init-keys DIR` makes keys), or --insecure"
                )));
            }
        }
    }
    Ok(())
}

/// All strings in a value, however deep.
fn strings(value: &Value) -> Vec<&str> {
    match value {
        Value::String(text) => vec![text],
        Value::Array(list) => list.iter().flat_map(strings).collect(),
        Value::Object(map) => map.values().flat_map(strings).collect(),
        _ => Vec::new(),
    }
}

fn endpoint(text: &str) -> Result<EndPoint, HostsError> {
    let usage = |error| HostsError::Usage(format!("{text}: expected an endpoint such as tcp/127.0.0.1:7447: {error}"));
    EndPoint::from_str(text).map_err(usage)
}

/// Whether an endpoint stays on this machine, or wants a certificate of both sides.
fn is_protected(text: &str, mutual: bool) -> Result<bool, HostsError> {
    let endpoint = endpoint(text)?;
    let encrypted = ["tls", "quic"].contains(&endpoint.protocol().as_str());
    if encrypted && mutual && endpoint.config().get("enable_mtls").is_none_or(|value| value == "true") {
        return Ok(true);
    }
    if endpoint.protocol().as_str().starts_with("unix") {
        return Ok(true);
    }
    let address = endpoint.address().as_str().to_owned();
    let mut found = address
        .to_socket_addrs()
        .map_err(|error| HostsError::Usage(format!("{text}: expected an address that can be found: {error}")))?
        .peekable();
    Ok(found.peek().is_some() && found.all(|address| is_loopback(address.ip())))
}

fn is_loopback(address: IpAddr) -> bool {
    address.to_canonical().is_loopback()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(args: &NetworkArgs, listen: &str) -> Option<String> {
        args.config(&[listen.to_owned()], Side::Host).err().map(|error| error.to_string())
    }

    #[test]
    fn beyond_this_machine_both_sides_need_certificates() {
        let open = NetworkArgs::default();
        for own in ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:7447"] {
            assert_eq!(refusal(&open, own), None, "{own}");
        }
        for wide in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/10.0.0.2:7447", "tls/10.0.0.2:7447"] {
            assert!(refusal(&open, wide).unwrap().contains("--insecure"), "{wide}");
            assert_eq!(refusal(&NetworkArgs { insecure: true, ..NetworkArgs::default() }, wide), None, "{wide}");
        }
        let folder = tempfile::tempdir().unwrap();
        let keyed = NetworkArgs { keys: Some(folder.path().to_owned()), ..NetworkArgs::default() };
        assert!(refusal(&keyed, "tls/10.0.0.2:7447").unwrap().contains("host.pem"));
        crate::keys::make(&folder.path().join("keys")).unwrap();
        let keyed = NetworkArgs { keys: Some(folder.path().join("keys")), ..NetworkArgs::default() };
        assert_eq!(refusal(&keyed, "tls/10.0.0.2:7447"), None);
        assert!(refusal(&keyed, "tcp/10.0.0.2:7447").is_some());
        assert!(refusal(&keyed, "tls/10.0.0.2:7447#enable_mtls=false").is_some());
        let outward = NetworkArgs { connect: vec!["tcp/10.0.0.3:1".to_owned()], ..NetworkArgs::default() };
        assert!(refusal(&outward, "tcp/127.0.0.1:7447").unwrap().contains("10.0.0.3"));
        assert!(refusal(&open, "tcp").unwrap().contains("such as tcp/127.0.0.1:7447"));
    }
}
