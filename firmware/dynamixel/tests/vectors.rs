//! The frames published in the vendor's manual, both ways: typed form to bytes, bytes to typed form.

use handwave_dynamixel::fast::{self, BlockError, Blocks};
use handwave_dynamixel::instruction::{
    Backup, BulkReadEntry, BulkWriteEntry, FactoryReset, SyncRead,
};
use handwave_dynamixel::lists::{encode_bulk_read, encode_bulk_write, encode_sync_write};
use handwave_dynamixel::{BROADCAST_ID, Crc, ErrorCode, Frame, Instruction, Status};

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).expect("hex in the test"))
        .collect()
}

fn hex(bytes: &[u8]) -> String {
    let words: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    words.join(" ")
}

/// The instruction encodes to the published bytes, and they parse to the instruction.
fn check(id: u8, instruction: Instruction<'_>, published: &str) {
    let mut buf = [0; 64];
    let encoded = instruction.encode(id, &mut buf).expect("room for 64 bytes");
    assert_eq!(hex(encoded), published);
    let mut wire = bytes(published);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    assert_eq!(frame.id, id, "{published}");
    assert_eq!(Instruction::parse(&frame), Ok(instruction), "{published}");
}

#[test]
fn single_servo_instructions() {
    check(1, Instruction::Ping, "FF FF FD 00 01 03 00 01 19 4E");
    check(
        1,
        Instruction::Read {
            address: 132,
            length: 4,
        },
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
    );
    check(
        1,
        Instruction::Write {
            address: 116,
            data: &512u32.to_le_bytes(),
        },
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
    );
    check(1, Instruction::Action, "FF FF FD 00 01 03 00 05 02 CE");
    check(
        1,
        Instruction::FactoryReset(FactoryReset::KeepId),
        "FF FF FD 00 01 04 00 06 01 A1 E6",
    );
    check(1, Instruction::Reboot, "FF FF FD 00 01 03 00 08 2F 4E");
    check(
        1,
        Instruction::ClearMultiTurn,
        "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC",
    );
    check(
        1,
        Instruction::Backup(Backup::Store),
        "FF FF FD 00 01 08 00 20 01 43 54 52 4C 16 F5",
    );
}

#[test]
fn list_instructions() {
    check(
        BROADCAST_ID,
        Instruction::SyncRead(SyncRead {
            address: 132,
            length: 4,
            ids: &[1, 2],
        }),
        "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
    );
    check(
        BROADCAST_ID,
        Instruction::FastSyncRead(SyncRead {
            address: 132,
            length: 4,
            ids: &[3, 7, 4],
        }),
        "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
    );
}

#[test]
fn sync_write() {
    let published = "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87";
    let mut buf = [0; 64];
    let items = [(1, 150u32.to_le_bytes()), (2, 170u32.to_le_bytes())];
    let encoded = encode_sync_write(&mut buf, 116, 4, items).expect("room for 64 bytes");
    assert_eq!(hex(encoded), published);

    let mut wire = bytes(published);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    let Ok(Instruction::SyncWrite(write)) = Instruction::parse(&frame) else {
        panic!("not a sync write: {frame:?}");
    };
    assert_eq!((write.address, write.length), (116, 4));
    let found: Vec<_> = write.iter().map(|(id, data)| (id, data.to_vec())).collect();
    assert_eq!(found, items.map(|(id, data)| (id, data.to_vec())));
    check(BROADCAST_ID, Instruction::SyncWrite(write), published);
}

#[test]
fn bulk_read() {
    let published = "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05";
    let entries = [
        BulkReadEntry {
            id: 1,
            address: 144,
            length: 2,
        },
        BulkReadEntry {
            id: 2,
            address: 146,
            length: 1,
        },
    ];
    let mut buf = [0; 64];
    let encoded = encode_bulk_read(&mut buf, false, entries).expect("room for 64 bytes");
    assert_eq!(hex(encoded), published);

    let mut wire = bytes(published);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    let Ok(Instruction::BulkRead(read)) = Instruction::parse(&frame) else {
        panic!("not a bulk read: {frame:?}");
    };
    assert_eq!(read.iter().collect::<Vec<_>>(), entries);
    check(BROADCAST_ID, Instruction::BulkRead(read), published);
}

#[test]
fn fast_bulk_read_checksum_is_ours_where_the_manual_misprints_it() {
    // The manual prints 20 F2, which is the checksum of its fast sync read example.
    let entries = [
        BulkReadEntry {
            id: 3,
            address: 132,
            length: 4,
        },
        BulkReadEntry {
            id: 7,
            address: 124,
            length: 2,
        },
        BulkReadEntry {
            id: 4,
            address: 146,
            length: 1,
        },
    ];
    let mut buf = [0; 64];
    let encoded = encode_bulk_read(&mut buf, true, entries).expect("room for 64 bytes");
    assert_eq!(hex(&encoded[encoded.len() - 2..]), "DA 2D");
    let mut wire = encoded.to_vec();
    let frame = Frame::parse(&mut wire).expect("our own frame");
    let Ok(Instruction::FastBulkRead(read)) = Instruction::parse(&frame) else {
        panic!("not a fast bulk read: {frame:?}");
    };
    assert_eq!(read.iter().collect::<Vec<_>>(), entries);
}

#[test]
fn bulk_write() {
    let published = "FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68";
    let entries = [
        BulkWriteEntry {
            id: 1,
            address: 32,
            data: &[0xA0, 0x00],
        },
        BulkWriteEntry {
            id: 2,
            address: 31,
            data: &[0x50],
        },
    ];
    let mut buf = [0; 64];
    let encoded = encode_bulk_write(&mut buf, entries).expect("room for 64 bytes");
    assert_eq!(hex(encoded), published);

    let mut wire = bytes(published);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    let Ok(Instruction::BulkWrite(write)) = Instruction::parse(&frame) else {
        panic!("not a bulk write: {frame:?}");
    };
    assert_eq!(write.iter().collect::<Vec<_>>(), entries);
    check(BROADCAST_ID, Instruction::BulkWrite(write), published);
}

#[test]
fn status_of_a_ping() {
    let published = "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D";
    let mut wire = bytes(published);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    let status = Status::parse(&frame).expect("a status");
    assert_eq!(status.id, 1);
    assert_eq!((status.alert, status.error), (false, ErrorCode::None));
    let model = u16::from_le_bytes([status.params[0], status.params[1]]);
    assert_eq!((model, status.params[2]), (1030, 38), "model and firmware");
    let mut buf = [0; 64];
    let encoded = status.encode(&mut buf).expect("room for 64 bytes");
    assert_eq!(hex(encoded), published);
}

#[test]
fn a_write_of_header_bytes_is_stuffed() {
    check(
        1,
        Instruction::Write {
            address: 102,
            data: &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF],
        },
        "FF FF FD 00 01 0C 00 03 66 00 FF FF FD FD FF FF FF 09 35",
    );
}

const FAST_STATUS: &str = "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 \
    00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E";
const FAST_BLOCKS: [(u8, i32); 3] = [(3, 166), (7, 2079), (4, 1023)];

#[test]
fn combined_status_on_the_device_side() {
    let mut line = Vec::new();
    let mut crc = Crc::new();
    let mut buf = [0; 16];
    line.extend(fast::encode_prefix(&mut buf, 3 * 8, &mut crc).expect("room for 8 bytes"));
    for (id, position) in FAST_BLOCKS {
        let block = fast::encode_block(&mut buf, 0, id, &position.to_le_bytes(), &mut crc);
        line.extend(block.expect("room for 8 bytes"));
    }
    assert_eq!(
        hex(&line),
        FAST_STATUS.split_whitespace().collect::<Vec<_>>().join(" ")
    );
}

#[test]
fn combined_status_on_the_host_side() {
    let mut noisy = vec![0xFF, 0xFF, 0xFD];
    noisy.extend(bytes(FAST_STATUS));
    let at = fast::find_prefix(&noisy, 24).expect("the prefix is there");
    assert_eq!(at, 3, "stale bytes before the prefix");
    let mut blocks = Blocks::new(&noisy[at..]);
    for (id, position) in FAST_BLOCKS {
        let block = blocks.next_block(id, 4).expect("a published block");
        assert_eq!(block.data, position.to_le_bytes(), "servo {id}");
        assert_eq!(
            (block.id, block.alert, block.error),
            (id, false, ErrorCode::None)
        );
    }
    assert_eq!(
        blocks.next_block(9, 4),
        Err(BlockError::Incomplete { missing: 8 })
    );
    // As a whole it is a frame too: its last block checksum is that of the frame.
    let mut wire = bytes(FAST_STATUS);
    let frame = Frame::parse(&mut wire).expect("a published frame");
    assert_eq!((frame.id, frame.params.len()), (BROADCAST_ID, 22));
}

#[test]
fn damage_in_one_block_leaves_the_others_usable() {
    for damaged in 8..32 {
        let mut wire = bytes(FAST_STATUS);
        wire[damaged] ^= 0x10;
        let mut blocks = Blocks::new(&wire);
        let good: Vec<bool> = FAST_BLOCKS
            .iter()
            .map(|(id, _)| blocks.next_block(*id, 4).is_ok() || !blocks.skip_block(4))
            .collect();
        let mut expected = [true; 3];
        let (block, byte) = ((damaged - 8) / 8, (damaged - 8) % 8);
        expected[block] = false;
        // A damaged checksum cannot vouch for the block behind it.
        if byte >= 6 && block < 2 {
            expected[block + 1] = false;
        }
        assert_eq!(good, expected, "byte {damaged} damaged");
    }
}

#[test]
fn a_combined_status_with_header_bytes_in_its_data_is_not_unstuffed() {
    let mut line = Vec::new();
    let mut crc = Crc::new();
    let mut buf = [0; 16];
    line.extend(fast::encode_prefix(&mut buf, 8, &mut crc).expect("room for 8 bytes"));
    let data = [0xFF, 0xFF, 0xFD, 0xFD];
    line.extend(fast::encode_block(&mut buf, 0x80, 5, &data, &mut crc).expect("room"));
    let mut blocks = Blocks::new(&line);
    let block = blocks.next_block(5, 4).expect("our own block");
    assert_eq!((block.data, block.alert), (&data[..], true));
    let mut wire = line.clone();
    let frame = Frame::parse(&mut wire).expect("our own frame");
    assert_eq!(&frame.params[2..6], data);
}
