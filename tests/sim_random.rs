//! Whatever bytes come and whatever faults strike: the simulator does not panic, time runs on, and the same
//! seed gives the same bytes at the same times.

use handwave::base::{Clock, Time, VirtualClock};
use handwave::bus::Port;
use handwave::sim::fault::{FAULTS, FaultSpec, Scope};
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use handwave_dynamixel::FrameWriter;
use proptest::prelude::*;
use std::sync::Arc;
use std::time::Duration;

const SERVOS: u8 = 4;

/// What a host does next.
#[derive(Clone, Debug)]
enum Act {
    /// A well-formed frame: id, instruction, parameters.
    Frame(u8, u8, Vec<u8>),
    /// Bytes as they come.
    Bytes(Vec<u8>),
    /// Waits so many microseconds.
    Wait(u32),
    /// Reads up to so many bytes.
    Read(usize),
    Baud(u32),
}

fn any_fault() -> impl Strategy<Value = String> {
    let target = prop_oneof![Just(None), (1..=SERVOS).prop_map(Some)];
    (
        target,
        0..100_usize,
        0.0..=1.0_f64,
        0.0..0.3_f64,
        prop::option::of(0.001..0.3_f64),
    )
        .prop_map(|(target, pick, share, from_s, lasts_s)| {
            let scope = if target.is_some() {
                Scope::Servo
            } else {
                Scope::Bus
            };
            let rows: Vec<_> = FAULTS.iter().filter(|row| row.scope == scope).collect();
            let row = rows[pick % rows.len()];
            let target = target.map_or("bus".to_owned(), |id| id.to_string());
            let value = row.value.map_or(String::new(), |rule| {
                format!("={}", rule.min + share * (rule.max - rule.min))
            });
            let until = lasts_s.map_or(String::new(), |s| format!("..{}s", from_s + s));
            format!("{target}:{}{value}@{from_s}s{until}", row.name)
        })
}

fn any_act() -> impl Strategy<Value = Act> {
    let instruction = prop::sample::select(vec![
        0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x10, 0x20, 0x55, 0x82, 0x83, 0x8A, 0x92, 0x93,
        0x9A, 0x77,
    ]);
    let id = prop_oneof![4 => 0..=SERVOS, 2 => Just(254_u8), 1 => any::<u8>()];
    // Parameters that often name a register and a small length, else anything.
    let register = prop::sample::select(vec![
        7_u8, 8, 11, 20, 64, 68, 98, 100, 104, 108, 112, 116, 126, 132, 168, 224,
    ]);
    let sensible = (
        register,
        0..12_u8,
        prop::collection::vec(any::<u8>(), 0..24),
    )
        .prop_map(|(address, length, rest)| [vec![address, 0, length, 0], rest].concat());
    let params = prop_oneof![3 => sensible, 1 => prop::collection::vec(any::<u8>(), 0..40)];
    prop_oneof![
        6 => (id, instruction, params).prop_map(|(id, code, params)| Act::Frame(id, code, params)),
        1 => prop::collection::vec(any::<u8>(), 0..60).prop_map(Act::Bytes),
        3 => (0..30_000_u32).prop_map(Act::Wait),
        3 => (1..300_usize).prop_map(Act::Read),
        1 => prop::sample::select(vec![57_600_u32, 1_000_000, 4_500_000]).prop_map(Act::Baud),
    ]
}

/// Plays `acts` and returns what was read and when, and where the shafts are in the end.
fn play(
    faults: &[String],
    acts: &[Act],
    seed: u64,
    paced: bool,
) -> (Vec<(Time, Vec<u8>)>, Vec<f64>) {
    let options = LineOptions {
        paced,
        seed,
        ..LineOptions::default()
    };
    let mut line =
        Line::commissioned(&XL430_W250, 1..=SERVOS, 1_000_000, options).expect("a known rate");
    for spec in faults {
        let fault: FaultSpec = spec.parse().unwrap_or_else(|e| panic!("{e}"));
        line.inject(fault).expect("on the line");
    }
    let clock = VirtualClock::new();
    let line = SharedLine::new(line);
    let mut port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
    let mut heard = Vec::new();
    for act in acts {
        let before = clock.now();
        match act {
            Act::Frame(id, code, params) => {
                let mut buf = [0; 256];
                let mut writer = FrameWriter::new(&mut buf, *id, *code);
                writer.extend(params);
                if let Ok(bytes) = writer.finish() {
                    // A port that is unplugged says so; the host goes on.
                    let _unplugged = port.write_all(bytes);
                }
            }
            Act::Bytes(bytes) => {
                let _unplugged = port.write_all(bytes);
            }
            Act::Wait(us) => clock.sleep_until(before + Duration::from_micros(u64::from(*us))),
            Act::Read(want) => {
                let mut buf = vec![0; *want];
                let deadline = before + Duration::from_millis(5);
                if let Ok(count) = port.read(&mut buf, *want, deadline) {
                    assert!(clock.now() <= deadline, "read beyond its deadline");
                    heard.push((clock.now(), buf[..count].to_vec()));
                }
            }
            Act::Baud(baud) => port.set_baud(*baud).expect("a rate above zero"),
        }
        assert!(clock.now() >= before, "time ran backwards");
    }
    let end = clock.now() + Duration::from_millis(100);
    clock.sleep_until(end);
    let mut line = line.lock();
    line.advance(end);
    let shafts =
        (1..=SERVOS).map(|label| line.servo(label).expect("on the line").position_pulses());
    (heard, shafts.collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_bytes_and_any_faults_are_borne_and_repeat(
        faults in prop::collection::vec(any_fault(), 0..6),
        acts in prop::collection::vec(any_act(), 1..60),
        seed in any::<u64>(),
        paced in any::<bool>(),
    ) {
        let first = play(&faults, &acts, seed, paced);
        prop_assert!(first.1.iter().all(|pulses| pulses.is_finite()), "shafts at {:?}", first.1);
        let again = play(&faults, &acts, seed, paced);
        prop_assert_eq!(first, again);
    }
}
