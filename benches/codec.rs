//! How long the codec takes for one control cycle of twelve servos: goals out, fast answer in.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave_dynamixel::fast::{self, Blocks};
use handwave_dynamixel::lists::encode_sync_write;
use handwave_dynamixel::{Crc, FrameParser, Status};
use std::hint::black_box;

const SERVOS: u8 = 12;
/// Load, velocity, position.
const STATE_BYTES: usize = 10;

fn state(id: u8) -> [u8; STATE_BYTES] {
    [id, 0, 3, 0, 0, 0, 0, 8, 0, 0]
}

fn combined_status() -> Vec<u8> {
    let mut line = Vec::new();
    let mut crc = Crc::new();
    let mut buf = [0; 32];
    let blocks_len = u16::from(SERVOS) * 14;
    line.extend(fast::encode_prefix(&mut buf, blocks_len, &mut crc).expect("room"));
    for id in 1..=SERVOS {
        line.extend(fast::encode_block(&mut buf, 0, id, &state(id), &mut crc).expect("room"));
    }
    line
}

fn statuses() -> Vec<u8> {
    let mut line = Vec::new();
    for id in 1..=SERVOS {
        let status = Status {
            id,
            alert: false,
            error: Default::default(),
            params: &state(id),
        };
        line.extend(status.encode(&mut [0; 64]).expect("room").iter());
    }
    line
}

fn cycle(criterion: &mut Criterion) {
    let mut buf = [0; 256];
    criterion.bench_function("encode_goals_of_12", |bencher| {
        bencher.iter(|| {
            let goals = (1..=SERVOS).map(|id| (id, (2048 + i32::from(id)).to_le_bytes()));
            encode_sync_write(&mut buf, 116, 4, black_box(goals)).map(<[u8]>::len)
        });
    });
    let line = combined_status();
    criterion.bench_function("decode_fast_answer_of_12", |bencher| {
        bencher.iter(|| {
            let line = black_box(&line[..]);
            let begin = fast::find_prefix(line, u16::from(SERVOS) * 14).unwrap_or(0);
            let mut blocks = Blocks::new(&line[begin..]);
            (1..=SERVOS)
                .filter_map(|id| blocks.next_block(id, STATE_BYTES).ok())
                .map(|block| u32::from(block.data[6]))
                .sum::<u32>()
        });
    });
    let line = statuses();
    let mut parser = FrameParser::<512>::new();
    criterion.bench_function("decode_ordinary_answers_of_12", |bencher| {
        bencher.iter(|| {
            parser.push(black_box(&line[..]));
            let mut sum = 0;
            while let Some(frame) = parser.next_frame() {
                sum += Status::parse(&frame).map_or(0, |status| u32::from(status.params[6]));
            }
            sum
        });
    });
}

criterion_group!(benches, cycle);
criterion_main!(benches);
