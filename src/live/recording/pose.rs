//! A pose sample in a log, bit for bit.

use crate::bus::tap::Entry;
use crate::bus::tap::event::{Fields, begin_pose};
use crate::pose::PoseSample;

/// Bytes of a count.
fn count_bytes(count: usize) -> usize {
    (usize::BITS - count.leading_zeros()).div_ceil(7).max(1) as usize
}

/// Appends `sample` as an event. Allocates nothing.
pub fn write(sample: &PoseSample, entry: &mut Entry<'_>) {
    let (points, channels) = (&sample.points, &sample.channels);
    let seen = points.iter().flatten().count();
    let told = channels.iter().flatten().count();
    let counts = [points.len(), sample.confidence.len(), channels.len()];
    let bytes = 8 * (1 + 3 * seen + sample.confidence.len() + told)
        + points.len()
        + channels.len()
        + counts.iter().copied().map(count_bytes).sum::<usize>();
    begin_pose(entry, bytes);
    entry.float(sample.t);
    entry.number(points.len() as u64);
    for point in points {
        entry.byte(u8::from(point.is_some()));
        for value in point.iter().flatten() {
            entry.float(*value);
        }
    }
    entry.number(sample.confidence.len() as u64);
    for value in &sample.confidence {
        entry.float(*value);
    }
    entry.number(channels.len() as u64);
    for channel in channels {
        entry.byte(u8::from(channel.is_some()));
        if let Some(value) = channel {
            entry.float(*value);
        }
    }
}

/// Reads a sample from an event's bytes; `None` when they are none.
pub fn read(bytes: &[u8]) -> Option<PoseSample> {
    let mut fields = Fields(bytes);
    let t = fields.float()?;
    let points = (0..fields.count()?)
        .map(|_| {
            Some(match fields.byte()? {
                0 => None,
                _ => Some([fields.float()?, fields.float()?, fields.float()?]),
            })
        })
        .collect::<Option<_>>()?;
    let confidence = (0..fields.count()?)
        .map(|_| fields.float())
        .collect::<Option<_>>()?;
    let channels = (0..fields.count()?)
        .map(|_| {
            Some(match fields.byte()? {
                0 => None,
                _ => Some(fields.float()?),
            })
        })
        .collect::<Option<_>>()?;
    fields.0.is_empty().then_some(PoseSample {
        t,
        points,
        confidence,
        channels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Time;
    use crate::bus::tap::{Event, Events, Log};

    #[test]
    fn samples_come_back_bit_for_bit_and_damaged_ones_not_at_all() {
        let sample = PoseSample {
            t: 0.1 + 0.2,
            points: vec![Some([f64::MIN_POSITIVE, -0.0, 3.0]), None],
            confidence: vec![0.5; 130],
            channels: vec![None, Some(f64::MAX)],
        };
        let log = Log::new("control", 1 << 14);
        log.write(|entry| write(&sample, entry));
        let mut bytes = Vec::new();
        log.take(&mut bytes);
        let mut events = Events::new(&bytes, Time::ZERO);
        let Some(Event::Pose(payload)) = events.next() else {
            panic!("no pose in {bytes:?}");
        };
        assert_eq!(events.remaining(), 0, "the length is the payload's");
        let again = read(payload).expect("a sample");
        assert_eq!(format!("{again:?}"), format!("{sample:?}"));
        for cut in 0..payload.len() {
            assert!(read(&payload[..cut]).is_none(), "cut at {cut}");
        }
    }
}
