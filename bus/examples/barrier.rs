//! Measures the ticks per second of the barrier alone:
//! `cargo run --example barrier -- [DRONES] [TICKS] [block|yield] [auto|off]`.

use skein_bus::{
    Control, ControlSpec, DroneEndpoint, Patience, PinMode, TickOutcome, TickSignal, WaitMode, allowed_cores,
    pin_to_core,
};
use skein_protocol::slot::Slot;
use std::error::Error;
use std::process::{Child, Command};
use std::sync::Arc;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: usize| args.get(index).map_or(Ok(default), |text| text.parse());
    let pin = if args.get(3).is_some_and(|mode| mode == "off") { PinMode::Off } else { PinMode::Auto };
    if args.get(4).is_some_and(|role| role == "drone") {
        return drone(number(0, 0)? as i32, number(1, 0)?, pin);
    }
    let wait = if args.get(2).is_some_and(|mode| mode == "yield") { WaitMode::Yield } else { WaitMode::Block };
    let (drones, ticks) = (number(0, 8)?, number(1, 5000)? as u64);
    let cores = if pin == PinMode::Auto { allowed_cores()? } else { 1 };
    let world = Control::create(ControlSpec { drones, cores, per_process: 1, wait })?;
    let mut children = (0..drones).map(|id| start(&world, id, pin)).collect::<Result<Vec<_>, _>>()?;
    while (0..drones).any(|id| world.ready(id).is_none()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    pin_to_core(0, pin)?;
    let mut answers = vec![TickOutcome::Pending; drones];
    let start = Instant::now();
    for k in 0..ticks {
        world.open_tick(k)?;
        world.wait_done(k, Patience::For(Duration::from_secs(5)), &mut answers)?;
    }
    let span = start.elapsed().as_secs_f64();
    world.close();
    println!("{drones} drones, {wait:?}, pin {pin:?}: {:.0} ticks/s", ticks as f64 / span);
    for child in &mut children {
        child.wait()?;
    }
    Ok(())
}

fn start(world: &Control, id: usize, pin: PinMode) -> Result<Child, Box<dyn Error>> {
    let fd = world.fd().ok_or("the control segment has no file descriptor")?;
    let pin = if pin == PinMode::Auto { "auto" } else { "off" };
    let args = [fd.to_string(), id.to_string(), "-".to_owned(), pin.to_owned(), "drone".to_owned()];
    Ok(Command::new(std::env::current_exe()?).args(args).spawn()?)
}

fn drone(fd: i32, id: usize, pin: PinMode) -> Result<(), Box<dyn Error>> {
    let control = Arc::new(Control::attach(fd)?);
    pin_to_core(control.core_of(id), pin)?;
    let mut endpoint = DroneEndpoint::new(control, id)?;
    endpoint.announce(1);
    let parent = std::os::unix::process::parent_id();
    while let TickSignal::Tick(k) = endpoint.wait_tick(|| std::os::unix::process::parent_id() == parent) {
        endpoint.finish(k, &Slot::default());
    }
    Ok(())
}
