//! Simulated Dynamixel servos in virtual time: instructions, errors, wire times.

#[path = "support/sim_host.rs"]
mod sim_host;

use handwave::base::Clock;
use handwave::bus::Port;
use handwave::sim::models::XL430_W250;
use handwave::sim::{AfterSilence, Line, LineOptions, Servo};
use handwave_dynamixel::instruction::{
    Backup, BulkReadEntry, BulkWriteEntry, FactoryReset, Instruction,
};
use handwave_dynamixel::{BROADCAST_ID, FrameWriter, fast, lists};
use sim_host::Host;
use std::time::Duration;

#[test]
fn damaged_and_senseless_instructions_are_not_obeyed() {
    let mut host = Host::new(2);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 1, 3, 0, 1, 0x19, 0x4F]);
    assert!(host.hear().is_empty(), "a wrong checksum is not answered");
    host.send(&[0xFF; 300]);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 1, 0xFF, 0xFF]);
    assert!(host.hear().is_empty(), "garbage is not answered");
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
fn the_published_ping_is_answered_byte_for_byte() {
    let mut host = Host::new(1);
    host.send(&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E]);
    let heard = host.hear();
    assert_eq!(
        heard[..12],
        [0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 0x55, 0, 0x24, 4, 46]
    );
}
