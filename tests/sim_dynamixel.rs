//! Simulated Dynamixel servos in virtual time: instructions, errors, wire times, motion, faults.

use handwave::base::{Clock, Time, VirtualClock};
use handwave::bus::{Port, PortError};
use handwave::sim::line::SharedLine;
use handwave::sim::table::XL430_W250;
use handwave::sim::{AfterSilence, Line, LineOptions, Servo, SimPort};
use handwave_dynamixel::instruction::{
    Backup, BulkReadEntry, BulkWriteEntry, FactoryReset, Instruction,
};
use handwave_dynamixel::{BROADCAST_ID, FrameParser, FrameWriter, Status, fast, lists};
use std::sync::Arc;
use std::time::Duration;

/// A host at one end of a line, and a hand on the clock.
struct Host {
    clock: VirtualClock,
    line: SharedLine,
    port: SimPort,
}

/// A status, taken apart.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    id: u8,
    alert: bool,
    error: u8,
    data: Vec<u8>,
}

impl Host {
    fn on(line: Line) -> Self {
        let clock = VirtualClock::new();
        let line = SharedLine::new(line);
        let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
        Self { clock, line, port }
    }

    fn with(servos: u8, options: LineOptions) -> Self {
        let line = Line::commissioned(&XL430_W250, 1..=servos, 1_000_000, options);
        Self::on(line.expect("a known rate"))
    }

    fn new(servos: u8) -> Self {
        Self::with(servos, LineOptions::default())
    }

    fn fault(self, spec: &str) -> Self {
        let fault = spec.parse().expect("a good specification");
        self.line.lock().inject(fault).expect("a servo of the line");
        self
    }

    fn wait(&self, seconds: f64) {
        let span = Duration::from_secs_f64(seconds);
        self.clock.sleep_until(self.clock.now() + span);
        self.line.lock().advance(self.clock.now());
    }

    fn send(&mut self, bytes: &[u8]) {
        self.port.write_all(bytes).expect("a port that is there");
    }

    /// Everything that arrives within 50 ms.
    fn hear(&mut self) -> Vec<u8> {
        let mut buf = [0; 4096];
        let deadline = self.clock.now() + Duration::from_millis(50);
        let count = self.port.read(&mut buf, 4096, deadline);
        buf[..count.expect("a port that is there")].to_vec()
    }

    fn answers(&mut self) -> Vec<Answer> {
        let mut parser = FrameParser::<4096>::new();
        parser.push(&self.hear());
        let mut answers = Vec::new();
        while let Some(frame) = parser.next_frame() {
            let status = Status::parse(&frame).expect("a status");
            answers.push(Answer {
                id: status.id,
                alert: status.alert,
                error: status.error.to_byte(),
                data: status.params.to_vec(),
            });
        }
        answers
    }

    fn tell(&mut self, id: u8, instruction: Instruction) -> Vec<Answer> {
        let mut buf = [0; 1024];
        let bytes = instruction.encode(id, &mut buf).expect("room").to_vec();
        self.send(&bytes);
        self.answers()
    }

    fn one(&mut self, id: u8, instruction: Instruction) -> Answer {
        let mut answers = self.tell(id, instruction);
        assert_eq!(answers.len(), 1, "{instruction:?}: {answers:?}");
        answers.remove(0)
    }

    fn write(&mut self, id: u8, address: u16, data: &[u8]) -> u8 {
        self.one(id, Instruction::Write { address, data }).error
    }

    fn write_u32(&mut self, id: u8, address: u16, value: i32) -> u8 {
        self.write(id, address, &value.to_le_bytes())
    }

    fn read(&mut self, id: u8, address: u16, length: u16) -> Answer {
        self.one(id, Instruction::Read { address, length })
    }

    fn read_i32(&mut self, id: u8, address: u16) -> i32 {
        let data = self.read(id, address, 4).data;
        i32::from_le_bytes(data.try_into().expect("four bytes"))
    }

    fn sync_read(&mut self, fast: bool, ids: &[u8], address: u16, length: u16) {
        let instruction = match fast {
            true => Instruction::FastSyncRead {
                address,
                length,
                ids,
            },
            false => Instruction::SyncRead {
                address,
                length,
                ids,
            },
        };
        let mut buf = [0; 512];
        let bytes = instruction.encode(BROADCAST_ID, &mut buf).expect("room");
        self.port.write_all(bytes).expect("a port that is there");
    }

    fn sync_goals(&mut self, goals: &[(u8, i32)]) {
        let mut buf = [0; 1024];
        let items = goals.iter().map(|(id, goal)| (*id, goal.to_le_bytes()));
        let bytes = lists::encode_sync_write(&mut buf, 116, 4, items).expect("room");
        self.port.write_all(bytes).expect("a port that is there");
    }

    fn pulses(&self, id: u8) -> f64 {
        self.line
            .lock()
            .servo(id)
            .expect("on the line")
            .position_pulses()
    }
}

#[test]
fn damaged_and_senseless_instructions_are_not_obeyed() {
    let mut host = Host::new(2);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 1, 3, 0, 1, 0x19, 0x4F]);
    assert_eq!(host.hear(), [], "a wrong checksum is not answered");
    host.send(&[0xFF; 300]);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 1, 0xFF, 0xFF]);
    assert_eq!(host.hear(), [], "garbage is not answered");
    host.wait(0.02);
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1, "after garbage");
    let mut buf = [0; 64];
    let unknown = FrameWriter::new(&mut buf, 1, 0x77).finish().expect("room");
    host.port.write_all(unknown).expect("a port that is there");
    assert_eq!(host.answers()[0].error, 2, "unknown instruction");
    assert_eq!(host.tell(9, Instruction::Ping), [], "nobody has id 9");
}

#[test]
fn single_instructions_answer_as_the_manual_says() {
    let mut host = Host::new(3);
    let ping = host.one(2, Instruction::Ping);
    assert_eq!(ping.data, [0x24, 0x04, 46], "model 1060, firmware 46");
    let ids: Vec<u8> = host
        .tell(BROADCAST_ID, Instruction::Ping)
        .iter()
        .map(|a| a.id)
        .collect();
    assert_eq!(ids, [1, 2, 3], "broadcast ping, in order of id");
    assert_eq!(host.read_i32(1, 132), 2048);
    assert_eq!(host.read(1, 200, 2).data.len(), 2);
    assert_eq!(host.read(1, 150, 4).error, 7, "unmapped");
    assert_eq!(host.write(1, 132, &[0; 4]), 7, "read-only");
    assert_eq!(host.write(1, 64, &[2]), 4, "range");
    assert_eq!(host.write(1, 116, &[0; 2]), 5, "length");
    assert_eq!(host.write_u32(1, 116, 4096), 6, "beyond the position limit");
    assert_eq!(host.write_u32(1, 104, 266), 6, "beyond the velocity limit");
    assert_eq!(host.write(1, 11, &[5]), 4, "a mode this model has not");
    assert_eq!(host.one(1, Instruction::Action).error, 2, "nothing held");
    let held = Instruction::RegWrite {
        address: 65,
        data: &[1],
    };
    assert_eq!(host.one(1, held).error, 0);
    assert_eq!(host.read(1, 69, 1).data, [1]);
    assert_eq!(host.read(1, 65, 1).data, [0], "held, not done");
    assert_eq!(host.one(1, Instruction::Action).error, 0);
    assert_eq!(host.read(1, 65, 1).data, [1]);
    assert_eq!(host.one(1, Instruction::ClearMultiTurn).error, 0);
    let read = Instruction::Read {
        address: 132,
        length: 4,
    };
    assert_eq!(host.tell(BROADCAST_ID, read), [], "broadcast read");
}

#[test]
fn eeprom_is_locked_while_torque_is_on() {
    let mut host = Host::new(1);
    assert_eq!(host.write(1, 64, &[1]), 0);
    assert_eq!(host.write(1, 9, &[250]), 7);
    assert_eq!(host.one(1, Instruction::Backup(Backup::Store)).error, 1);
    assert_eq!(host.write(1, 64, &[0]), 0);
    assert_eq!(host.write(1, 9, &[250]), 0);
    assert_eq!(host.read(1, 9, 1).data, [250]);
}

#[test]
fn status_return_level_decides_what_is_answered() {
    let mut host = Host::new(1);
    assert_eq!(host.write(1, 68, &[1]), 0, "answered at the old level");
    let led = Instruction::Write {
        address: 65,
        data: &[1],
    };
    assert_eq!(host.tell(1, led), []);
    assert_eq!(host.read(1, 65, 1).data, [1]);
    let silence = Instruction::Write {
        address: 68,
        data: &[0],
    };
    assert_eq!(host.tell(1, silence), []);
    let read = Instruction::Read {
        address: 65,
        length: 1,
    };
    assert_eq!(host.tell(1, read), []);
    assert_eq!(host.tell(1, Instruction::Ping).len(), 1);
}

#[test]
fn id_and_baud_changes_take_effect_and_another_rate_is_silence() {
    let mut host = Host::new(1);
    assert_eq!(host.write(1, 7, &[40]), 0);
    assert_eq!(host.tell(1, Instruction::Ping), []);
    assert_eq!(host.write(40, 8, &[4]), 0, "answered at the old rate");
    assert_eq!(host.tell(40, Instruction::Ping), []);
    host.port.set_baud(2_000_000).expect("a rate");
    assert_eq!(host.tell(40, Instruction::Ping).len(), 1);
    host.port.set_baud(2_050_000).expect("a rate");
    assert_eq!(host.tell(40, Instruction::Ping).len(), 1, "2.5 % off");
}

#[test]
fn reboot_loses_ram_and_keeps_eeprom_and_factory_reset_keeps_what_it_is_told() {
    let mut host = Host::new(2);
    host.write(1, 9, &[7]);
    host.write(1, 64, &[1]);
    host.write_u32(1, 112, 50);
    assert_eq!(host.one(1, Instruction::Reboot).error, 0);
    assert_eq!(host.tell(1, Instruction::Ping), [], "booting");
    host.wait(0.3);
    assert_eq!(host.read(1, 64, 1).data, [0]);
    assert_eq!(host.read_i32(1, 112), 0);
    assert_eq!(host.read(1, 9, 1).data, [7]);
    let keep = Instruction::FactoryReset(FactoryReset::KeepIdAndBaud);
    assert_eq!(host.one(2, keep).error, 0);
    host.wait(0.3);
    assert_eq!(host.read(2, 9, 1).data, [250]);
    let all = Instruction::FactoryReset(FactoryReset::All);
    assert_eq!(host.tell(BROADCAST_ID, all), []);
    assert_eq!(host.read(2, 7, 1).data, [2], "refused by broadcast");
    assert_eq!(host.one(2, all).error, 0);
    host.wait(0.3);
    host.port.set_baud(57_600).expect("a rate");
    assert_eq!(host.read(1, 7, 1).data, [1], "out of the box");
}

#[test]
fn the_backup_brings_settings_back() {
    let mut host = Host::new(1);
    let restore = Instruction::Backup(Backup::Restore);
    assert_ne!(host.one(1, restore).error, 0, "nothing stored");
    host.write(1, 84, &[0x20, 0x03]);
    host.write(1, 9, &[11]);
    assert_eq!(host.one(1, Instruction::Backup(Backup::Store)).error, 0);
    host.write(1, 9, &[0]);
    assert_eq!(host.one(1, restore).error, 0);
    host.wait(0.3);
    assert_eq!(host.read(1, 9, 1).data, [11]);
    assert_eq!(host.read(1, 84, 2).data, [0x20, 0x03]);
}

#[test]
fn a_mode_change_resets_gains_and_goals() {
    let mut host = Host::new(1);
    host.write_u32(1, 112, 50);
    host.write(1, 84, &[1, 0]);
    assert_eq!(host.write(1, 11, &[4]), 0);
    assert_eq!(host.read_i32(1, 112), 0);
    assert_eq!(host.read(1, 84, 2).data, 640u16.to_le_bytes());
    assert_eq!(host.write_u32(1, 116, 20_000), 0, "beyond one turn");
    assert_eq!(host.write_u32(1, 116, 256 * 4096), 6);
}

#[test]
fn bulk_instructions_reach_each_servo_at_its_own_registers() {
    let mut host = Host::new(3);
    let mut buf = [0; 256];
    let entries = [
        BulkWriteEntry {
            id: 3,
            address: 112,
            data: &[9, 0, 0, 0],
        },
        BulkWriteEntry {
            id: 1,
            address: 65,
            data: &[1],
        },
    ];
    let bytes = lists::encode_bulk_write(&mut buf, entries).expect("room");
    host.port.write_all(bytes).expect("a port that is there");
    let asked = [(3, 112, 4), (1, 65, 1), (2, 7, 1)].map(|(id, address, length)| BulkReadEntry {
        id,
        address,
        length,
    });
    let bytes = lists::encode_bulk_read(&mut buf, false, asked).expect("room");
    host.port.write_all(bytes).expect("a port that is there");
    let answers = host.answers();
    let seen: Vec<_> = answers.iter().map(|a| (a.id, a.data.as_slice())).collect();
    let expected: [(u8, &[u8]); 3] = [(3, &[9, 0, 0, 0]), (1, &[1]), (2, &[2])];
    assert_eq!(seen, expected);
    let bytes = lists::encode_bulk_read(&mut buf, true, asked).expect("room");
    host.port.write_all(bytes).expect("a port that is there");
    let heard = host.hear();
    assert_eq!(fast::find_prefix(&heard, 18), Some(0));
    let mut blocks = fast::Blocks::new(&heard);
    for (id, data) in expected {
        let block = blocks.next_block(id, data.len()).expect("a good block");
        assert_eq!(block.data, data);
    }
}

#[test]
fn a_cycle_of_twelve_takes_the_computed_time_on_the_wire() {
    let ids: Vec<u8> = (1..=12).collect();
    let goals: Vec<(u8, i32)> = ids.iter().map(|id| (*id, 2048)).collect();
    for (fast, expected_us, bytes) in [(true, 2760.0, 176), (false, 3520.0, 252)] {
        let mut host = Host::new(12);
        let start = host.clock.now();
        host.sync_goals(&goals);
        host.sync_read(fast, &ids, 126, 10);
        let mut buf = [0; 512];
        let deadline = start + Duration::from_millis(100);
        let count = host.port.read(&mut buf, bytes, deadline);
        assert_eq!(count.expect("a port that is there"), bytes);
        let took_us = host.clock.now().secs_since(start) * 1e6;
        assert!(
            (took_us / expected_us - 1.0).abs() < 0.01,
            "fast {fast}: {took_us:.1} us, formula {expected_us} us"
        );
    }
}

#[test]
fn return_delay_is_paid_per_status_and_once_in_a_fast_read() {
    let ids = [1, 2, 3, 4];
    for (fast, expected_us) in [(true, 180 + 640 + 500), (false, 180 + 840 + 4 * 500)] {
        let mut host = Host::new(4);
        for id in ids {
            host.write(id, 9, &[250]);
        }
        let start = host.clock.now();
        host.sync_read(fast, &ids, 126, 10);
        let mut buf = [0; 512];
        let bytes = if fast { 64 } else { 84 };
        let read = host
            .port
            .read(&mut buf, bytes, start + Duration::from_secs(1));
        assert_eq!(read.expect("a port that is there"), bytes);
        let took_us = host.clock.now().secs_since(start) * 1e6;
        assert!(
            (took_us - f64::from(expected_us)).abs() < 1.0,
            "fast {fast}: {took_us:.1} us, expected {expected_us} us"
        );
    }
}

#[test]
fn old_firmware_knows_no_fast_reads() {
    let mut line = Line::new(LineOptions::default());
    line.attach(1, Servo::commissioned(&XL430_W250, 1, 3));
    line.attach(2, Servo::commissioned(&XL430_W250, 2, 3).with_firmware(44));
    let mut host = Host::on(line);
    host.sync_read(true, &[1, 2], 132, 4);
    let heard = host.hear();
    assert_eq!(heard.len(), 16, "prefix and the first block only");
    let mut blocks = fast::Blocks::new(&heard);
    assert!(blocks.next_block(1, 4).is_ok());
    host.sync_read(false, &[1, 2], 132, 4);
    assert_eq!(host.answers().len(), 2);
}

#[test]
fn behind_a_silent_servo_the_others_answer_or_wait_as_chosen() {
    for (after_silence, expected) in [
        (AfterSilence::Answer, vec![1, 3, 4]),
        (AfterSilence::Wait, vec![1]),
    ] {
        let options = LineOptions {
            after_silence,
            ..LineOptions::default()
        };
        let mut host = Host::with(4, options).fault("2:silent@0s..1s");
        host.sync_read(false, &[1, 2, 3, 4], 132, 4);
        let ids: Vec<u8> = host.answers().iter().map(|a| a.id).collect();
        assert_eq!(ids, expected);
        host.sync_read(true, &[1, 2, 3, 4], 132, 4);
        assert_eq!(host.hear().len(), 16, "a fast read ends at the gap");
        host.wait(1.0);
        host.sync_read(false, &[1, 2, 3, 4], 132, 4);
        assert_eq!(host.answers().len(), 4, "back again");
    }
}

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

#[test]
fn the_published_ping_is_answered_byte_for_byte() {
    let mut host = Host::new(1);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E]);
    let heard = host.hear();
    assert_eq!(
        heard[..12],
        [0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 0x55, 0, 0x24, 4, 46]
    );
}
