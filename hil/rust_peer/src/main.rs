//! Exercises servos 1 to 12 at PORT with the crate `rustypot`: `rust_peer PORT`. Exit code 0 when all agree.

use rustypot::DynamixelProtocolHandler;
use std::error::Error;
use std::process::ExitCode;
use std::thread::sleep;
use std::time::{Duration, Instant};

const TORQUE_ENABLE: u8 = 64;
const LED: u8 = 65;
const GOAL_POSITION: u8 = 116;
const PRESENT_POSITION: u8 = 132;
const BAUD: u32 = 1_000_000;
const TIMEOUT: Duration = Duration::from_millis(50);

fn check(failures: &mut u32, what: &str, ok: bool, found: &dyn std::fmt::Debug) {
    *failures += u32::from(!ok);
    println!("{} {what} {found:?}", if ok { "ok  " } else { "FAIL" });
}

fn position(bytes: &[u8]) -> i32 {
    bytes.try_into().map_or(-1, i32::from_le_bytes)
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: rust_peer PORT")?;
    let mut port = serialport::new(path, BAUD).timeout(TIMEOUT).open()?;
    let port = port.as_mut();
    let peer = DynamixelProtocolHandler::v2();
    let ids: Vec<u8> = (1..=12).collect();
    let mut failures = 0;
    let failed = &mut failures;

    let found = peer.ping(port, 3);
    check(failed, "ping 3", matches!(found, Ok(true)), &found);
    let found = peer.broadcast_ping(port);
    let all = found.as_ref().is_ok_and(|found| {
        let mut found = found.clone();
        found.sort_unstable();
        found == ids
    });
    check(failed, "broadcast ping", all, &found);
    let found = peer.read(port, 5, PRESENT_POSITION, 4);
    let there = found.as_ref().is_ok_and(|bytes| position(bytes) == 2048);
    check(failed, "read", there, &found);
    let done = peer.write(port, 5, LED, &[1]);
    check(failed, "write", done.is_ok(), &done);
    let refused = peer.write_with_error(port, 5, LED, &[7]);
    let four = refused
        .as_ref()
        .is_ok_and(|error| error.v2_instruction_error() == 4);
    check(failed, "write out of range is refused with error 4", four, &refused);

    for &id in &ids {
        peer.write(port, id, TORQUE_ENABLE, &[1])?;
    }
    let goal = |id: u8| 2048 + 20 * i32::from(id);
    let goals: Vec<Vec<u8>> = ids.iter().map(|&id| goal(id).to_le_bytes().to_vec()).collect();
    let done = peer.sync_write(port, &ids, GOAL_POSITION, &goals);
    check(failed, "sync write", done.is_ok(), &done);
    let fast_peer = DynamixelProtocolHandler::v2().with_fast_sync_read();
    for (name, reader) in [("sync read", &peer), ("fast sync read", &fast_peer)] {
        let deadline = Instant::now() + Duration::from_secs(2);
        let mut arrived = false;
        let mut positions = Vec::new();
        while !arrived && Instant::now() < deadline {
            let read = reader.sync_read(port, &ids, PRESENT_POSITION, 4)?;
            positions = read.iter().map(|bytes| position(bytes)).collect();
            arrived = positions.len() == ids.len()
                && positions.iter().zip(&ids).all(|(at, &id)| (at - goal(id)).abs() < 5);
        }
        check(failed, &format!("{name} sees all goals reached"), arrived, &positions);
    }

    let done = peer.reboot(port, 7);
    check(failed, "reboot", done.is_ok(), &done);
    sleep(Duration::from_millis(500));
    let torque = peer.read(port, 7, TORQUE_ENABLE, 1);
    let off = torque.as_ref().is_ok_and(|torque| torque == &[0]);
    check(failed, "back within 0.5 s, torque off", off, &torque);

    let cycles = 200;
    let start = Instant::now();
    let mut bad = 0;
    for _ in 0..cycles {
        bad += u32::from(fast_peer.sync_read(port, &ids, PRESENT_POSITION, 4).is_err());
    }
    let each_ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(cycles);
    let what = format!("{cycles} fast sync reads of 12 without error, {each_ms:.2} ms each");
    check(failed, &what, bad == 0, &bad);
    Ok(ExitCode::from(u8::from(failures > 0)))
}
