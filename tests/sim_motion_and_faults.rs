//! Simulated Dynamixel servos in virtual time: motion, watchdog, injected faults, determinism.

#[path = "support/sim_host.rs"]
mod sim_host;

use handwave::base::{Clock, Time};
use handwave::bus::{Port, PortError};
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, Servo};
use handwave_dynamixel::instruction::Instruction;
use sim_host::Host;
use std::time::Duration;

#[test]
fn a_step_stays_inside_the_profile_and_settles_without_overshoot() {
    let mut host = Host::new(1);
    let (velocity, acceleration) = (100, 20);
    host.write_u32(1, 108, acceleration);
    host.write_u32(1, 112, velocity);
    host.write(1, 64, &[1]);
    host.sync_goals(&[(1, 3072)]);
    let limit_rad_s = f64::from(velocity) * 0.229 * std::f64::consts::TAU / 60.0;
    let limit_rad_s2 = f64::from(acceleration) * 214.577 * std::f64::consts::TAU / 3600.0;
    let (mut fastest, mut steepest, mut highest, mut last) = (0.0f64, 0.0f64, 0.0f64, 0.0);
    for _ in 0..400 {
        host.wait(0.01);
        let (speed, pulses) = {
            let line = host.line.lock();
            let servo = line.servo(1).expect("on the line");
            (servo.speed_rad_s(), servo.position_pulses())
        };
        fastest = fastest.max(speed);
        steepest = steepest.max((speed - last).abs() / 0.01);
        highest = highest.max(pulses);
        last = speed;
    }
    let end = host.pulses(1);
    assert!(
        fastest < limit_rad_s * 1.02,
        "{fastest:.3} rad/s of {limit_rad_s:.3}"
    );
    assert!(
        steepest < limit_rad_s2 * 1.1,
        "{steepest:.2} rad/s^2 of {limit_rad_s2:.2}"
    );
    assert!(highest < 3072.0 + 4.0, "overshoot to {highest:.1}");
    assert!((end - 3072.0).abs() < 5.0, "settled at {end:.1}");
}

#[test]
fn a_goal_stream_at_200_hz_is_followed_20_to_40_ms_behind() {
    let mut host = Host::new(1);
    host.write(1, 64, &[1]);
    // 1 Hz, 0.5 rad: 3.1 rad/s at most, about half of what the motor can do.
    let goal_at = |t: f64| {
        2048.0 + 0.5 / (std::f64::consts::TAU / 4096.0) * (std::f64::consts::TAU * t).sin()
    };
    let mut trace = Vec::new();
    let start = host.clock.now();
    for k in 0..600 {
        let t = f64::from(k) * 0.005;
        host.clock.sleep_until(start + Duration::from_secs_f64(t));
        host.sync_goals(&[(1, goal_at(t).round() as i32)]);
        host.line.lock().advance(host.clock.now());
        trace.push((t, host.pulses(1)));
    }
    let error_at = |lag: f64| {
        let settled = trace.iter().filter(|(t, _)| *t > 1.0);
        settled
            .map(|(t, p)| (p - goal_at(t - lag)).powi(2))
            .sum::<f64>()
    };
    let lag_ms = (0..100)
        .min_by(|a, b| error_at(f64::from(*a) * 1e-3).total_cmp(&error_at(f64::from(*b) * 1e-3)))
        .expect("a range");
    let rms = (error_at(f64::from(lag_ms) * 1e-3) / 400.0).sqrt();
    assert!((20..=40).contains(&lag_ms), "lag {lag_ms} ms");
    assert!(rms < 15.0, "beside the lag {rms:.1} pulses rms");
}

#[test]
fn a_push_from_outside_moves_the_shaft_as_far_as_the_gain_lets_it() {
    let mut host = Host::new(1);
    host.write(1, 64, &[1]);
    host.wait(0.1);
    host.line
        .lock()
        .servo_mut(1)
        .expect("on the line")
        .set_external_torque(-0.3);
    host.wait(1.0);
    let sag = 2048.0 - host.pulses(1);
    // 0.3 of 1.4 N m is 21 % duty; the default gain gives 0.72 % a pulse.
    assert!((20.0..35.0).contains(&sag), "sagged {sag:.1} pulses");
    let load = host.read(1, 126, 2).data;
    let load = i16::from_le_bytes([load[0], load[1]]);
    assert!((180..250).contains(&load), "load {load} of 1000");
}

#[test]
fn the_watchdog_stops_the_motion_locks_the_goals_and_is_cleared_by_zero() {
    for (defect, stops) in [(false, true), (true, false)] {
        let mut host = Host::new(1);
        if defect {
            host = host.fault("1:watchdog-defect@0s");
        }
        host.write(1, 11, &[1]);
        host.write(1, 98, &[5]);
        host.write(1, 64, &[1]);
        host.write_u32(1, 104, 100);
        host.wait(0.05);
        let speed = host.read_i32(1, 128);
        assert!((95..=105).contains(&speed), "turns at {speed}");
        host.wait(0.3);
        assert_eq!(host.read(1, 98, 1).data, [0xFF]);
        let speed = host.read_i32(1, 128);
        assert_eq!(speed == 0, stops, "speed {speed} after the trip");
        assert_eq!(host.read(1, 64, 1).data, [1], "torque stays on");
        assert_eq!(host.write_u32(1, 104, 50), 4, "goals are locked");
        assert_eq!(host.write(1, 98, &[0]), 0);
        assert_eq!(host.write_u32(1, 104, 50), 0);
    }
}

#[test]
fn hardware_errors_latch_until_a_reboot() {
    let mut host = Host::new(1).fault("1:overload@0.3s..0.4s");
    host.write(1, 64, &[1]);
    assert!(!host.read(1, 70, 1).alert);
    host.wait(0.5);
    let error = host.read(1, 70, 1);
    assert_eq!((error.alert, error.error), (true, 0), "alert is no error");
    assert_eq!(error.data, [0x20]);
    assert_eq!(host.read(1, 64, 1).data, [0], "shut down");
    host.write(1, 64, &[1]);
    assert_eq!(host.read(1, 64, 1).data, [0], "still shut down");
    host.tell(1, Instruction::Reboot);
    host.wait(0.3);
    host.write(1, 64, &[1]);
    let torque = host.read(1, 64, 1);
    assert_eq!((torque.alert, torque.data), (false, vec![1]));
}

#[test]
fn an_error_outside_the_shutdown_mask_only_alerts() {
    let mut host = Host::new(1).fault("1:voltage=5.5@0.1s");
    host.write(1, 64, &[1]);
    host.wait(0.2);
    let voltage = host.read(1, 144, 2);
    assert_eq!((voltage.alert, voltage.data), (true, vec![55, 0]));
    assert_eq!(host.read(1, 64, 1).data, [1]);
}

#[test]
fn a_brown_out_loses_torque_and_a_blocked_shaft_stays() {
    let mut host = Host::new(2)
        .fault("1:reboot@0.5s")
        .fault("2:stuck@0s..1.5s");
    host.write(1, 64, &[1]);
    host.write(2, 64, &[1]);
    host.write_u32(2, 116, 1000);
    host.wait(0.35);
    assert_eq!(host.tell(1, Instruction::Ping), [], "booting");
    host.wait(0.3);
    assert_eq!(host.read(1, 64, 1).data, [0]);
    assert_eq!(host.pulses(2), 2048.0);
    host.wait(1.5);
    let freed = host.pulses(2);
    assert!((freed - 1000.0).abs() < 5.0, "freed, it went to {freed:.1}");
}

#[test]
fn damage_on_the_wire_shows_as_damage() {
    for (spec, expected_good) in [
        ("1:corrupt@0s", 0),
        ("bus:truncated=1@0s", 0),
        ("bus:noise=6@0s", 20),
        ("bus:duplicated=1@0s", 40),
        ("bus:foreign=1@0s", 40),
    ] {
        let mut host = Host::new(1).fault(spec);
        let mut good = 0;
        for _ in 0..20 {
            good += host.tell(1, Instruction::Ping).len();
        }
        assert_eq!(good, expected_good, "{spec}");
    }
    let mut host = Host::new(1).fault("bus:corrupt=0.3@0s");
    let good: usize = (0..200)
        .map(|_| host.tell(1, Instruction::Ping).len())
        .sum();
    // Both ways unharmed: 0.7 x 0.7.
    assert!((70..130).contains(&good), "{good} of 200 good");
}

#[test]
fn a_late_servo_is_late_and_an_early_host_collides_with_it() {
    let mut host = Host::new(1).fault("1:late=8@0s");
    let start = host.clock.now();
    host.tell(1, Instruction::Ping);
    let mut buf = [0; 64];
    let mut ping = [0; 16];
    let bytes = Instruction::Ping.encode(1, &mut ping).expect("room");
    let sent = host.clock.now();
    host.port.write_all(bytes).expect("a port that is there");
    let read = host.port.read(&mut buf, 14, sent + Duration::from_secs(1));
    assert_eq!(read.expect("a port that is there"), 14);
    let took_us = host.clock.now().secs_since(sent) * 1e6;
    assert!((took_us - 8240.0).abs() < 1.0, "{took_us:.1} us");
    assert!(start < sent);
    // A host that speaks into the answer.
    host.port.write_all(bytes).expect("a port that is there");
    host.clock
        .sleep_until(host.clock.now() + Duration::from_micros(8150));
    host.port.write_all(bytes).expect("a port that is there");
    assert_eq!(host.answers(), [], "both frames are damaged");
}

#[test]
fn an_unplugged_adapter_is_an_error_and_comes_back() {
    let mut host = Host::new(1).fault("bus:unplugged@0.1s..0.2s");
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
    host.wait(0.06);
    assert!(matches!(
        host.port.write_all(&[0]),
        Err(PortError::Gone { .. })
    ));
    host.wait(0.1);
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
    let mut host = Host::new(1).fault("bus:unplugged@0.1s");
    let waited = host.port.read(&mut [0; 4], 4, Time::from_secs(5.0));
    assert!(matches!(waited, Err(PortError::Gone { .. })));
    let gone_at = host.clock.now().secs();
    assert!((gone_at - 0.1).abs() < 1e-6, "noticed at {gone_at:.3} s");
}

#[test]
fn two_servos_of_one_id_damage_each_other() {
    let mut line = Line::new(LineOptions::default());
    line.attach(1, Servo::commissioned(&XL430_W250, 5, 3));
    line.attach(2, Servo::commissioned(&XL430_W250, 5, 3));
    let mut host = Host::on(line);
    assert_eq!(host.tell(5, Instruction::Ping), []);
    assert!(host.line.lock().set_plugged(2, false, Time::from_secs(1.0)));
    host.wait(1.0);
    assert_eq!(host.tell(5, Instruction::Ping).len(), 1);
}

#[test]
fn the_same_run_gives_the_same_bytes_at_the_same_times() {
    let run = || {
        let mut host = Host::new(6)
            .fault("bus:corrupt=0.1@0s")
            .fault("3:late=2@0.05s..0.1s");
        let ids: Vec<u8> = (1..=6).collect();
        let mut log = Vec::new();
        for id in 1..=6 {
            host.send(
                Instruction::Write {
                    address: 64,
                    data: &[1],
                }
                .encode(id, &mut [0; 32])
                .expect("room"),
            );
            log.push((host.hear(), host.clock.now()));
        }
        for k in 0..100 {
            let goals: Vec<_> = ids.iter().map(|id| (*id, 2048 + k * 7)).collect();
            host.sync_goals(&goals);
            host.sync_read(true, &ids, 126, 10);
            let mut buf = [0; 256];
            let deadline = host.clock.now() + Duration::from_millis(5);
            let count = host.port.read(&mut buf, 92, deadline);
            let count = count.expect("a port that is there");
            log.push((buf[..count].to_vec(), host.clock.now()));
        }
        log
    };
    assert_eq!(run(), run());
}
