//! The terminal: what is on it, and how it is given back.

use super::Shown;
use super::watch::Watch;
use crossterm::style::{Attribute, Print, SetAttribute};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
    disable_raw_mode, enable_raw_mode, size,
};
use crossterm::{cursor, execute, queue};
use skein_protocol::Phase;
use std::collections::BTreeMap;
use std::io::{Stdout, Write, stdout};

/// A line and whether it stands out.
pub struct Line {
    /// What it says.
    pub text: String,
    /// Heads and the chosen swarm.
    pub bold: bool,
}

fn plain(text: String) -> Line {
    Line { text, bold: false }
}

fn bold(text: String) -> Line {
    Line { text, bold: true }
}

/// The terminal, given back as it was when this is dropped.
pub struct Screen(Stdout);

impl Screen {
    /// Takes the terminal.
    pub fn open() -> std::io::Result<Self> {
        enable_raw_mode()?;
        // From here on, whatever happens gives it back.
        let mut screen = Self(stdout());
        execute!(screen.0, EnterAlternateScreen, cursor::Hide)?;
        Ok(screen)
    }

    /// Shows lines, as many and as much of them as there is room for.
    pub fn show(&mut self, lines: &[Line]) -> std::io::Result<()> {
        let (width, height) = size()?;
        queue!(self.0, BeginSynchronizedUpdate)?;
        for (row, line) in (0..height).zip(lines) {
            let text: String = line.text.chars().take(width.into()).collect();
            queue!(self.0, cursor::MoveTo(0, row), Clear(ClearType::CurrentLine))?;
            if line.bold {
                queue!(self.0, SetAttribute(Attribute::Bold))?;
            }
            queue!(self.0, Print(text), SetAttribute(Attribute::Reset))?;
        }
        if lines.len() < height.into() {
            queue!(self.0, cursor::MoveTo(0, lines.len() as u16), Clear(ClearType::FromCursorDown))?;
        }
        queue!(self.0, EndSynchronizedUpdate)?;
        self.0.flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // There is nobody left to tell.
        let _ = execute!(self.0, cursor::Show, LeaveAlternateScreen);
        let _ = disable_raw_mode();
    }
}

/// What is to be seen.
pub fn page(watches: &[Watch], shown: Shown) -> Vec<Line> {
    let paused = if shown.paused { "  PAUSED" } else { "" };
    let mut lines = vec![plain(format!("skein top    up/down swarm   d drones   space pause   q quit{paused}"))];
    if watches.is_empty() {
        lines.push(plain("no swarm runs; start one with `skein run SCENARIO`".to_owned()));
        return lines;
    }
    lines.push(bold(format!(
        "{:<28}{:>7}{:>9}{:>10}{:>8}{:>8}{:>10}{:>10}{:>10}{:>8}",
        "SWARM", "DRONES", "T (s)", "TICKS/s", "x REAL", "MIN m", "SENT/s", "HEARD/s", "DROP/s", "LOSS"
    )));
    let chosen = shown.chosen.min(watches.len() - 1);
    for (place, watch) in watches.iter().enumerate() {
        let line = swarm(watch);
        lines.push(if place == chosen { bold(line) } else { plain(line) });
    }
    lines.push(plain(String::new()));
    lines.extend(groups(&watches[chosen]));
    if shown.drones {
        lines.push(plain(String::new()));
        lines.extend(drones(&watches[chosen]));
    }
    lines
}

fn swarm(watch: &Watch) -> String {
    let rates = watch.rates;
    let alive = watch.rows.iter().filter(|row| row.alive()).count();
    let least = watch.separation_m.map_or("-".to_owned(), |m| format!("{m:.1}"));
    let all = rates.heard + rates.dropped;
    let loss = if all > 0.0 { format!("{:.1} %", 100.0 * rates.dropped / all) } else { "-".to_owned() };
    format!(
        "{:<28}{:>7}{:>9.1}{:>10.0}{:>8.1}{least:>8}{:>10.0}{:>10.0}{:>10.0}{loss:>8}",
        watch.run.name(),
        format!("{alive}/{}", watch.tap.facts.drones),
        watch.t_s,
        rates.ticks,
        rates.real,
        rates.sent,
        rates.heard,
        rates.dropped,
    )
}

fn groups(watch: &Watch) -> Vec<Line> {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (drone, row) in watch.rows.iter().enumerate().filter(|(_, row)| row.alive()) {
        groups.entry(row.group.to_string()).or_default().push(drone);
    }
    let mut lines =
        vec![bold(format!("{:<12}{:>7}{:>10}{:>12}{:>12}", "GROUP", "DRONES", "LEADER", "SPEED m/s", "PHASE"))];
    for (group, members) in groups {
        let rows = || members.iter().map(|&drone| &watch.rows[drone]);
        let leads = |drone: &&usize| watch.rows[**drone].leads();
        let leaders: Vec<String> = members.iter().filter(leads).map(usize::to_string).collect();
        let speed = rows().map(|row| row.velocity_mps[0].hypot(row.velocity_mps[1])).sum::<f64>();
        let phase = rows().map(|row| row.phase()).max().map_or("-", Phase::name);
        let leader = if leaders.is_empty() { "-".to_owned() } else { leaders.join(",") };
        let (count, speed) = (members.len(), speed / members.len() as f64);
        lines.push(plain(format!("{group:<12}{count:>7}{leader:>10}{speed:>12.2}{phase:>12}")));
    }
    lines
}

fn drones(watch: &Watch) -> Vec<Line> {
    let head = format!(
        "{:>6}{:>10}{:>10}{:>9}{:>10}{:>8}{:>12}{:>8}{:>9}",
        "DRONE", "x m", "y m", "m/s", "GROUP", "LEADER", "ENERGY kJ", "PHASE", "STEP us"
    );
    let mut lines = vec![bold(head)];
    for (drone, row) in watch.rows.iter().enumerate() {
        let [x, y] = row.position_m;
        let speed = row.velocity_mps[0].hypot(row.velocity_mps[1]);
        let leader = row.leader().map_or("-".to_owned(), |leader| leader.to_string());
        let phase = if row.alive() { row.phase().name() } else { "dead" };
        let (group, energy, step) = (row.group.to_string(), row.energy_j / 1e3, f64::from(row.step_ns) / 1e3);
        lines.push(plain(format!(
            "{drone:>6}{x:>10.1}{y:>10.1}{speed:>9.2}{group:>10}{leader:>8}{energy:>12.3}{phase:>8}{step:>9.0}"
        )));
    }
    lines
}
