//! `skein view`: a running swarm, or a recorded run, in the browser of this machine.

mod live_feed;
mod request;
mod server;
mod token;
mod waiting_room;

use crate::complaint::complain;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output::print_line;
use crate::run_folder;
use crate::tap::{LookArgs, Swarms};
use clap::Args;
use live_feed::LiveFeed;
use request::Door;
use server::Content;
use skein_report::{Interrupted, page};
use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use token::Token;

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein view                      the running swarm, or the next one
  skein view runs/s2-right-1      a recorded run
  skein view --port 8080 --open
  skein view --connect tls/10.0.0.2:7448 --keys keys      a swarm of another machine, see `skein share`

The page is served on 127.0.0.1, to this machine only. The address contains a token: no one else can open the page.
Ctrl-C stops the server; the swarm flies on.")]
pub(crate) struct ViewArgs {
    /// Folder of a recorded run [default: a running swarm]
    pub(crate) run_dir: Option<PathBuf>,
    /// Port on 127.0.0.1; 0 selects a free one
    #[arg(long, default_value_t = 0, value_name = "PORT")]
    pub(crate) port: u16,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
    /// Watch swarms whose name begins with NAME, as shown by `skein top`
    #[arg(long, value_name = "NAME", conflicts_with = "run_dir")]
    pub(crate) run: Option<String>,
    /// Where swarms are looked for.
    #[command(flatten)]
    pub(crate) look: LookArgs,
}

/// Niceness of the view, as in `nice -n`, so that the swarm has precedence.
const NICE: i32 = 10;

/// Serves the page until it is interrupted.
pub(crate) fn view(args: &ViewArgs) -> Result<Exit, Failure> {
    let swarms = match (&args.run_dir, Swarms::of(&args.look)?) {
        (Some(_), Swarms::There(_)) => return Err(Failure::usage("--connect: expected no RUN_DIR beside it")),
        (_, swarms) => swarms,
    };
    let interrupt = Interrupt::watch()?;
    // If it fails, the view takes a little more CPU time from the swarm.
    let _ = rustix::process::nice(NICE);
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, args.port))
        .map_err(|error| Failure::environment(format!("127.0.0.1:{}: {error}; try another --port", args.port)))?;
    let port = listener.local_addr().map_err(Failure::environment)?.port();
    let content = match &args.run_dir {
        Some(path) => Content::Page(recorded(path)?),
        None => {
            Content::Live { page: page::live(port), feed: Arc::new(LiveFeed::start(swarms.clone(), args.run.clone())) }
        }
    };
    let token = Token::draw().map_err(|error| Failure::environment(format!("/dev/urandom: {error}")))?;
    let url = format!("http://127.0.0.1:{port}/{}", token.query());
    print_line(&url)?;
    if args.open {
        open(&url);
    }
    server::serve(&listener, &Door { port, token }, &content, &interrupt).map_err(Failure::environment)?;
    swarms.failure().map_or(Ok(Exit::Reached), Err)
}

fn recorded(path: &std::path::Path) -> Result<String, Failure> {
    let folder = run_folder::open_recorded(path)?;
    let manifest = folder.read_manifest().map_err(Failure::report)?;
    let summary = folder.read_summary().map_err(Failure::report)?;
    page::report(&folder, &manifest, &summary, &Interrupted::never()).map_err(Failure::report)
}

/// Opens the address with the desktop's browser. Without a desktop, the address is on stdout.
fn open(url: &str) {
    let mut command = Command::new("xdg-open");
    command.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(error) = command.spawn() {
        complain(format!("xdg-open: {error}; open {url} yourself"));
    }
}
