//! `skein top`: the running swarms in the terminal.

mod display_state;
mod json;
mod screen;
mod swarm_view;

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output;
use crate::tap::{LookArgs, Swarms};
use clap::Args;
use crossterm::event::{Event, KeyCode, KeyModifiers, poll, read};
use display_state::DisplayState;
use screen::{Screen, page};
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use swarm_view::SwarmView;

/// Arguments of `top`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein top
  skein top --once     watch for one second and print text
  skein top --json     the same as one JSON object, for scripts
  skein top --connect tls/10.0.0.2:7448 --keys keys      the swarms of another machine, see `skein share`

Keys: up and down select a swarm, d shows its drones, space pauses, q quits.")]
pub(crate) struct TopArgs {
    /// Watch for one second, print the result as text, and exit
    #[arg(long)]
    pub(crate) once: bool,
    /// As --once, but print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Where swarms are looked for.
    #[command(flatten)]
    pub(crate) look: LookArgs,
}

/// Time between two redraws.
const REDRAW: Duration = Duration::from_millis(500);
/// Time between two looks for records.
const POLL: Duration = Duration::from_millis(2);
/// Time for which `--once` watches.
const ONCE: Duration = Duration::from_secs(1);

/// Shows the swarms until the user quits.
pub(crate) fn top(args: &TopArgs) -> Result<Exit, Failure> {
    let once_only = args.once || args.json;
    if !once_only && !std::io::stdout().is_terminal() {
        return Err(Failure::usage(
            "stdout is not a terminal; `skein top --once` prints text, `skein top --json` prints JSON",
        ));
    }
    let found = Swarms::of(&args.look)?;
    let interrupt = Interrupt::watch()?;
    if once_only {
        return once(args, &found, &interrupt);
    }
    let mut screen = Screen::open().map_err(Failure::environment)?;
    let (mut swarms, mut shown) = (Vec::new(), DisplayState::default());
    let mut drawn = Instant::now() - REDRAW;
    while interrupt.signal().is_none() {
        gather(&mut swarms);
        while poll(POLL).map_err(Failure::environment)? {
            if !key(&read().map_err(Failure::environment)?, &mut shown, swarms.len()) {
                return Ok(Exit::Reached);
            }
            drawn = Instant::now() - REDRAW;
        }
        if drawn.elapsed() >= REDRAW {
            drawn = Instant::now();
            attach(&found, &mut swarms)?;
            if !shown.paused {
                for swarm in &mut swarms {
                    swarm.turn();
                }
            }
            screen.show(&page(&swarms, shown, &found.none(None))).map_err(Failure::environment)?;
        }
    }
    Ok(interrupt.signal().map_or(Exit::Reached, Exit::Interrupted))
}

fn once(args: &TopArgs, found: &Swarms, interrupt: &Interrupt) -> Result<Exit, Failure> {
    let mut swarms = Vec::new();
    attach(found, &mut swarms)?;
    let since = Instant::now();
    while since.elapsed() < ONCE && interrupt.signal().is_none() {
        gather(&mut swarms);
        std::thread::sleep(POLL);
    }
    if let Some(failure) = found.failure() {
        return Err(failure);
    }
    for swarm in &mut swarms {
        swarm.turn();
    }
    if args.json {
        output::print_line(json::page(&swarms))?;
        return Ok(Exit::Reached);
    }
    let lines = page(&swarms, DisplayState { drones: true, ..DisplayState::default() }, &found.none(None));
    let text: String = lines.iter().map(|line| format!("{}\n", line.text)).collect();
    output::print(text)?;
    Ok(Exit::Reached)
}

fn gather(swarms: &mut [SwarmView]) {
    for swarm in swarms {
        swarm.gather();
    }
}

/// Attaches to new swarms, and drops those that have ended.
fn attach(source: &Swarms, swarms: &mut Vec<SwarmView>) -> Result<(), Failure> {
    let found = source.running(None)?;
    swarms.retain(|swarm| found.contains(&swarm.run));
    for run in found {
        if !swarms.iter().any(|swarm| swarm.run == run) {
            // Attaching to a swarm that has just started can fail; it is tried again at the next redraw.
            swarms.extend(SwarmView::attach(source, run).ok());
        }
    }
    Ok(())
}

/// Handles a key. False if the user quits.
fn key(event: &Event, shown: &mut DisplayState, count: usize) -> bool {
    let Event::Key(key) = event else { return true };
    match key.code {
        KeyCode::Char('q') | KeyCode::Esc => return false,
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return false,
        KeyCode::Char('d') => shown.drones = !shown.drones,
        KeyCode::Char(' ') => shown.paused = !shown.paused,
        KeyCode::Down | KeyCode::Char('j') => shown.chosen = (shown.chosen + 1).min(count.saturating_sub(1)),
        KeyCode::Up | KeyCode::Char('k') => shown.chosen = shown.chosen.saturating_sub(1),
        _ => {}
    }
    true
}
