//! `skein top`: the running swarms in the terminal.

mod screen;
mod watch;

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::tap::running;
use clap::Args;
use crossterm::event::{Event, KeyCode, KeyModifiers, poll, read};
use screen::{Screen, page};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};
use watch::Watch;

/// Arguments of `top`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein top
  skein top --once     a second's look, as text, for scripts

Keys: up and down choose a swarm, d shows its drones, space pauses, q ends.")]
pub struct TopArgs {
    /// Look for a second, print it as text, and end
    #[arg(long)]
    pub once: bool,
}

/// Between two pictures.
const PICTURE: Duration = Duration::from_millis(500);
/// Between two looks at records.
const LOOK: Duration = Duration::from_millis(2);
/// How long `--once` looks.
const ONCE: Duration = Duration::from_secs(1);

/// What the keys have changed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shown {
    /// The swarm whose groups are shown.
    pub chosen: usize,
    /// Whether its drones are.
    pub drones: bool,
    /// Whether the picture stands still.
    pub paused: bool,
}

/// Shows until it is ended.
pub fn top(args: &TopArgs) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    if args.once {
        return once(&interrupt);
    }
    if !std::io::stdout().is_terminal() {
        return Err(Failure::usage("stdout is no terminal; `skein top --once` prints text"));
    }
    let mut screen = Screen::open().map_err(Failure::environment)?;
    let (mut watches, mut shown) = (Vec::new(), Shown::default());
    let mut drawn = Instant::now() - PICTURE;
    while interrupt.signal().is_none() {
        gather(&mut watches);
        while poll(LOOK).map_err(Failure::environment)? {
            if !key(&read().map_err(Failure::environment)?, &mut shown, watches.len()) {
                return Ok(Exit::Reached);
            }
            drawn = Instant::now() - PICTURE;
        }
        if drawn.elapsed() >= PICTURE {
            drawn = Instant::now();
            attach(&mut watches)?;
            if !shown.paused {
                watches.iter_mut().for_each(Watch::turn);
            }
            screen.show(&page(&watches, shown)).map_err(Failure::environment)?;
        }
    }
    Ok(interrupt.signal().map_or(Exit::Reached, Exit::Interrupted))
}

fn once(interrupt: &Interrupt) -> Result<Exit, Failure> {
    let mut watches = Vec::new();
    attach(&mut watches)?;
    let since = Instant::now();
    while since.elapsed() < ONCE && interrupt.signal().is_none() {
        gather(&mut watches);
        std::thread::sleep(LOOK);
    }
    watches.iter_mut().for_each(Watch::turn);
    let lines = page(&watches, Shown { drones: true, ..Shown::default() });
    let text: String = lines.iter().map(|line| format!("{}\n", line.text)).collect();
    // A closed pipe is the reader's choice.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(Exit::Reached)
}

fn gather(watches: &mut [Watch]) {
    watches.iter_mut().for_each(Watch::gather);
}

/// Attaches to swarms that are new, and forgets those that have gone.
fn attach(watches: &mut Vec<Watch>) -> Result<(), Failure> {
    let found = running(None)?;
    watches.retain(|watch| found.contains(&watch.run));
    for run in found {
        if !watches.iter().any(|watch| watch.run == run) {
            // One that has just begun is there at the next look.
            watches.extend(Watch::attach(run).ok());
        }
    }
    Ok(())
}

/// False to end.
fn key(event: &Event, shown: &mut Shown, swarms: usize) -> bool {
    let Event::Key(key) = event else { return true };
    match key.code {
        KeyCode::Char('q') | KeyCode::Esc => return false,
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return false,
        KeyCode::Char('d') => shown.drones = !shown.drones,
        KeyCode::Char(' ') => shown.paused = !shown.paused,
        KeyCode::Down | KeyCode::Char('j') => shown.chosen = (shown.chosen + 1).min(swarms.saturating_sub(1)),
        KeyCode::Up | KeyCode::Char('k') => shown.chosen = shown.chosen.saturating_sub(1),
        _ => {}
    }
    true
}
