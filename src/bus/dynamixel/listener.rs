//! What comes in, as statuses, whichever protocol a servo speaks.

use handwave_dynamixel::p1::{self, Errors};
use handwave_dynamixel::{Damage, ErrorCode, FrameParser, Status};

/// Longest frame received one by one.
pub(super) const FRAME_BYTES: usize = 2048;
/// Longest frame of Protocol 1.0.
const ONE_BYTES: usize = p1::frame::MAX_LEN;

/// The parsers of both protocols, of which one listens.
pub(super) struct Listener {
    two: FrameParser<FRAME_BYTES>,
    one: p1::FrameParser<ONE_BYTES>,
    /// Protocol 1.0 is listened for.
    is_one: bool,
    /// Error bits that tell how the servo is, of the latest status of Protocol 1.0.
    pub conditions: Errors,
}

impl Listener {
    pub fn new() -> Self {
        Listener {
            two: FrameParser::new(),
            one: p1::FrameParser::new(),
            is_one: false,
            conditions: Errors::default(),
        }
    }

    /// Listens for Protocol 1.0 or 2.0; what was not taken before is dropped.
    pub fn listen_for(&mut self, one: bool) {
        self.is_one = one;
    }

    /// Forgets all bytes and returns how many those were.
    pub fn clear(&mut self) -> usize {
        let dropped = self.one.buffered() + self.two.buffered();
        self.one.clear();
        self.two.clear();
        dropped
    }

    pub fn push(&mut self, bytes: &[u8]) -> usize {
        match self.is_one {
            true => self.one.push(bytes),
            false => self.two.push(bytes),
        }
    }

    /// Bytes not used yet.
    pub fn buffered(&self) -> usize {
        match self.is_one {
            true => self.one.buffered(),
            false => self.two.buffered(),
        }
    }

    /// Bytes missing at least until there can be a frame.
    pub fn missing(&self) -> usize {
        match self.is_one {
            true => self.one.missing(),
            false => self.two.missing(),
        }
    }

    /// Hands the next frame to `accept` and returns what it says and how many bytes the frame took. An instruction,
    /// such as an adapter's echo of our own, gives no status.
    pub fn next<T>(&mut self, accept: impl FnOnce(Option<Status<'_>>) -> T) -> Option<(T, usize)> {
        if self.is_one {
            let frame = self.one.next_frame()?;
            let status = p1::Status::of(&frame);
            self.conditions = status.errors.conditions();
            let len = frame.wire_len();
            return Some((accept(Some(as_two(&status))), len));
        }
        let frame = self.two.next_frame()?;
        let len = frame.wire_len;
        Some((accept(Status::parse(&frame).ok()), len))
    }

    pub fn damage(&self) -> Damage {
        let (one, two) = (self.one.damage(), self.two.damage());
        Damage {
            stray_bytes: one.stray_bytes.saturating_add(two.stray_bytes),
            bad_crc: one.bad_crc.saturating_add(two.bad_crc),
        }
    }

    /// Bytes and frames of no use so far.
    pub fn waste(&self) -> u64 {
        let damage = self.damage();
        u64::from(damage.stray_bytes) + u64::from(damage.bad_crc)
    }
}

/// A status of Protocol 1.0 in terms of 2.0: error bits that tell how the servo is are its alert flag, the others the
/// nearest error code.
fn as_two<'a>(status: &p1::Status<'a>) -> Status<'a> {
    let refusals = status.errors.refusals().0;
    let error = [
        (Errors::INSTRUCTION, ErrorCode::Instruction),
        (Errors::CHECKSUM, ErrorCode::Crc),
        (Errors::RANGE, ErrorCode::DataRange),
        (Errors::ANGLE_LIMIT, ErrorCode::DataLimit),
    ]
    .into_iter()
    .find(|(bit, _)| refusals & bit != 0)
    .map_or(ErrorCode::None, |(_, error)| error);
    Status {
        id: status.id,
        alert: !status.errors.conditions().is_empty(),
        error,
        params: status.params,
    }
}
