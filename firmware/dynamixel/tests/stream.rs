//! The parser on a bad line: pieces, garbage, damage, gaps. It may lose frames, never invent one.

use handwave_dynamixel::crc::crc16;
use handwave_dynamixel::frame::MIN_LEN;
use handwave_dynamixel::{
    Frame, FrameError, FrameParser, FrameWriter, Instruction, Status, fast::Blocks, is_valid_id,
};
use proptest::collection::vec;
use proptest::prelude::*;

type Owned = (u8, u8, Vec<u8>);

fn owned(frame: Frame<'_>) -> Owned {
    (frame.id, frame.instruction, frame.params.to_vec())
}

fn encode((id, instruction, params): &Owned) -> Vec<u8> {
    let mut buf = vec![0; 2 * params.len() + 64];
    let mut writer = FrameWriter::new(&mut buf, *id, *instruction);
    writer.extend(params);
    writer.finish().expect("room for any stuffing").to_vec()
}

/// Feeds a stream in pieces and collects what comes out.
fn feed(parser: &mut FrameParser<512>, stream: &[u8], piece: usize) -> Vec<Owned> {
    let mut frames = Vec::new();
    for bytes in stream.chunks(piece.max(1)) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = parser.push(rest);
            rest = &rest[taken..];
            let before = frames.len();
            while let Some(frame) = parser.next_frame() {
                frames.push(owned(frame));
            }
            assert!(
                taken > 0 || frames.len() > before || parser.buffered() < 512,
                "the parser is stuck with {} bytes",
                parser.buffered()
            );
        }
    }
    frames
}

/// Bytes in which headers and stuffing are common.
fn nasty_byte() -> impl Strategy<Value = u8> {
    prop_oneof![
        4 => Just(0xFFu8),
        3 => Just(0xFDu8),
        2 => Just(0x00u8),
        1 => Just(0x55u8),
        2 => any::<u8>(),
    ]
}

fn frame() -> impl Strategy<Value = Owned> {
    let id = any::<u8>().prop_filter("an id a frame can have", |&id| is_valid_id(id));
    (id, any::<u8>(), vec(nasty_byte(), 0..60)).prop_filter(
        "the combined status is the one frame that is not stuffed",
        |(id, instruction, _)| !(*id == 0xFE && *instruction == 0x55),
    )
}

/// Found by chance: half a frame and the start of the next make a whole whose checksum happens to fit.
#[test]
fn a_header_inside_a_body_is_a_new_frame_even_where_the_checksum_fits() {
    let second = (51, 0x34, vec![0xAA; 49]);
    let mut stream = vec![0xFF, 0xFF, 0xFD, 0x00, 60, 32, 0];
    stream.extend(&encode(&second)[..30]);
    stream.extend(crc16(&stream).to_le_bytes());
    let mut whole = stream.clone();
    assert_eq!(
        Frame::parse(&mut whole),
        Err(FrameError::HeaderInside),
        "{stream:02X?}"
    );

    stream.extend(encode(&second));
    let mut parser = FrameParser::<512>::new();
    assert_eq!(
        feed(&mut parser, &stream, 512),
        vec![second],
        "{stream:02X?}"
    );
}

proptest! {
    #[test]
    fn frames_come_out_as_they_went_in(frames in vec(frame(), 1..8), piece in 1usize..80) {
        let stream: Vec<u8> = frames.iter().flat_map(encode).collect();
        let mut parser = FrameParser::<512>::new();
        prop_assert_eq!(feed(&mut parser, &stream, piece), frames);
        prop_assert_eq!(parser.damage().stray_bytes, 0);
    }

    #[test]
    fn garbage_between_frames_costs_no_frame(
        // Without FF no header begins in the garbage, so every frame must come through.
        parts in vec((vec(0u8..0xFF, 0..20), frame()), 1..6),
        piece in 1usize..80,
    ) {
        let mut stream = Vec::new();
        let mut garbage = 0;
        for (noise, frame) in &parts {
            stream.extend(noise);
            stream.extend(encode(frame));
            garbage += noise.len();
        }
        let mut parser = FrameParser::<512>::new();
        let frames = feed(&mut parser, &stream, piece);
        prop_assert_eq!(frames, parts.into_iter().map(|(_, frame)| frame).collect::<Vec<_>>());
        prop_assert_eq!(parser.damage().stray_bytes as usize, garbage);
    }

    #[test]
    fn a_frame_cut_short_is_forgotten_after_an_idle_gap(
        first in frame(), second in frame(), cut in any::<prop::sample::Index>(),
    ) {
        let whole = encode(&first);
        let mut parser = FrameParser::<512>::new();
        prop_assert_eq!(feed(&mut parser, &whole[..cut.index(whole.len())], 512), vec![]);
        parser.line_idle();
        prop_assert_eq!(feed(&mut parser, &encode(&second), 512), vec![second]);
    }

    #[test]
    fn a_frame_behind_half_a_frame_is_found_without_a_gap(
        first in frame(), second in frame(), cut in any::<prop::sample::Index>(),
    ) {
        let whole = encode(&first);
        let mut stream = whole[..cut.index(whole.len())].to_vec();
        stream.extend(encode(&second));
        // One stream in 65536 cut within four bytes of its end makes a valid frame of both by accident:
        // the checksum cannot tell, nor can the parser.
        let borrowed = stream.get(..whole.len()).map(|bytes| Frame::parse(&mut bytes.to_vec()).is_ok());
        prop_assume!(borrowed != Some(true));
        let mut parser = FrameParser::<512>::new();
        let mut frames = feed(&mut parser, &stream, 512);
        // A half cut at its checksum may still wait for bytes that never come; the gap ends that.
        parser.line_idle();
        while let Some(frame) = parser.next_frame() {
            frames.push(owned(frame));
        }
        prop_assert_eq!(frames, vec![second]);
    }

    #[test]
    fn no_bytes_make_anything_panic(bytes in vec(nasty_byte(), 0..600), piece in 1usize..100) {
        let mut parser = FrameParser::<64>::new();
        for piece in bytes.chunks(piece) {
            parser.push(piece);
            while let Some(frame) = parser.next_frame() {
                let _ = Instruction::parse(&frame);
                let _ = Status::parse(&frame);
            }
            let _ = parser.missing();
        }
        parser.line_idle();
        let _ = parser.next_frame();
        let mut blocks = Blocks::new(&bytes);
        while blocks.next_block(1, 10).is_ok() {}
        let _ = blocks.next_block(1, usize::MAX);
        let _ = Frame::parse(&mut bytes.clone());
    }

    #[test]
    fn any_parameters_of_any_instruction_parse_without_panic(
        instruction: u8, params in vec(any::<u8>(), 0..64),
    ) {
        let frame = Frame { id: 1, instruction, params: &params, wire_len: 0 };
        if let Ok(typed) = Instruction::parse(&frame) {
            match typed {
                Instruction::SyncWrite(write) => {
                    let _ = write.iter().count();
                },
                Instruction::BulkRead(read) | Instruction::FastBulkRead(read) => {
                    let _ = read.iter().count();
                }
                Instruction::BulkWrite(write) => {
                    let _ = write.iter().count();
                },
                _ => {}
            }
            // What can be parsed can be written, and gives the same bytes.
            let mut buf = [0; 256];
            let wire_len = typed.encode(1, &mut buf).expect("room for any stuffing").len();
            let again = Frame::parse(&mut buf[..wire_len]).expect("our own frame");
            prop_assert_eq!((again.instruction, again.params), (instruction, &params[..]));
        }
    }
}

#[test]
fn no_flip_of_one_or_two_bits_gets_a_frame_through() {
    let sent = encode(&(
        7,
        0x55,
        vec![0x00, 0xFF, 0xFF, 0xFD, 0x10, 0x27, 0x00, 0x00],
    ));
    let bits = sent.len() * 8;
    for first in 0..bits {
        for second in first..bits {
            let mut wire = sent.clone();
            wire[first / 8] ^= 1 << (first % 8);
            if second != first {
                wire[second / 8] ^= 1 << (second % 8);
            }
            let mut parser = FrameParser::<512>::new();
            parser.push(&wire);
            parser.line_idle();
            let got = parser.next_frame().map(owned);
            assert_eq!(got, None, "bits {first} and {second} flipped");
        }
    }
}

#[test]
fn a_length_field_of_nought_or_one_is_skipped() {
    // Such frames made another driver panic in checked builds.
    for length in 0..3 {
        let mut parser = FrameParser::<64>::new();
        parser.push(&[
            0xFF, 0xFF, 0xFD, 0x00, 0x01, length, 0x00, 0x55, 0x00, 0x00, 0x00,
        ]);
        assert_eq!(parser.next_frame(), None, "length field {length}");
        parser.push(&encode(&(2, 0x01, vec![])));
        assert!(parser.next_frame().is_some(), "length field {length}");
    }
}

#[test]
fn a_frame_too_long_for_the_parser_is_skipped() {
    let mut parser = FrameParser::<32>::new();
    let long = encode(&(1, 0x03, vec![7; 40]));
    let mut frames = Vec::new();
    for byte in long.iter().chain(&encode(&(2, 0x01, vec![]))) {
        assert_eq!(parser.push(&[*byte]), 1);
        if let Some(frame) = parser.next_frame() {
            frames.push(frame.id);
        }
    }
    assert_eq!(frames, [2]);
}

#[test]
fn missing_counts_down_to_the_end_of_the_frame() {
    let wire = encode(&(1, 0x55, vec![0, 1, 2, 3]));
    let mut parser = FrameParser::<64>::new();
    assert_eq!(parser.missing(), MIN_LEN);
    for (index, byte) in wire.iter().enumerate() {
        // The length is known from the seventh byte on.
        let expected = if index < 7 { MIN_LEN } else { wire.len() } - index;
        assert_eq!(parser.missing(), expected, "after {index} bytes");
        parser.push(&[*byte]);
    }
    assert!(parser.next_frame().is_some());
}

#[test]
fn a_buffer_that_is_too_small_is_an_error_at_every_size() {
    let mut buf = [0; 16];
    for size in 0..16 {
        let ping = Instruction::Ping.encode(1, &mut buf[..size]);
        assert_eq!(ping.is_ok(), size >= 10, "ping into {size} bytes");
        let read = Instruction::Read {
            address: 0,
            length: 1,
        }
        .encode(1, &mut buf[..size]);
        assert_eq!(read.is_ok(), size >= 14, "read into {size} bytes");
    }
}
