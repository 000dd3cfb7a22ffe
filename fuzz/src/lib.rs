//! What must hold of the Dynamixel parsers whatever bytes come: each function panics where it does not.
//!
//! The fuzzing targets and the test that runs the kept corpus call the same functions.

use handwave_dynamixel::fast::Blocks;
use handwave_dynamixel::{self as two, p1 as one};

/// Room of the parsers: enough for any frame of Protocol 1.0, small enough that long ones of 2.0 are refused.
const ROOM: usize = 300;

/// A frame: id, instruction or error byte, parameters.
type Owned = (u8, u8, Vec<u8>);

/// A parser under test.
trait Parser {
    fn push(&mut self, bytes: &[u8]) -> usize;
    /// The next frame, and how many bytes it took on the line.
    fn next(&mut self) -> Option<(Owned, usize)>;
    fn missing(&self) -> usize;
    fn buffered(&self) -> usize;
    fn line_idle(&mut self);
    fn damage(&self) -> two::Damage;
    /// The frame that `bytes` are as a whole.
    fn whole(bytes: &[u8]) -> Option<Owned>;
    /// The bytes of a frame.
    fn encode(frame: &Owned) -> Vec<u8>;
}

struct Two(two::FrameParser<ROOM>);

impl Parser for Two {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next(&mut self) -> Option<(Owned, usize)> {
        let frame = self.0.next_frame()?;
        if let Ok(typed) = two::Instruction::parse(&frame) {
            let mut buf = [0; 2 * ROOM];
            let line = typed
                .encode(frame.id, &mut buf)
                .expect("room for any stuffing")
                .to_vec();
            assert_eq!(
                Self::whole(&line).map(|found| found.2),
                Some(frame.params.to_vec()),
                "{typed:?}"
            );
        }
        if let Ok(status) = two::Status::parse(&frame) {
            assert_eq!(Some(&status.error_byte()), frame.params.first());
            let mut blocks = Blocks::new(frame.params);
            while blocks.next_block(frame.id, 4).is_ok() {}
        }
        Some((
            (frame.id, frame.instruction, frame.params.to_vec()),
            frame.wire_len,
        ))
    }

    fn missing(&self) -> usize {
        self.0.missing()
    }

    fn buffered(&self) -> usize {
        self.0.buffered()
    }

    fn line_idle(&mut self) {
        self.0.line_idle();
    }

    fn damage(&self) -> two::Damage {
        self.0.damage()
    }

    fn whole(bytes: &[u8]) -> Option<Owned> {
        let mut bytes = bytes.to_vec();
        let frame = two::Frame::parse(&mut bytes).ok()?;
        Some((frame.id, frame.instruction, frame.params.to_vec()))
    }

    fn encode((id, instruction, params): &Owned) -> Vec<u8> {
        let mut buf = [0; 2 * ROOM];
        let mut writer = two::FrameWriter::new(&mut buf, *id, *instruction);
        writer.extend(params);
        writer.finish().expect("room for any stuffing").to_vec()
    }
}

struct One(one::FrameParser<ROOM>);

impl Parser for One {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next(&mut self) -> Option<(Owned, usize)> {
        let frame = self.0.next_frame()?;
        let owned = (frame.id, frame.code, frame.params.to_vec());
        if let Ok(typed) = one::Instruction::parse(&frame) {
            let mut buf = [0; ROOM];
            let line = typed
                .encode(frame.id, &mut buf)
                .expect("room for any frame");
            assert_eq!(line, Self::encode(&owned), "{typed:?}");
        }
        let mut buf = [0; ROOM];
        let line = one::Status::of(&frame)
            .encode(&mut buf)
            .expect("room for any frame");
        assert_eq!(line, Self::encode(&owned));
        Some((owned, frame.wire_len()))
    }

    fn missing(&self) -> usize {
        self.0.missing()
    }

    fn buffered(&self) -> usize {
        self.0.buffered()
    }

    fn line_idle(&mut self) {
        self.0.line_idle();
    }

    fn damage(&self) -> two::Damage {
        self.0.damage()
    }

    fn whole(bytes: &[u8]) -> Option<Owned> {
        let frame = one::Frame::parse(bytes).ok()?;
        Some((frame.id, frame.code, frame.params.to_vec()))
    }

    fn encode((id, code, params): &Owned) -> Vec<u8> {
        let mut buf = [0; ROOM];
        let mut writer = one::FrameWriter::new(&mut buf, *id, *code);
        writer.extend(params);
        writer.finish().expect("room for any frame").to_vec()
    }
}

/// Feeds `bytes` in pieces of `piece` and hands every frame to `found`.
fn feed<P: Parser>(
    parser: &mut P,
    bytes: &[u8],
    piece: usize,
    mut found: impl FnMut(Owned, usize),
) {
    for mut rest in bytes.chunks(piece.max(1)) {
        while !rest.is_empty() {
            let taken = parser.push(rest);
            rest = &rest[taken..];
            let mut frames = 0;
            while let Some((frame, wire_len)) = parser.next() {
                frames += 1;
                found(frame, wire_len);
            }
            assert!(
                taken > 0 || frames > 0,
                "stuck with {} bytes",
                parser.buffered()
            );
            assert!(parser.buffered() < ROOM, "a full buffer without a frame");
            assert!(parser.missing() >= 1 && parser.buffered() + parser.missing() <= ROOM);
        }
    }
}

/// Any bytes in any pieces: what comes out stands in them, in order, the rest is counted, and pieces make no
/// difference.
fn parse<P: Parser>(new: impl Fn() -> P, input: &[u8]) {
    let Some((&piece, bytes)) = input.split_first() else {
        return;
    };
    let mut parser = new();
    let (mut behind, mut in_frames, mut frames) = (0, 0, Vec::new());
    feed(&mut parser, bytes, usize::from(piece), |frame, wire_len| {
        let place = bytes[behind..]
            .windows(wire_len)
            .position(|window| P::whole(window).as_ref() == Some(&frame));
        let place = place
            .unwrap_or_else(|| panic!("{frame:02X?} does not stand in the bytes behind {behind}"));
        behind += place + wire_len;
        in_frames += wire_len;
        frames.push(frame);
    });
    let stray = parser.damage().stray_bytes as usize;
    assert_eq!(
        in_frames + stray + parser.buffered(),
        bytes.len(),
        "every byte is accounted for"
    );

    let mut again = new();
    let mut whole = Vec::new();
    feed(&mut again, bytes, ROOM, |frame, _| whole.push(frame));
    assert_eq!(frames, whole, "pieces of {piece} bytes made a difference");
    assert_eq!(parser.damage(), again.damage());
}

/// Good frames between noise of any kind with an idle line behind it: every good one comes out, in order.
fn noise<P: Parser>(mut parser: P, highest_id: u8, input: &[u8]) {
    let (mut sent, mut found) = (Vec::new(), Vec::new());
    let mut rest = input;
    while let [op, len, behind @ ..] = rest {
        let (chunk, tail) = behind.split_at(behind.len().min(usize::from(*len % 64)));
        rest = tail;
        if op % 2 == 0 {
            feed(&mut parser, chunk, usize::from(op / 2), |frame, _| {
                found.push(frame)
            });
            parser.line_idle();
        } else if let [id, code, params @ ..] = chunk {
            let frame = (id % (highest_id + 1), *code, params.to_vec());
            feed(
                &mut parser,
                &P::encode(&frame),
                usize::from(op / 2),
                |frame, _| found.push(frame),
            );
            sent.push(frame);
        }
    }
    let mut all = found.iter();
    for frame in &sent {
        assert!(
            all.any(|one| one == frame),
            "{frame:02X?} of {sent:02X?} is not in {found:02X?}"
        );
    }
}

/// [`parse`] of Protocol 2.0.
pub fn parse_two(input: &[u8]) {
    parse(|| Two(two::FrameParser::new()), input);
}

/// [`parse`] of Protocol 1.0.
pub fn parse_one(input: &[u8]) {
    parse(|| One(one::FrameParser::new()), input);
}

/// [`noise`] of Protocol 2.0.
pub fn noise_two(input: &[u8]) {
    noise(Two(two::FrameParser::new()), two::MAX_ID, input);
}

/// [`noise`] of Protocol 1.0.
pub fn noise_one(input: &[u8]) {
    noise(One(one::FrameParser::new()), one::MAX_ID, input);
}
