//! The control cycle allocates nothing after the first cycles, whatever happens on the line.
#![allow(unsafe_code)] // An allocator that counts can only be written as an unsafe trait.

use handwave::base::Time;
use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{ChainOptions, DynamixelChain, Master, MasterOptions, ServoSpec};
use handwave::bus::parallel::BusPart;
use handwave::bus::{ParallelBus, ServoBus};
use handwave::bus::{Port, PortError};
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static COUNT: Cell<u32> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if COUNTING.get() {
            COUNT.set(COUNT.get() + 1);
        }
        // SAFETY: the caller keeps the contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A port whose own allocations, those of the simulated servos, are not counted.
struct Uncounted(SimPort);

fn uncounted<T>(work: impl FnOnce() -> T) -> T {
    let was = COUNTING.replace(false);
    let result = work();
    COUNTING.set(was);
    result
}

impl Port for Uncounted {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn baud(&self) -> u32 {
        self.0.baud()
    }
    fn set_baud(&mut self, baud: u32) -> Result<(), PortError> {
        self.0.set_baud(baud)
    }
    fn now(&self) -> Time {
        self.0.now()
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        uncounted(|| self.0.write_all(bytes))
    }
    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError> {
        uncounted(|| self.0.read(buf, want, deadline))
    }
    fn discard_input(&mut self) -> Result<(), PortError> {
        uncounted(|| self.0.discard_input())
    }
}

#[test]
fn a_cycle_allocates_nothing() {
    COUNTING.set(true);
    drop(std::hint::black_box(vec![0u8; 8]));
    COUNTING.set(false);
    assert_eq!(COUNT.replace(0), 1, "the allocator does not count");

    let clock = VirtualClock::new();
    let line = Line::commissioned(&XL430_W250, 1..=12, 1_000_000, LineOptions::default());
    let line = SharedLine::new(line.expect("a known rate"));
    let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
    let master = Master::new(Box::new(Uncounted(port)), MasterOptions::default());
    let model = Model::by_name("xl430-w250").expect("a known model");
    let specs = (1..=12)
        .map(|id| ServoSpec::new(id, format!("joint{id}"), model))
        .collect();
    let mut chain = DynamixelChain::new(Box::new(master), specs, ChainOptions::default())
        .expect("sensible specs");
    let mut states = [JointState::default(); 12];
    chain.prepare(&mut states).expect("a healthy chain");
    chain.arm().expect("a healthy chain");
    // A servo falls silent and comes back, another reboots, the line is noisy.
    let now_s = clock.now().secs();
    for fault in [
        format!("3:silent@{}s..{}s", now_s + 1.0, now_s + 2.0),
        format!("7:reboot@{}s", now_s + 3.0),
        format!("bus:corrupt=0.02@{}s", now_s + 4.0),
    ] {
        let fault = fault.parse().expect("a good specification");
        line.lock().inject(fault).expect("a servo of the line");
    }
    for cycle in 0..1200 {
        let next = clock.now() + Duration::from_millis(5);
        COUNTING.set(cycle >= 2);
        let outcome = chain.exchange(&[0.1; 12], &mut states);
        COUNTING.set(false);
        outcome.expect("the bus is there");
        assert_eq!(COUNT.get(), 0, "allocations up to cycle {cycle}");
        clock.sleep_until(next);
    }
}

#[test]
fn a_cycle_over_two_buses_allocates_nothing() {
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock::new());
    let model = Model::by_name("xl430-w250").expect("a known model");
    let part = |name: &str| {
        let line = Line::commissioned(&XL430_W250, 1..=6, 1_000_000, LineOptions::default());
        let line = SharedLine::new(line.expect("a known rate"));
        let branch = clock.branch().expect("virtual time");
        let port = SimPort::new(line, Arc::new(branch.clone()), 1_000_000);
        let master = Master::new(Box::new(Uncounted(port)), MasterOptions::default());
        let specs = (1..=6).map(|id| ServoSpec::new(id, format!("{name}{id}"), model));
        let chain = DynamixelChain::new(Box::new(master), specs.collect(), Default::default());
        BusPart {
            name: name.to_owned(),
            bus: Box::new(chain.expect("sensible specs")),
            branch: Some(branch),
        }
    };
    let parts = vec![part("left"), part("right")];
    let joints: Vec<String> = parts.iter().flat_map(|p| p.bus.joints().to_vec()).collect();
    let mut bus = ParallelBus::new(joints, parts, Arc::clone(&clock), || {}).expect("two buses");
    let mut states = [JointState::default(); 12];
    bus.prepare(&mut states).expect("healthy chains");
    bus.arm().expect("healthy chains");
    for cycle in 0..200 {
        let next = clock.now() + Duration::from_millis(5);
        COUNTING.set(cycle >= 2);
        let outcome = bus.exchange(&[0.1; 12], &mut states);
        COUNTING.set(false);
        assert_eq!(outcome.expect("the buses are there").fresh, 12);
        assert_eq!(COUNT.get(), 0, "allocations up to cycle {cycle}");
        clock.sleep_until(next);
    }
}
