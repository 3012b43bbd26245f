//! The pilots of the test application.

use skein::{App, Birth, Command, Inbox, Out, Pilot, PilotError, Senses};

/// The application.
pub(crate) fn app() -> App {
    App::new()
        .json_topic("drift", r#"{"type": "object", "properties": {"gain": {"type": "number"}}}"#)
        .try_pilot("drift", |birth| Ok(Box::new(Drift::new(birth)?)))
        .pilot("loud", |_| Box::new(Loud))
        .try_pilot("clumsy", |birth| Ok(Box::new(Clumsy::new(birth)?)))
}

/// Flies towards the middle of its neighbours.
struct Drift {
    gain_per_s: f64,
}

impl Drift {
    fn new(birth: &Birth) -> Result<Self, PilotError> {
        let gain_per_s = birth.params.get_f64("gain_per_s", 0.1)?;
        if gain_per_s < 0.0 {
            return Err(PilotError::of_param("gain_per_s", format!("expected a number from 0, found {gain_per_s}")));
        }
        Ok(Self { gain_per_s })
    }
}

impl Pilot for Drift {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
        out.metric("gain", self.gain_per_s);
        out.say("drift", format!("{{\"gain\": {}}}", self.gain_per_s));
        out.mark("here", senses.position_m);
        out.line("home", senses.position_m, [0.0; 3]);
        let share = self.gain_per_s / senses.neighbours.len().max(1) as f64;
        let mut velocity_mps = [0.0; 3];
        for neighbour in senses.neighbours {
            velocity_mps.iter_mut().zip(neighbour.position_m).for_each(|(mps, m)| *mps += share * m);
        }
        Command::velocity(velocity_mps)
    }
}

/// Prints something in every step.
struct Loud;

impl Pilot for Loud {
    fn step(&mut self, _: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        println!("{{ this is not the summary");
        Command::default()
    }
}

/// Makes a mistake after half a second.
struct Clumsy {
    how: String,
    forked: bool,
}

impl Clumsy {
    fn new(birth: &Birth) -> Result<Self, PilotError> {
        let how = birth.params.get_str("how", "")?.to_owned();
        match how.as_str() {
            "fork at birth" => _ = fork(),
            "exit at birth" => std::process::exit(7),
            _ => {}
        }
        Ok(Self { how, forked: false })
    }
}

/// Forks this process. Returns whether this is the forked one.
#[allow(unsafe_code, reason = "the system's call is unsafe")]
fn fork() -> bool {
    // SAFETY: what the forked process does until it is ended is what the test is about.
    let pid = unsafe { libc::fork() };
    assert!(pid >= 0);
    pid == 0
}

impl Pilot for Clumsy {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
        if senses.now_s < 0.5 {
            return Command::default();
        }
        match self.how.as_str() {
            "panic" => panic!("it has stumbled"),
            "nan" => return Command::acceleration([f64::NAN, 0.0, 0.0]),
            "flood" => (0..65).for_each(|_| out.say("gossip", b"hello")),
            "oversize" => out.say("gossip", [0; 273]),
            "say" => out.fail("it gives up"),
            "fork" if !std::mem::replace(&mut self.forked, true) => _ = fork(),
            "fork and exit" if !std::mem::replace(&mut self.forked, true) && fork() => std::process::exit(7),
            "exit" => std::process::exit(7),
            "abort" => std::process::abort(),
            "hang" => {
                eprintln!("it hangs");
                loop {
                    std::thread::sleep(std::time::Duration::from_secs(1));
                }
            }
            _ => {}
        }
        Command::default()
    }
}
