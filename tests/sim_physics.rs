//! Simulated servos under load and with faults of their own: heat, overload, supply, encoders, watchdogs.

#[path = "support/sim_host.rs"]
mod sim_host;

use handwave::base::{Clock, Time};
use handwave::bus::{Port, PortError};
use handwave::sim::{LineOptions, SimPort};
use handwave_dynamixel::instruction::Instruction;
use sim_host::Host;
use std::sync::Arc;
use std::time::Duration;

fn push(host: &Host, id: u8, torque_nm: f64) {
    let mut line = host.line.lock();
    line.servo_mut(id)
        .expect("on the line")
        .set_external_torque(torque_nm);
}

/// Hardware error, temperature (degrees) and voltage (0.1 V) as read over the wire.
fn felt(host: &mut Host, id: u8) -> (u8, u8, u16) {
    let error = host.read(id, 70, 1).data[0];
    let rest = host.read(id, 144, 3).data;
    (error, rest[2], u16::from_le_bytes([rest[0], rest[1]]))
}

#[test]
fn a_robot_that_stands_for_ten_minutes_stays_cool_and_on() {
    let mut host = Host::new(12);
    for id in 1..=12 {
        host.write(id, 64, &[1]);
        // A fifth of the stall torque, the most that the vendor advises for continuous use.
        push(&host, id, 0.28);
    }
    host.wait(600.0);
    for id in 1..=12 {
        let (error, celsius, decivolts) = felt(&mut host, id);
        assert_eq!(error, 0, "servo {id} at {celsius} degrees, {decivolts} dV");
        assert!((34..50).contains(&celsius), "servo {id}: {celsius} degrees");
        // Twelve holding a fifth draw about 1.2 A through 0.1 ohm.
        assert!(
            (108..111).contains(&decivolts),
            "servo {id}: {decivolts} dV"
        );
        assert_eq!(host.read(id, 64, 1).data, [1], "torque of servo {id}");
    }
}

#[test]
fn a_blocked_leg_trips_overload_in_seconds_and_a_free_one_does_not() {
    let mut host = Host::new(2).fault("1:stuck@0.5s");
    for id in [1, 2] {
        host.write(id, 64, &[1]);
    }
    host.wait(0.5);
    host.sync_goals(&[(1, 3000), (2, 3000)]);
    let mut tripped_s = None;
    for tenth in 1..=50 {
        host.wait(0.1);
        if tripped_s.is_none() && felt(&mut host, 1).0 == 0x20 {
            tripped_s = Some(0.1 * f64::from(tenth));
        }
    }
    let tripped_s = tripped_s.expect("overload within 5 s");
    assert!(
        (1.0..4.0).contains(&tripped_s),
        "overload after {tripped_s:.1} s"
    );
    assert_eq!(host.read(1, 64, 1).data, [0], "shut down");
    assert_eq!(felt(&mut host, 2).0, 0, "the other one went its way");
}

#[test]
fn a_strained_servo_grows_hot_until_its_temperature_limit_and_stays_latched_until_a_reboot() {
    let mut host = Host::new(1);
    // A limit near by, so that half the stall current reaches it; overload out of the shutdown mask.
    host.write(1, 31, &[45]);
    host.write(1, 63, &[0x04]);
    host.write(1, 64, &[1]);
    push(&host, 1, 0.7);
    let mut seconds = 0.0;
    while felt(&mut host, 1).0 & 0x04 == 0 && seconds < 600.0 {
        host.wait(1.0);
        seconds += 1.0;
    }
    let (error, celsius, _) = felt(&mut host, 1);
    assert!(
        (20.0..400.0).contains(&seconds),
        "{celsius} degrees after {seconds} s"
    );
    assert_eq!(
        (error & 0x04, host.read(1, 64, 1).data[0]),
        (0x04, 0),
        "overheating, torque off"
    );
    assert!((45..47).contains(&celsius), "{celsius} degrees");
    push(&host, 1, 0.0);
    host.wait(300.0);
    assert_eq!(
        felt(&mut host, 1).0 & 0x04,
        0x04,
        "cool again, and latched still"
    );
    host.tell(1, Instruction::Reboot);
    host.wait(0.3);
    assert_eq!(felt(&mut host, 1).0, 0);
}

#[test]
fn what_all_draw_lowers_the_supply_of_each() {
    let mut host = Host::new(12);
    let idle = felt(&mut host, 1).2;
    for id in 2..=12 {
        host.write(id, 63, &[0]);
        host.write(id, 11, &[16]);
        host.write(id, 64, &[1]);
        // Full drive against a shaft that cannot give way.
        let fault = format!("{id}:stuck@0s")
            .parse()
            .expect("a good specification");
        host.line.lock().inject(fault).expect("on the line");
    }
    host.wait(0.5);
    let strained = felt(&mut host, 1).2;
    // Eleven times 1.3 A through 0.1 ohm are 1.4 V, less as the voltage falls.
    let fell = idle - strained;
    assert!((10..=15).contains(&fell), "from {idle} to {strained} dV");
}

#[test]
fn a_sagging_supply_weakens_and_below_the_limit_it_is_an_error() {
    let mut host = Host::new(2).fault("1:sag=4@0s");
    for id in [1, 2] {
        host.write(id, 11, &[16]);
        host.write(id, 64, &[1]);
        host.write(id, 100, &885u16.to_le_bytes());
    }
    host.wait(1.0);
    let (weak, sound) = (host.read_i32(1, 128), host.read_i32(2, 128));
    let share = f64::from(weak) / f64::from(sound);
    // Speed goes with voltage: 7.1 of 11.1 V.
    assert!((0.6..0.67).contains(&share), "{weak} of {sound}");
    assert_eq!(felt(&mut host, 1).0, 0);
    let mut host = Host::new(1).fault("1:sag=5.5@0s");
    host.wait(0.1);
    assert_eq!(felt(&mut host, 1).0, 0x01, "5.6 V, the limit is 6.0");
}

#[test]
fn an_encoder_that_jumps_drives_the_shaft_and_a_frozen_one_does_not_tell() {
    let mut host = Host::new(1).fault("1:encoder-jump=200@0.5s..1.5s");
    host.write(1, 64, &[1]);
    host.wait(0.4);
    assert_eq!(host.read_i32(1, 132), 2048);
    // The jump itself, before the motor has answered it.
    host.clock.sleep_until(Time::from_secs(0.501));
    let jumped = host.read_i32(1, 132);
    assert!((2200..=2248).contains(&jumped), "jumped to {jumped}");
    host.wait(0.5);
    let settled = host.read_i32(1, 132);
    assert!((2040..=2056).contains(&settled), "driven back to {settled}");
    // The motor has to turn the whole jump back, and rests where friction holds it.
    host.wait(1.0);
    assert!(
        (host.pulses(1) - 2048.0).abs() < 10.0,
        "after it {}",
        host.pulses(1)
    );

    let mut host = Host::new(1).fault("1:frozen-position@0.5s..1.5s");
    host.write(1, 64, &[1]);
    host.read_i32(1, 132);
    host.wait(0.6);
    host.sync_goals(&[(1, 2500)]);
    host.wait(0.5);
    assert_eq!(host.read_i32(1, 132), 2048, "frozen");
    assert!(
        (host.pulses(1) - 2500.0).abs() < 5.0,
        "it went to {}",
        host.pulses(1)
    );
    host.wait(0.6);
    assert!((host.read_i32(1, 132) - 2500).abs() < 5, "thawed");
}

#[test]
fn a_noisy_encoder_shows_noise_and_holds_still() {
    let mut host = Host::new(1).fault("1:noise=40@0s");
    host.write(1, 64, &[1]);
    let seen: Vec<i32> = (0..100)
        .map(|_| {
            host.wait(0.005);
            host.read_i32(1, 132)
        })
        .collect();
    let (low, high) = (
        seen.iter().min().expect("some"),
        seen.iter().max().expect("some"),
    );
    assert!(
        (2008..2020).contains(low) && (2076..=2088).contains(high),
        "{low}..{high}"
    );
    assert_eq!(host.pulses(1), 2048.0);
}

#[test]
fn a_deaf_servo_answers_and_obeys_nothing_and_one_that_refuses_says_so() {
    let mut host = Host::new(1)
        .fault("1:deaf@0s..0.5s")
        .fault("1:refuses=3@0.5s..1s");
    assert_eq!(host.write(1, 65, &[1]), 0);
    assert_eq!(host.read(1, 65, 1).data, [0], "the LED stays dark");
    host.wait(0.5);
    assert_eq!(host.write(1, 65, &[1]), 3);
    let refused = host.read(1, 65, 1);
    assert_eq!((refused.error, refused.data), (3, vec![]));
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
    host.wait(0.5);
    assert_eq!(host.write(1, 65, &[1]), 0);
    assert_eq!(host.read(1, 65, 1).data, [1]);
}

#[test]
fn torque_can_be_lost_without_a_restart_and_a_watchdog_can_trip_without_cause() {
    let mut host = Host::new(2)
        .fault("1:torque-loss@0.5s")
        .fault("2:watchdog-trip@0.5s");
    for id in [1, 2] {
        host.write_u32(id, 112, 77);
        host.write(id, 64, &[1]);
    }
    host.wait(0.6);
    let lost = host.read(1, 64, 1);
    assert_eq!((lost.alert, lost.data), (false, vec![0]));
    assert_eq!(host.read_i32(1, 112), 77, "RAM is kept");
    assert_eq!(host.read(2, 98, 1).data, [0xFF]);
    assert_eq!(host.write_u32(2, 116, 2100), 4, "goals are locked");
    assert_eq!(host.read(2, 64, 1).data, [1], "it holds");
}

#[test]
fn a_watchdog_that_takes_the_homing_offset_twice_runs_off() {
    // In extended mode by its homing offset, in position mode no further than its limits.
    for (mode, offset, expected) in [
        (4, 700, 2048 + 700 + 700),
        (4, 0, 2048 + 1000),
        (3, 0, 3000),
    ] {
        let mut host = Host::new(1).fault("1:watchdog-runaway@0s");
        host.write(1, 11, &[mode]);
        host.write_u32(1, 20, offset);
        host.write_u32(1, 48, 3000);
        host.write(1, 98, &[5]);
        host.write(1, 64, &[1]);
        host.wait(2.0);
        assert_eq!(host.read(1, 98, 1).data, [0xFF], "tripped");
        let pulses = host.pulses(1);
        assert!(
            (pulses - f64::from(expected)).abs() < 6.0,
            "mode {mode}, offset {offset}: stands at {pulses:.0}, expected {expected}"
        );
    }
}

#[test]
fn replies_can_be_cut_doubled_garbled_and_under_another_id() {
    for (fault, ids) in [
        ("truncated", &[][..]),
        ("duplicated", &[1, 1]),
        ("duplicate-id", &[]),
        ("wrong-id", &[252]),
        ("wrong-id=9", &[9]),
    ] {
        let mut host = Host::new(2).fault(&format!("1:{fault}@0s"));
        let seen: Vec<u8> = host
            .tell(1, Instruction::Ping)
            .iter()
            .map(|a| a.id)
            .collect();
        assert_eq!(seen, ids, "{fault}");
        host.wait(0.02);
        assert_eq!(
            host.tell(2, Instruction::Ping).len(),
            1,
            "{fault}: the other one"
        );
    }
}

#[test]
fn an_adapter_keeps_bytes_back_for_a_while_and_loses_some() {
    let mut host = Host::new(1)
        .fault("bus:latency@0.5s..1s")
        .fault("bus:lost-bytes=0.05@2s..3s");
    let took_us = |host: &mut Host| {
        let mut ping = [0; 16];
        let bytes = Instruction::Ping.encode(1, &mut ping).expect("room");
        let start = host.clock.now();
        host.port.write_all(bytes).expect("a port that is there");
        let read = host
            .port
            .read(&mut [0; 14], 14, start + Duration::from_secs(1));
        assert_eq!(read.expect("a port that is there"), 14);
        (host.clock.now().secs_since(start) * 1e6).round() as i64
    };
    assert_eq!(took_us(&mut host), 240);
    host.wait(0.6);
    assert_eq!(took_us(&mut host), 16_240);
    host.wait(0.5);
    assert_eq!(took_us(&mut host), 240);
    host.wait(1.0);
    let good: usize = (0..16).map(|_| host.tell(1, Instruction::Ping).len()).sum();
    // 14 bytes get through with probability 0.95^14 = 0.49.
    assert!((2..15).contains(&good), "{good} of 16 whole");
}

#[test]
fn an_adapter_comes_back_under_another_name_and_the_old_port_stays_dead() {
    let mut host = Host::with(1, LineOptions::default()).fault("bus:unplugged=2@0.1s..0.2s");
    assert_eq!(host.port.name(), "sim");
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
    host.wait(0.2);
    let dead = host.port.write_all(&[0]);
    assert!(matches!(dead, Err(PortError::Gone { .. })), "{dead:?}");
    host.port = SimPort::new(host.line.clone(), Arc::new(host.clock.clone()), 1_000_000);
    assert_eq!(host.port.name(), "sim.2");
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
}

#[test]
fn a_brown_out_restarts_all() {
    let mut host = Host::new(3).fault("bus:brown-out@0.2s");
    for id in 1..=3 {
        host.write(id, 64, &[1]);
    }
    host.wait(0.1);
    assert_eq!(host.tell(1, Instruction::Ping), [], "booting");
    host.wait(0.3);
    for id in 1..=3 {
        assert_eq!(host.read(id, 64, 1).data, [0], "torque of servo {id}");
    }
}
