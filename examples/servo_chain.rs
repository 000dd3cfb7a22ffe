//! A chain of servos driven from a program of your own: every joint holds the position it was found at.
//!
//! `cargo run --release --example servo_chain -- dynamixel:/tmp/servos@1000000 12 5` drives servos 1 to 12 for 5 s at
//! 200 Hz and prints what the cycles were like, apart for those in which all answered and those in which some were
//! silent. Torque is on meanwhile, and off again afterwards.

use handwave::base::{Clock, JointState};
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{self, ChainOptions, DynamixelChain, ServoSpec, Speaks};
use handwave::bus::port::bare;
use handwave::bus::{BusAddress, ServoBus};
use handwave::live::RealClock;
use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

const PERIOD: Duration = Duration::from_millis(5);

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(bus), Some(servos), Some(seconds)) = (args.next(), args.next(), args.next()) else {
        return Err("usage: servo_chain BUS SERVOS SECONDS".into());
    };
    let BusAddress::Dynamixel {
        path,
        baud,
        backend,
    } = bus.parse()?
    else {
        return Err("expected a bus such as dynamixel:/dev/ttyUSB0@1000000".into());
    };
    let clock = Arc::new(RealClock::new());
    let client = dynamixel::open(
        &path,
        baud,
        backend,
        Speaks::default(),
        clock.clone(),
        &mut bare,
    )?;
    let model = Model::by_name("xl430-w250").ok_or("a model this library does not know")?;
    let servos: u8 = servos.parse()?;
    let specs = (1..=servos).map(|id| ServoSpec::new(id, format!("joint{id}"), model));
    let options = ChainOptions {
        bus,
        cycle_budget: PERIOD,
        ..ChainOptions::default()
    };
    let mut chain = DynamixelChain::new(client, specs.collect(), options)?;

    let mut states = vec![JointState::default(); usize::from(servos)];
    chain.prepare(&mut states)?;
    chain.arm()?;
    let mut targets = vec![0.0; usize::from(servos)];
    chain.goals(&mut targets);

    let end = clock.now() + Duration::from_secs_f64(seconds.parse()?);
    let (mut whole, mut partial) = (Cycles::default(), Cycles::default());
    while clock.now() < end {
        let next = clock.now() + PERIOD;
        let report = chain.exchange(&targets, &mut states)?;
        let kind = match report.silent {
            0 => &mut whole,
            _ => &mut partial,
        };
        kind.add(report.fresh, report.cycle_us);
        clock.sleep_until(next);
    }
    chain.torque_off()?;
    whole.print("all answered");
    partial.print("some silent");
    Ok(())
}

/// Cycles of one kind.
#[derive(Default)]
struct Cycles {
    count: u32,
    fresh: u32,
    least: Option<u16>,
    first_us: Option<u32>,
    times_us: Vec<u32>,
}

impl Cycles {
    fn add(&mut self, fresh: u16, cycle_us: u32) {
        self.count += 1;
        self.fresh += u32::from(fresh);
        self.least = Some(self.least.map_or(fresh, |least| least.min(fresh)));
        self.first_us.get_or_insert(cycle_us);
        self.times_us.push(cycle_us);
    }

    fn print(mut self, name: &str) {
        self.times_us.sort_unstable();
        let Some(&median_us) = self.times_us.get(self.times_us.len() / 2) else {
            println!("{name}: no cycle");
            return;
        };
        println!(
            "{name}: {} cycles, values {:.2} a cycle, least {}, cycle median {median_us} us, first {} us",
            self.count,
            f64::from(self.fresh) / f64::from(self.count),
            self.least.unwrap_or(0),
            self.first_us.unwrap_or(0)
        );
    }
}
