//! The terminal display.

use super::display_state::DisplayState;
use super::swarm_view::SwarmView;
use crossterm::style::{Attribute, Print, SetAttribute};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
    disable_raw_mode, enable_raw_mode, size,
};
use crossterm::{cursor, execute, queue};
use skein_protocol::Phase;
use std::collections::BTreeMap;
use std::io::{Stdout, Write, stdout};

/// A line of the display.
pub(crate) struct Line {
    /// Its text.
    pub(crate) text: String,
    /// Whether it is bold: headings and the selected swarm.
    pub(crate) bold: bool,
}

fn plain(text: String) -> Line {
    Line { text, bold: false }
}

fn bold(text: String) -> Line {
    Line { text, bold: true }
}

/// The terminal in raw mode. Dropping this restores the terminal.
pub(crate) struct Screen(Stdout);

impl Screen {
    /// Switches the terminal to raw mode and to its alternate screen.
    pub(crate) fn open() -> std::io::Result<Self> {
        enable_raw_mode()?;
        // From here on, dropping it restores the terminal.
        let mut screen = Self(stdout());
        execute!(screen.0, EnterAlternateScreen, cursor::Hide)?;
        Ok(screen)
    }

    /// Shows the lines, cut to the size of the terminal.
    pub(crate) fn show(&mut self, lines: &[Line]) -> std::io::Result<()> {
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
        // If the terminal is gone, nothing can be restored.
        let _ = execute!(self.0, cursor::Show, LeaveAlternateScreen);
        let _ = disable_raw_mode();
    }
}

/// The lines of the display; `none` if there are no swarms.
pub(crate) fn page(swarms: &[SwarmView], shown: DisplayState, none: &str) -> Vec<Line> {
    let paused = if shown.paused { "  PAUSED" } else { "" };
    let mut lines = vec![plain(format!("skein top    up/down swarm   d drones   space pause   q quit{paused}"))];
    if swarms.is_empty() {
        lines.push(plain(none.to_owned()));
        return lines;
    }
    lines.push(bold(format!(
        "{:<28}{:>7}{:>9}{:>10}{:>8}{:>8}{:>10}{:>10}{:>10}{:>8}",
        "SWARM", "DRONES", "T (s)", "TICKS/s", "x REAL", "MIN m", "SENT/s", "HEARD/s", "DROP/s", "LOSS"
    )));
    let chosen = shown.chosen.min(swarms.len() - 1);
    for (place, view) in swarms.iter().enumerate() {
        let line = swarm(view);
        lines.push(if place == chosen { bold(line) } else { plain(line) });
    }
    lines.push(plain(String::new()));
    lines.extend(groups(&swarms[chosen]));
    if shown.drones {
        lines.push(plain(String::new()));
        lines.extend(drones(&swarms[chosen]));
    }
    lines
}

fn swarm(view: &SwarmView) -> String {
    let rates = view.rates;
    let alive = view.rows.iter().filter(|row| row.alive()).count();
    let least = view.separation_m.map_or("-".to_owned(), |m| format!("{m:.1}"));
    let all = rates.heard + rates.dropped;
    let loss = if all > 0.0 { format!("{:.1} %", 100.0 * rates.dropped / all) } else { "-".to_owned() };
    format!(
        "{:<28}{:>7}{:>9.1}{:>10.0}{:>8.1}{least:>8}{:>10.0}{:>10.0}{:>10.0}{loss:>8}",
        view.run.name(),
        format!("{alive}/{}", view.tap.facts.drones),
        view.t_s,
        rates.ticks,
        rates.real,
        rates.sent,
        rates.heard,
        rates.dropped,
    )
}

fn groups(view: &SwarmView) -> Vec<Line> {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (drone, row) in view.rows.iter().enumerate().filter(|(_, row)| row.alive()) {
        groups.entry(row.group.to_string()).or_default().push(drone);
    }
    let mut lines =
        vec![bold(format!("{:<12}{:>7}{:>10}{:>12}{:>12}", "GROUP", "DRONES", "LEADER", "SPEED m/s", "PHASE"))];
    for (group, members) in groups {
        let rows = || members.iter().map(|&drone| &view.rows[drone]);
        let leads = |drone: &&usize| view.rows[**drone].leads();
        let leaders: Vec<String> = members.iter().filter(leads).map(usize::to_string).collect();
        let speed = rows().map(|row| row.velocity_mps[0].hypot(row.velocity_mps[1])).sum::<f64>();
        let phase = rows().map(|row| row.phase()).max().map_or("-", Phase::name);
        let leader = if leaders.is_empty() { "-".to_owned() } else { leaders.join(",") };
        let (count, speed) = (members.len(), speed / members.len() as f64);
        lines.push(plain(format!("{group:<12}{count:>7}{leader:>10}{speed:>12.2}{phase:>12}")));
    }
    lines
}

fn drones(view: &SwarmView) -> Vec<Line> {
    let head = format!(
        "{:>6}{:>10}{:>10}{:>9}{:>10}{:>8}{:>12}{:>8}{:>9}",
        "DRONE", "x m", "y m", "m/s", "GROUP", "LEADER", "ENERGY kJ", "PHASE", "STEP us"
    );
    let mut lines = vec![bold(head)];
    for (drone, row) in view.rows.iter().enumerate() {
        let [x, y, _] = row.position_m;
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
