//! `skein host` and `skein run --hosts`: other machines that fly drones. `skein share`: other machines that look. The program
//! `skein-hosts`, which is built apart, does what needs a network.

use crate::exit::{Exit, Failure};
use crate::scenario_args::ScenarioArgs;
use clap::Args;
use skein_protocol::DroneId;
use skein_runtime::{HostShare, PilotRegistry, Program};
use skein_scenario::{HostKeys, Scenario};
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program beside this one.
const PROGRAM: &str = "skein-hosts";

/// How to reach other machines.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Network")]
pub(crate) struct NetworkArgs {
    /// Zenoh endpoints to connect to, such as tls/10.0.0.2:7447: hosts or routers
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',')]
    pub(crate) connect: Vec<String>,
    /// Folder with certificates and keys, as `skein host --init-keys` makes them
    #[arg(long, value_name = "DIR")]
    pub(crate) keys: Option<PathBuf>,
    /// Allow endpoints beyond this machine that let anyone in
    #[arg(long)]
    pub(crate) insecure: bool,
    /// Zenoh configuration file (JSON5): routers, access control, QUIC
    #[arg(long, value_name = "FILE")]
    pub(crate) zenoh_config: Option<PathBuf>,
}

impl NetworkArgs {
    /// What other machines fly. A host that cannot be reached by any endpoint flies its drones here.
    pub(crate) fn shares(
        &self,
        (args, scenario): (&ScenarioArgs, &Scenario),
        own_program: Option<&str>,
        per_process: u32,
    ) -> Result<Vec<HostShare>, Failure> {
        let reached =
            |host: &HostKeys| !self.connect.is_empty() || self.zenoh_config.is_some() || host.connect.is_some();
        if !args.hosts.is_empty() && !scenario.hosts.iter().all(reached) {
            return Err(Failure::usage("--hosts: expected --connect ENDPOINT beside it"));
        }
        let (mut shares, mut first) = (Vec::new(), 0);
        for host in &scenario.hosts {
            if reached(host) {
                let relay = self.relay(host, own_program, per_process)?;
                shares.push(HostShare { name: host.name.clone(), first: DroneId(first), count: host.drones, relay });
            }
            first += host.drones;
        }
        match self.given().filter(|_| shares.is_empty()) {
            Some(option) => Err(Failure::usage(format!("{option}: expected --hosts NAME=COUNT or [[host]] beside it"))),
            None => Ok(shares),
        }
    }

    /// The first of these options that is given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--connect", !self.connect.is_empty()),
            ("--keys", self.keys.is_some()),
            ("--insecure", self.insecure),
            ("--zenoh-config", self.zenoh_config.is_some()),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The words of a host's relay.
    fn relay(&self, host: &HostKeys, own_program: Option<&str>, per_process: u32) -> Result<Program, Failure> {
        let mut words = vec![program()?.into(), "relay".into(), "--per-process".into(), per_process.to_string().into()];
        if let Some(hash) = own_program {
            words.extend(["--own-program".into(), hash.into()]);
        }
        self.append_to(&mut words, host.connect.as_deref());
        Ok(Program::new(words))
    }

    /// Appends these options, with one more endpoint.
    pub(crate) fn append_to(&self, words: &mut Vec<OsString>, endpoint: Option<&str>) {
        for endpoint in endpoint.into_iter().chain(self.connect.iter().map(String::as_str)) {
            words.extend(["--connect".into(), endpoint.into()]);
        }
        let files = [("--keys", &self.keys), ("--zenoh-config", &self.zenoh_config)];
        for (name, path) in files.into_iter().filter_map(|(name, path)| Some((name, path.as_ref()?))) {
            words.extend([name.into(), path.into()]);
        }
        words.extend(self.insecure.then(|| "--insecure".into()));
    }
}

/// Arguments of `share`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein share
  skein share --listen tls/0.0.0.0:7448 --keys keys      and on another machine:
  skein view --connect tls/10.0.0.2:7448 --keys keys

Swarms that start later are shared as well. Ctrl-C ends the share; the swarms fly on.")]
pub(crate) struct ShareArgs {
    /// Share only swarms whose name begins with RUN, as shown by `skein top`
    pub(crate) run: Option<String>,
    /// Zenoh endpoints where viewers reach this machine
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',', default_value = "tcp/127.0.0.1:7448")]
    pub(crate) listen: Vec<String>,
    /// How to reach other machines.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
}

/// Shares the swarms of this machine: becomes `skein-hosts share`.
pub(crate) fn share(args: &ShareArgs) -> Result<Exit, Failure> {
    let mut words: Vec<OsString> = vec!["share".into()];
    for endpoint in &args.listen {
        words.extend(["--listen".into(), endpoint.into()]);
    }
    args.network.append_to(&mut words, None);
    if let Some(run) = &args.run {
        words.extend(["--".into(), run.into()]);
    }
    become_program(words)
}

/// Arguments of `host`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein host --name a --drones 8
  skein host --init-keys keys
  skein host --name a --drones 500 --listen tls/0.0.0.0:7447 --keys keys")]
pub(crate) struct HostArgs {
    /// Name of this host, as runs use it [default: the machine's name]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Number of drones that this machine offers at a time
    #[arg(long, value_name = "COUNT", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) drones: u32,
    /// Zenoh endpoints where runs reach this host
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',', default_value = "tcp/127.0.0.1:7447")]
    pub(crate) listen: Vec<String>,
    /// Make an authority and the certificates of hosts and launchers in a new folder, and end
    #[arg(long, value_name = "DIR")]
    pub(crate) init_keys: Option<PathBuf>,
    /// How to reach other machines.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
}

/// Offers this machine: becomes `skein-hosts host`.
pub(crate) fn host(args: &HostArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    let mut words: Vec<OsString> = vec!["host".into(), "--drones".into(), args.drones.to_string().into()];
    for endpoint in &args.listen {
        words.extend(["--listen".into(), endpoint.into()]);
    }
    if let Some(name) = &args.name {
        words.extend(["--name".into(), name.into()]);
    }
    if let Some(folder) = &args.init_keys {
        words.extend(["--init-keys".into(), folder.into()]);
    }
    let program = serde_json::to_string(&pilots.program().words()).map_err(Failure::environment)?;
    words.extend(["--program".into(), program.into()]);
    args.network.append_to(&mut words, None);
    become_program(words)
}

/// Becomes `skein-hosts` with these arguments.
fn become_program(words: Vec<OsString>) -> Result<Exit, Failure> {
    let path = program()?;
    let error = Command::new(&path).args(words).exec();
    Err(Failure::environment(format!("starting {}: {error}", path.display())))
}

/// `skein-hosts`: beside this executable, or in the search path.
pub(crate) fn program() -> Result<PathBuf, Failure> {
    let own = std::env::current_exe().unwrap_or_default();
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let beside = own.parent().map(Path::to_owned).into_iter();
    let found =
        beside.chain(std::env::split_paths(&folders)).map(|folder| folder.join(PROGRAM)).find(|path| path.is_file());
    found.ok_or_else(|| {
        Failure::environment(format!(
            "expected the program {PROGRAM} beside {} or in PATH: `cargo build --release -p {PROGRAM}` makes it",
            own.display()
        ))
    })
}
