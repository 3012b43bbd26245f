//! Where swarms are looked for.

use crate::exit::Failure;
use crate::hosts::NetworkArgs;
use clap::Args;
use std::path::PathBuf;

/// How to reach swarms of other machines.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Other machines")]
pub(crate) struct LookArgs {
    /// Look at the swarms that `skein share` offers there, and not at those of this machine: Zenoh endpoints, such as tls/10.0.0.2:7448
    #[arg(long, global = true, value_name = "ENDPOINT", value_delimiter = ',')]
    connect: Vec<String>,
    /// With --connect: folder with certificates and keys, as `skein host --init-keys` makes them
    #[arg(long, global = true, value_name = "DIR")]
    keys: Option<PathBuf>,
    /// With --connect: allow endpoints beyond this machine that let anyone in
    #[arg(long, global = true)]
    insecure: bool,
    /// Zenoh configuration file (JSON5): routers, access control, QUIC
    #[arg(long, global = true, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

impl LookArgs {
    /// How to reach the other machines; `None` if swarms of this machine are looked for.
    pub(crate) fn network(&self) -> Result<Option<NetworkArgs>, Failure> {
        let Self { connect, keys, insecure, zenoh_config } = self.clone();
        if connect.is_empty() && zenoh_config.is_none() {
            return match () {
                () if keys.is_some() => Err(Failure::usage("--keys: expected --connect ENDPOINT beside it")),
                () if insecure => Err(Failure::usage("--insecure: expected --connect ENDPOINT beside it")),
                () => Ok(None),
            };
        }
        Ok(Some(NetworkArgs { connect, keys, insecure, zenoh_config }))
    }
}
