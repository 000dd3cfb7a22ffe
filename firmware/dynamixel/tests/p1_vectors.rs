//! Protocol 1.0: the frames published in the vendor's manual both ways, refusals, lengths and rates.

use handwave_dynamixel::p1::instruction::BulkReadEntry;
use handwave_dynamixel::p1::lists::{encode_bulk_read, encode_sync_write};
use handwave_dynamixel::p1::{
    BROADCAST_ID, Errors, Frame, FrameError, Instruction, InstructionError, Status, baud, wire,
};

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
    let line = bytes(published);
    let frame = Frame::parse(&line).expect("a published frame");
    assert_eq!(
        (frame.id, frame.wire_len()),
        (id, line.len()),
        "{published}"
    );
    assert_eq!(Instruction::parse(&frame), Ok(instruction), "{published}");
}

#[test]
fn what_is_no_frame_says_why() {
    for (line, error) in [
        ("FE FF 01 02 01 FB", FrameError::Header),
        ("", FrameError::Header),
        (
            "FF FF 01 02 01",
            FrameError::Length {
                expected: 2,
                found: 1,
            },
        ),
        ("FF FF FF 02 01 FD", FrameError::Id { found: 255 }),
        (
            "FF FF 01 03 01 FB",
            FrameError::Length {
                expected: 2,
                found: 3,
            },
        ),
        (
            "FF FF 01 02 01 FA",
            FrameError::Checksum {
                expected: 0xFB,
                found: 0xFA,
            },
        ),
    ] {
        let found = Frame::parse(&bytes(line)).expect_err(line);
        assert_eq!(found, error, "{line}: {found}");
    }
}

#[test]
fn instructions_that_make_no_sense_are_refused_with_the_bits_that_a_servo_answers() {
    for (code, params, error, bits) in [
        (
            0x07,
            &[][..],
            InstructionError::Unknown { code: 0x07 },
            Errors::INSTRUCTION,
        ),
        (
            0x55,
            &[1][..],
            InstructionError::Unknown { code: 0x55 },
            Errors::INSTRUCTION,
        ),
        (
            0x01,
            &[1][..],
            InstructionError::Length { code: 1, found: 1 },
            Errors::RANGE,
        ),
        (
            0x02,
            &[36][..],
            InstructionError::Length { code: 2, found: 1 },
            Errors::RANGE,
        ),
        (
            0x03,
            &[][..],
            InstructionError::Length { code: 3, found: 0 },
            Errors::RANGE,
        ),
        (
            0x83,
            &[30, 0][..],
            InstructionError::Length {
                code: 0x83,
                found: 2,
            },
            Errors::RANGE,
        ),
        (
            0x83,
            &[30, 2, 1, 0][..],
            InstructionError::Length {
                code: 0x83,
                found: 4,
            },
            Errors::RANGE,
        ),
        (
            0x92,
            &[][..],
            InstructionError::Length {
                code: 0x92,
                found: 0,
            },
            Errors::RANGE,
        ),
        (
            0x92,
            &[0, 1][..],
            InstructionError::Length {
                code: 0x92,
                found: 2,
            },
            Errors::RANGE,
        ),
        (
            0x92,
            &[9, 1, 1, 1][..],
            InstructionError::Lead { found: 9 },
            Errors::RANGE,
        ),
    ] {
        let frame = Frame {
            id: 1,
            code,
            params,
        };
        let found = Instruction::parse(&frame).expect_err("it makes no sense");
        assert_eq!(
            (found, found.errors()),
            (error, Errors(bits)),
            "{code:#04X} {params:?}: {found}"
        );
    }
}

#[test]
fn published_instructions() {
    check(1, Instruction::Ping, "FF FF 01 02 01 FB");
    let read = Instruction::Read {
        address: 43,
        length: 1,
    };
    check(1, read, "FF FF 01 04 02 2B 01 CC");
    let write = Instruction::Write {
        address: 3,
        data: &[1],
    };
    check(BROADCAST_ID, write, "FF FF FE 04 03 03 01 F6");
    let goal = Instruction::Write {
        address: 30,
        data: &512u16.to_le_bytes(),
    };
    check(1, goal, "FF FF 01 05 03 1E 00 02 D6");
    let held = Instruction::RegWrite {
        address: 30,
        data: &500u16.to_le_bytes(),
    };
    check(1, held, "FF FF 01 05 04 1E F4 01 E2");
    check(BROADCAST_ID, Instruction::Action, "FF FF FE 02 05 FA");
    check(0, Instruction::FactoryReset, "FF FF 00 02 06 F7");
    check(1, Instruction::Reboot, "FF FF 01 02 08 F4");
}

#[test]
fn published_lists() {
    let published =
        "FF FF FE 18 83 1E 04 00 10 00 50 01 01 20 02 60 03 02 30 00 70 01 03 20 02 80 03 12";
    let goals = [
        (0, [0x10, 0x00, 0x50, 0x01]),
        (1, [0x20, 0x02, 0x60, 0x03]),
        (2, [0x30, 0x00, 0x70, 0x01]),
        (3, [0x20, 0x02, 0x80, 0x03]),
    ];
    let mut buf = [0; 64];
    let line = encode_sync_write(&mut buf, 30, 4, goals).expect("room");
    assert_eq!(hex(line), published);
    let frame = Frame::parse(line).expect("our own frame");
    let Ok(Instruction::SyncWrite(write)) = Instruction::parse(&frame) else {
        panic!("{published} is a sync write");
    };
    let found: Vec<(u8, Vec<u8>)> = write.iter().map(|(id, data)| (id, data.to_vec())).collect();
    let sent: Vec<(u8, Vec<u8>)> = goals
        .iter()
        .map(|(id, data)| (*id, data.to_vec()))
        .collect();
    assert_eq!(found, sent);
    check(BROADCAST_ID, Instruction::SyncWrite(write), published);

    let published = "FF FF FE 09 92 00 02 01 1E 02 02 24 1D";
    let asked = [
        BulkReadEntry {
            id: 1,
            address: 30,
            length: 2,
        },
        BulkReadEntry {
            id: 2,
            address: 36,
            length: 2,
        },
    ];
    let mut buf = [0; 64];
    let line = encode_bulk_read(&mut buf, asked).expect("room");
    assert_eq!(hex(line), published);
    let frame = Frame::parse(line).expect("our own frame");
    let Ok(Instruction::BulkRead(read)) = Instruction::parse(&frame) else {
        panic!("{published} is a bulk read");
    };
    assert_eq!(read.iter().collect::<Vec<_>>(), asked);
    check(BROADCAST_ID, Instruction::BulkRead(read), published);
}

#[test]
fn published_statuses() {
    for (line, errors, params) in [
        ("FF FF 01 02 00 FC", 0, &[][..]),
        ("FF FF 01 03 00 20 DB", 0, &[0x20][..]),
        (
            "FF FF 01 02 24 D8",
            Errors::OVERHEATING | Errors::OVERLOAD,
            &[][..],
        ),
    ] {
        let wire = bytes(line);
        let status = Status::of(&Frame::parse(&wire).expect(line));
        assert_eq!(
            (status.id, status.errors, status.params),
            (1, Errors(errors), params),
            "{line}"
        );
        let mut buf = [0; 16];
        assert_eq!(hex(status.encode(&mut buf).expect("room")), line);
    }
}

#[test]
fn error_bits_have_names_and_tell_the_servo_s_state_from_a_refusal() {
    let errors = Errors(0b0110_0100);
    assert_eq!(errors.to_string(), "overheating, overload, instruction");
    assert_eq!(
        errors.conditions(),
        Errors(Errors::OVERHEATING | Errors::OVERLOAD)
    );
    assert_eq!(errors.refusals(), Errors(Errors::INSTRUCTION));
    assert_eq!(Errors::default().to_string(), "none");
    for byte in 0..=255 {
        let errors = Errors(byte);
        assert_eq!(errors.conditions().0 | errors.refusals().0, byte);
    }
}

#[test]
fn a_list_that_does_not_fit_is_refused_and_a_frame_holds_what_is_promised() {
    let mut buf = [0; 512];
    let goals = |count: u8| (0..count).map(|id| (id, [0, 2]));
    let line = encode_sync_write(&mut buf, 30, 2, goals(83)).expect("251 / 3 servos fit");
    assert_eq!(line.len(), wire::sync_write(83, 2));
    assert!(
        encode_sync_write(&mut buf, 30, 2, goals(84)).is_err(),
        "84 do not fit into a length of one byte"
    );
    let asked = |count: u8| {
        (0..count).map(|id| BulkReadEntry {
            id,
            address: 36,
            length: 8,
        })
    };
    let line = encode_bulk_read(&mut buf, asked(84)).expect("84 servos fit");
    assert_eq!(line.len(), wire::bulk_read(84));
    assert!(
        encode_bulk_read(&mut buf, asked(85)).is_err(),
        "85 do not fit into a length of one byte"
    );
    for capacity in 0..8 {
        let mut small = [0; 8];
        let read = Instruction::Read {
            address: 0,
            length: 1,
        };
        assert!(
            read.encode(1, &mut small[..capacity]).is_err(),
            "{capacity} bytes hold no read"
        );
    }
}

#[test]
fn cycle_lengths_are_those_of_the_frames() {
    let mut buf = [0; 259];
    let read = Instruction::Read {
        address: 36,
        length: 8,
    };
    assert_eq!(read.encode(1, &mut buf).expect("room").len(), wire::READ);
    assert_eq!(
        Instruction::Ping.encode(1, &mut buf).expect("room").len(),
        wire::BARE_INSTRUCTION
    );
    let write = Instruction::Write {
        address: 30,
        data: &[0, 2],
    };
    assert_eq!(
        write.encode(1, &mut buf).expect("room").len(),
        wire::write(2)
    );
    let status = Status {
        id: 1,
        errors: Errors(0),
        params: &[0; 8],
    };
    assert_eq!(
        status.encode(&mut buf).expect("room").len(),
        wire::status(8)
    );
    // Goal 2 bytes, state 8 bytes.
    assert_eq!(wire::read_cycle(6, 2, 8), 26 + 6 * 22);
    assert_eq!(wire::bulk_cycle(6, 2, 8), 26 + 25 + 6 * 14);
}

#[test]
fn baud_register_values_of_the_manual() {
    for (code, rate) in [
        (1, 1_000_000),
        (3, 500_000),
        (4, 400_000),
        (7, 250_000),
        (9, 200_000),
        (16, 115_200),
        (34, 57_600),
        (103, 19_200),
        (207, 9_600),
        (250, 2_250_000),
        (251, 2_500_000),
        (252, 3_000_000),
        (0, 2_000_000),
    ] {
        assert_eq!(
            (baud::rate(code), baud::code(rate)),
            (rate, Some(code)),
            "{rate} baud"
        );
    }
    for rate in [0, 1, 7_000, 4_000_000, 1_500_000, u32::MAX] {
        assert_eq!(baud::code(rate), None, "{rate} baud");
    }
}
