//! The parser of Protocol 1.0 on a bad line: pieces, garbage, damage, gaps. It may lose frames, never invent one.

use handwave_dynamixel::p1::{Frame, FrameParser, FrameWriter, Instruction, Status, is_valid_id};
use proptest::collection::vec;
use proptest::prelude::*;

const ROOM: usize = 259;

type Owned = (u8, u8, Vec<u8>);

fn encode((id, code, params): &Owned) -> Vec<u8> {
    let mut buf = [0; ROOM];
    let mut writer = FrameWriter::new(&mut buf, *id, *code);
    writer.extend(params);
    writer.finish().expect("room for any frame").to_vec()
}

/// Feeds a stream in pieces and collects what comes out.
fn feed(parser: &mut FrameParser<ROOM>, stream: &[u8], piece: usize) -> Vec<Owned> {
    let mut frames = Vec::new();
    for mut rest in stream.chunks(piece.max(1)) {
        while !rest.is_empty() {
            let taken = parser.push(rest);
            rest = &rest[taken..];
            let before = frames.len();
            frames.extend(drain(parser));
            assert!(
                taken > 0 || frames.len() > before,
                "the parser is stuck with {} bytes",
                parser.buffered()
            );
        }
    }
    frames
}

fn drain(parser: &mut FrameParser<ROOM>) -> Vec<Owned> {
    let mut frames = Vec::new();
    while let Some(Frame { id, code, params }) = parser.next_frame() {
        frames.push((id, code, params.to_vec()));
    }
    frames
}

/// Bytes in which headers are common.
fn nasty_byte() -> impl Strategy<Value = u8> {
    prop_oneof![4 => Just(0xFFu8), 1 => 0u8..8, 2 => any::<u8>()]
}

fn frame() -> impl Strategy<Value = Owned> {
    let id = any::<u8>().prop_filter("an id a frame can have", |&id| is_valid_id(id));
    (id, any::<u8>(), vec(nasty_byte(), 0..60))
}

#[test]
fn of_a_row_of_ff_the_last_two_are_the_header() {
    let mut stream = vec![0xFF; 7];
    stream.extend(encode(&(1, 0, vec![0x20])));
    let mut parser = FrameParser::new();
    assert_eq!(
        feed(&mut parser, &stream, 1),
        vec![(1, 0, vec![0x20])],
        "{stream:02X?}"
    );
    assert_eq!(parser.damage().stray_bytes, 7);
}

#[test]
fn no_flip_of_one_bit_gets_a_frame_through() {
    let sent = encode(&(7, 0x24, vec![0x00, 0xFF, 0xFF, 0x01, 0x02, 0x10]));
    for bit in 0..8 * sent.len() {
        let mut line = sent.clone();
        line[bit / 8] ^= 1 << (bit % 8);
        let mut parser = FrameParser::new();
        let mut frames = feed(&mut parser, &line, ROOM);
        parser.line_idle();
        frames.extend(drain(&mut parser));
        assert!(
            !frames.iter().any(|frame| encode(frame).len() >= sent.len()),
            "bit {bit} flipped: {frames:?}"
        );
    }
}

proptest! {
    #[test]
    fn frames_come_out_as_they_went_in(frames in vec(frame(), 1..8), piece in 1usize..80) {
        let stream: Vec<u8> = frames.iter().flat_map(encode).collect();
        let mut parser = FrameParser::new();
        prop_assert_eq!(feed(&mut parser, &stream, piece), frames);
        prop_assert_eq!(parser.damage().stray_bytes, 0);
    }

    #[test]
    fn garbage_without_a_header_costs_no_frame(
        parts in vec((vec(0u8..0xFF, 0..20), frame()), 1..6), piece in 1usize..80,
    ) {
        let mut stream = Vec::new();
        let mut garbage = 0;
        for (noise, frame) in &parts {
            stream.extend(noise);
            stream.extend(encode(frame));
            garbage += noise.len();
        }
        let mut parser = FrameParser::new();
        let frames = feed(&mut parser, &stream, piece);
        prop_assert_eq!(frames, parts.into_iter().map(|(_, frame)| frame).collect::<Vec<_>>());
        prop_assert_eq!(parser.damage().stray_bytes as usize, garbage);
    }

    #[test]
    fn pieces_make_no_difference_whatever_the_bytes(bytes in vec(nasty_byte(), 0..600), piece in 1usize..100) {
        let (mut whole, mut parts) = (FrameParser::new(), FrameParser::new());
        let expected = feed(&mut whole, &bytes, ROOM);
        prop_assert_eq!(feed(&mut parts, &bytes, piece), expected);
        prop_assert_eq!(parts.damage(), whole.damage());
        prop_assert!(parts.missing() >= 1);
    }

    #[test]
    fn a_frame_cut_short_is_forgotten_after_an_idle_gap(
        first in frame(), second in frame(), cut in any::<prop::sample::Index>(),
    ) {
        let whole = encode(&first);
        let cut = &whole[..cut.index(whole.len())];
        let mut parser = FrameParser::new();
        // Parameters may look like a frame of their own once the one around them is cut.
        let _ = feed(&mut parser, cut, ROOM);
        parser.line_idle();
        let frames = feed(&mut parser, &encode(&second), ROOM);
        prop_assert_eq!(frames.last(), Some(&second), "behind {:02X?}", cut);
    }

    #[test]
    fn what_comes_out_stands_in_the_bytes_and_nothing_panics(bytes in vec(nasty_byte(), 0..600)) {
        let mut parser = FrameParser::new();
        for frame in feed(&mut parser, &bytes, ROOM) {
            let line = encode(&frame);
            prop_assert!(bytes.windows(line.len()).any(|window| window == line), "{:02X?}", line);
        }
        let _ = Frame::parse(&bytes);
    }

    #[test]
    fn any_parameters_of_any_instruction_parse_without_panic(
        code in prop_oneof![0u8..10, Just(0x83u8), Just(0x92u8), any::<u8>()], params in vec(any::<u8>(), 0..64),
    ) {
        let frame = Frame { id: 1, code, params: &params };
        if let Ok(typed) = Instruction::parse(&frame) {
            let items = match typed {
                Instruction::SyncWrite(write) => write.iter().count(),
                Instruction::BulkRead(read) => read.iter().count(),
                _ => 0,
            };
            prop_assert!(items <= params.len());
            // What can be parsed can be written, and gives the same bytes.
            let mut buf = [0; ROOM];
            let line = typed.encode(1, &mut buf).expect("room for any frame");
            prop_assert_eq!(line, encode(&(1, code, params.clone())));
        }
        let status = Status::of(&frame);
        let mut buf = [0; ROOM];
        prop_assert_eq!(status.encode(&mut buf).expect("room"), encode(&(1, code, params.clone())));
    }
}
