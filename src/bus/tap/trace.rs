//! Logged bytes in words: instructions and statuses decoded, for people who look at a recording.

use super::event::Event;
use handwave_dynamixel::{Frame, FrameParser, Instruction, Status, frame};
use std::fmt::Write;

/// Bytes as hexadecimal pairs without spaces.
pub fn hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Name and id of what is in `bytes`, such as `sync_write to 254` or `status of 7`; several are joined by commas.
///
/// Combined statuses of fast reads have one prefix and no frame of their own; they are named `fast_status`.
pub fn words(bytes: &[u8]) -> String {
    let mut parser = FrameParser::<4096>::new();
    let mut text = Vec::new();
    for piece in bytes.chunks(2048) {
        parser.push(piece);
        while let Some(frame) = parser.next_frame() {
            text.push(name(&frame));
        }
    }
    if text.is_empty() && bytes.starts_with(&frame::HEADER) && bytes.get(7) == Some(&frame::STATUS)
    {
        return "fast_status".into();
    }
    text.join(", ")
}

fn name(frame: &Frame<'_>) -> String {
    if let Ok(status) = Status::parse(frame) {
        let alert = if status.alert { ", alert" } else { "" };
        let bytes = status.params.len();
        return if status.id == handwave_dynamixel::BROADCAST_ID {
            format!("fast_status ({bytes} bytes)")
        } else if status.error == handwave_dynamixel::ErrorCode::None {
            format!("status of {} ({bytes} bytes{alert})", status.id)
        } else {
            format!("status of {} (error {:?}{alert})", status.id, status.error)
        };
    }
    match Instruction::parse(frame) {
        Ok(instruction) => format!("{} to {}", instruction_name(&instruction), frame.id),
        Err(_) => format!("frame to {}", frame.id),
    }
}

fn instruction_name(instruction: &Instruction<'_>) -> String {
    // The variant's name in snake case, with the register where it has one.
    let debug = format!("{instruction:?}");
    let variant = debug
        .split(|c: char| !c.is_alphanumeric())
        .next()
        .unwrap_or("");
    let mut name = String::new();
    for (at, letter) in variant.char_indices() {
        if letter.is_uppercase() && at > 0 {
            name.push('_');
        }
        name.extend(letter.to_lowercase());
    }
    let register = match instruction {
        Instruction::Read { address, .. }
        | Instruction::Write { address, .. }
        | Instruction::RegWrite { address, .. } => Some(*address),
        Instruction::SyncRead(read) | Instruction::FastSyncRead(read) => Some(read.address),
        Instruction::SyncWrite(write) => Some(write.address),
        _ => None,
    };
    match register {
        Some(address) => format!("{name} at {address}"),
        None => name,
    }
}

/// An event in words: what was asked or sent, frames decoded, bytes in full.
pub fn describe(event: &Event<'_>) -> String {
    let bytes = |what: &str, bytes: &[u8]| {
        let words = words(bytes);
        let named = if words.is_empty() {
            String::new()
        } else {
            format!("{words}: ")
        };
        format!("{what} {} bytes, {named}{}", bytes.len(), hex(bytes))
    };
    match event {
        Event::Write(_, sent) => bytes("sending", sent),
        Event::Read(_, received) => bytes("reading", received),
        Event::Fault(fault) => format!(
            "a failure of the port ({})",
            String::from_utf8_lossy(fault.reason)
        ),
        other => other.kind().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_named() {
        let mut buf = [0; 64];
        let ping = Instruction::Ping
            .encode(7, &mut buf)
            .expect("room")
            .to_vec();
        let mut buf = [0; 64];
        let write = Instruction::Write {
            address: 64,
            data: &[1],
        };
        let write = write.encode(3, &mut buf).expect("room").to_vec();
        assert_eq!(words(&ping), "ping to 7");
        assert_eq!(
            words(&[ping, write].concat()),
            "ping to 7, write at 64 to 3"
        );
        assert_eq!(words(&[1, 2, 3]), "");
        assert_eq!(hex(&[0, 0xAB]), "00ab");
    }
}
