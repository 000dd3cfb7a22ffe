//! Teaching a gesture from a source: samples, keys and the clock brought to the teacher, its state shown.

use super::feed::Feed;
use super::keys::Keys;
use super::stop::{StopRequest, StopSwitch};
use crate::base::Clock;
use crate::gesture::{Definition, Mark, TeachError, TeachView, Teacher};
use crate::pose::PoseSample;
use std::time::Duration;

/// The teacher is looked after this often.
const EVERY: Duration = Duration::from_millis(10);
/// Samples taken at a time.
const SAMPLES: usize = 1024;
/// A channel above this is a pressed button.
const PRESSED: f64 = 0.5;

/// What a lesson works with.
pub struct Lesson<'a> {
    /// The state machine.
    pub teacher: &'a mut Teacher,
    /// The poses.
    pub feed: &'a mut dyn Feed,
    /// Their time.
    pub clock: &'a dyn Clock,
    /// Ctrl-C.
    pub stop: &'a StopSwitch,
    /// Index of the channel whose rise is a mark: a button of the tracker's own.
    pub mark_channel: Option<usize>,
    /// Keys of the terminal.
    pub keys: Option<Keys>,
    /// Somebody looks at the result before it is taken; without, it is taken, or the lesson fails.
    pub asks: bool,
}

/// How a lesson ended.
#[derive(Debug)]
pub enum Taught {
    /// There is a definition that was accepted.
    Accepted(Box<Definition>),
    /// There is none.
    Failed(TeachError),
    /// Ctrl-C.
    Interrupted,
}

/// Runs a lesson to its end; `show` sees the teacher some times a second and after every change.
pub fn teach(mut lesson: Lesson<'_>, show: &mut dyn FnMut(&Teacher, &TeachView)) -> Taught {
    let mut samples: Vec<PoseSample> = Vec::with_capacity(SAMPLES);
    let mut pressed = true;
    lesson.feed.begin(lesson.clock.now().secs());
    loop {
        if lesson.stop.request() != StopRequest::None {
            return Taught::Interrupted;
        }
        let now = lesson.clock.now();
        lesson.feed.take(now.secs(), &mut samples);
        for sample in &samples {
            // What the reader let pass is refused here only where a restarted sender overlaps itself.
            let _ = lesson.teacher.push(sample);
            let value = lesson.mark_channel.and_then(|c| sample.channels.get(c));
            if let Some(value) = value.copied().flatten() {
                if value > PRESSED && !pressed {
                    lesson.teacher.mark(sample.t, Mark::Next);
                }
                pressed = value > PRESSED;
            }
        }
        lesson.feed.give_back(&mut samples);
        lesson.teacher.tick(now.secs());
        while let Some(mark) = lesson.keys.as_mut().and_then(Keys::mark) {
            lesson.teacher.mark(now.secs(), mark);
        }
        let ended = lesson.feed.ended();
        if ended {
            lesson.teacher.finish(now.secs());
        }
        show(lesson.teacher, &lesson.teacher.view());
        match lesson.teacher.outcome() {
            Some(Ok(found)) if lesson.teacher.accepted() || !lesson.asks => {
                return Taught::Accepted(Box::new(found.clone()));
            }
            Some(Err(error)) if !lesson.asks || ended || matches!(error, TeachError::Cancelled) => {
                return Taught::Failed(error.clone());
            }
            _ => {}
        }
        lesson.clock.sleep_until(now + EVERY);
    }
}
