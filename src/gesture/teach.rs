//! Teaching a gesture: a state machine from poses and marks to a definition, live or from a recording.
//!
//! Pure: time comes with samples, marks and ticks, all on the clock of the samples. A performer waits, marks
//! the start (or nobody does and a count-down runs from the first pose), performs, and the end is found:
//! - cyclic: as soon as the period is certain, by the highest peak of the autocorrelation over two to three
//!   periods (Rhodin 2016, section 9.3);
//! - non-cyclic: when the pose rests at an extreme, or turns back half of the way from it.
//!
//! A mark may end it earlier. Meanwhile every pose is judged against what is already defined
//! ([`Guidance`]), which is what a red-to-green bar shows.

use super::define::{FEWEST_FRAMES, define_non_cyclic, with_end, with_period};
use super::frames::{columns_of, frames_of, local_of};
use super::teach_search::{self as search, Found};
use super::teach_words::{Mark, TeachError, TeachOptions, TeachPhase, TeachView};
use super::{
    DefineError, Definition, GestureKind, GestureSet, Guidance, NonCyclicMarks, Novelty,
    PeriodEstimate,
};
use crate::pose::{PoseHeader, PoseSample, Recording, SampleFault};
use std::collections::VecDeque;

/// Samples kept: two minutes at 60 Hz.
const MOST_SAMPLES: usize = 8192;
/// Time kept from before the recording, seconds: what surrounds the start pose.
const BEFORE_S: f64 = 3.0;
/// The end is looked for this often, seconds.
const LOOK_EVERY_S: f64 = 0.1;
/// Time constant with which the judgement of a movement forgets, seconds.
const MOVEMENT_MEMORY_S: f64 = 0.8;

#[derive(Clone, Debug)]
enum State {
    Waiting,
    CountDown {
        until: f64,
    },
    /// From `since` on; begun at `begun`, before the performer moved.
    Recording {
        since: f64,
        begun: f64,
    },
    Over(Box<Result<Definition, TeachError>>),
}

/// From poses and marks to a definition.
#[derive(Clone, Debug)]
pub struct Teacher {
    set: GestureSet,
    stream: PoseHeader,
    options: TeachOptions,
    guidance: Guidance,
    /// Index in the stream of each point of the set.
    columns: Vec<usize>,
    state: State,
    samples: VecDeque<PoseSample>,
    places: Vec<[f64; 3]>,
    seen: Vec<bool>,
    now: f64,
    looked_at: f64,
    moved: bool,
    period: Option<PeriodEstimate>,
    pose: Option<Novelty>,
    movement: f64,
    accepted: bool,
}

impl Teacher {
    /// A teacher that adds to `set` (which may be empty) from a stream with `header`.
    ///
    /// # Errors
    /// Points of the set that the stream lacks, another dimension, an anchor that is no point.
    pub fn new(
        set: &GestureSet,
        header: &PoseHeader,
        options: TeachOptions,
    ) -> Result<Self, DefineError> {
        let columns = columns_of(set, header)?;
        let guidance = Guidance::new(set).map_err(|anchor| DefineError::Anchor { anchor })?;
        Ok(Self {
            set: set.clone(),
            stream: header.clone(),
            guidance,
            places: vec![[0.0; 3]; columns.len()],
            seen: vec![false; columns.len()],
            columns,
            state: State::Waiting,
            samples: VecDeque::with_capacity(MOST_SAMPLES),
            now: f64::NEG_INFINITY,
            looked_at: f64::NEG_INFINITY,
            moved: false,
            period: None,
            pose: None,
            movement: 0.0,
            accepted: false,
            options,
        })
    }

    /// Takes the next sample; one that is refused changes nothing.
    ///
    /// # Errors
    /// Another number of points than the header's, a number that is not finite, a time not later than the
    /// last.
    pub fn push(&mut self, sample: &PoseSample) -> Result<(), SampleFault> {
        if sample.points.len() != self.stream.points.len() {
            return Err(SampleFault::PointCount {
                found: sample.points.len(),
                expected: self.stream.points.len(),
            });
        }
        let finite = sample.points.iter().flatten().flatten();
        if !sample.t.is_finite() || !finite.clone().all(|v| v.abs() < 1e6) {
            return Err(SampleFault::NonFinite);
        }
        if let Some(last) = self.samples.back().map(|s| s.t).filter(|l| sample.t <= *l) {
            return Err(SampleFault::TimeBackwards { t: sample.t, last });
        }
        for (index, column) in self.columns.iter().enumerate() {
            if let Some(place) = sample.points[*column] {
                self.places[index] = place;
                self.seen[index] = true;
            }
        }
        let before = self.samples.back().map(|s| s.t);
        self.keep(sample);
        if self.seen.iter().all(|seen| *seen) {
            let novelty = self.guidance.judge(&self.places);
            let step = before.map_or(0.0, |t| sample.t - t);
            // A movement is as new as its newest pose: every gesture passes near the rest pose.
            self.movement *= (-step / MOVEMENT_MEMORY_S).exp();
            self.movement = self.movement.max(novelty.value);
            self.pose = Some(novelty);
            if self.options.hands_free && matches!(self.state, State::Waiting) {
                self.begin(sample.t);
            }
        }
        self.tick(sample.t);
        Ok(())
    }

    /// Keeps a sample and lets go of those that nobody will look at.
    fn keep(&mut self, sample: &PoseSample) {
        if self.samples.len() == MOST_SAMPLES {
            self.samples.pop_front();
        }
        self.samples.push_back(sample.clone());
        let needed_from = match self.state {
            State::Recording { since, .. } => since - BEFORE_S,
            _ => sample.t - BEFORE_S,
        };
        while self.samples.front().is_some_and(|s| s.t < needed_from) {
            self.samples.pop_front();
        }
    }

    /// Time goes on, with or without samples.
    pub fn tick(&mut self, t: f64) {
        if !t.is_finite() || t < self.now {
            return;
        }
        self.now = t;
        if let State::CountDown { until } = self.state
            && t >= until
        {
            self.record(until);
        }
        let State::Recording { since, begun } = self.state else {
            return;
        };
        if t - self.looked_at >= LOOK_EVERY_S {
            self.looked_at = t;
            self.look(since, begun);
        }
        if matches!(self.state, State::Recording { .. }) && t - begun > self.options.longest_s {
            self.wrap_up();
        }
    }

    /// A mark at time `t`.
    pub fn mark(&mut self, t: f64, mark: Mark) {
        self.tick(t);
        let cyclic = self.options.kind == GestureKind::Cyclic;
        let mark = match (mark, &self.state) {
            (Mark::Next, State::Waiting | State::CountDown { .. }) => Mark::Start,
            (Mark::Next, State::Recording { .. }) if cyclic => Mark::End,
            (Mark::Next, State::Recording { .. }) => Mark::Extreme,
            (Mark::Next, State::Over(outcome)) if outcome.is_ok() => Mark::Accept,
            (Mark::Next, State::Over(_)) => Mark::Start,
            (other, _) => other,
        };
        match (mark, &self.state) {
            (Mark::Cancel, _) => self.state = State::Over(Box::new(Err(TeachError::Cancelled))),
            (Mark::Start | Mark::Rest, State::Waiting | State::Over(_)) => self.begin(self.now),
            (Mark::End | Mark::Extreme, State::Recording { since, .. }) => self.end(*since),
            (Mark::Accept, State::Over(outcome)) => self.accepted = outcome.is_ok(),
            _ => {}
        }
    }

    /// The samples are over: what was recorded must do.
    pub fn finish(&mut self, t: f64) {
        self.tick(t);
        self.wrap_up();
    }

    fn wrap_up(&mut self) {
        match self.state {
            State::Recording { since, .. } => {
                let outcome = self.conclude(since, None);
                self.over(outcome);
            }
            State::Waiting | State::CountDown { .. } => {
                let complete = self.seen.iter().all(|seen| *seen);
                let outcome = if complete {
                    Err(TeachError::NothingMoved {
                        seconds: 0.0,
                        moved_mm: 0.0,
                        needed_mm: 1e3 * self.needed_m(),
                    })
                } else {
                    Err(TeachError::NoPoses(self.never_seen()))
                };
                self.over(outcome);
            }
            State::Over(_) => {}
        }
    }

    fn never_seen(&self) -> Vec<String> {
        let names = self.set.header.points.iter().zip(&self.seen);
        names
            .filter(|(_, s)| !**s)
            .map(|(n, _)| n.clone())
            .collect()
    }

    fn begin(&mut self, t: f64) {
        let count_down_s = self.options.count_down_s.clamp(0.0, 60.0);
        self.accepted = false;
        if count_down_s > 0.0 {
            self.state = State::CountDown {
                until: t + count_down_s,
            };
        } else {
            self.record(t);
        }
    }

    fn record(&mut self, since: f64) {
        self.moved = false;
        self.period = None;
        self.looked_at = since;
        self.state = State::Recording {
            since,
            begun: since,
        };
    }

    fn over(&mut self, outcome: Result<Definition, TeachError>) {
        self.state = State::Over(Box::new(outcome));
    }

    /// Movement that counts as one, root mean square over the points, metres.
    fn needed_m(&self) -> f64 {
        search::MOVED * crate::pose::global::size_of(&self.places).max(1e-3)
    }

    /// What was recorded, with its poses without global motion fitted to the sample at `since`.
    fn recorded(&self, since: f64) -> Result<search::Motion, TeachError> {
        let recording = Recording {
            header: self.stream.clone(),
            samples: self.samples.iter().cloned().collect(),
        };
        let frames = frames_of(&self.set, &recording)?;
        let start = recording.samples.partition_point(|s| s.t < since - 1e-9);
        let start = start.min(recording.samples.len().saturating_sub(1));
        Ok(search::Motion {
            local: local_of(&self.set, &frames, start)?,
            recording,
            start,
            points: self.columns.len(),
            needed_m: self.needed_m(),
        })
    }

    /// Looks for the end.
    fn look(&mut self, since: f64, begun: f64) {
        let Ok(motion) = self.recorded(since) else {
            return;
        };
        self.moved = self.moved || motion.moved_m() > motion.needed_m;
        if !self.moved {
            if self.options.hands_free
                && self.options.kind == GestureKind::Cyclic
                && self.now - since > search::SETTLED_S
            {
                // The performer has not begun: the recording waits for him, up to its longest.
                self.state = State::Recording {
                    since: self.now - 0.5 * search::SETTLED_S,
                    begun,
                };
            }
            return;
        }
        match self.options.kind {
            GestureKind::Cyclic => {
                let period = motion.period();
                let before = std::mem::replace(&mut self.period, period);
                if motion.is_certain(before, period) {
                    let outcome = self.conclude(since, period);
                    self.over(outcome);
                }
            }
            GestureKind::NonCyclic => {
                if let Some(found) = motion.extreme() {
                    let outcome = self.non_cyclic(&motion.recording, found);
                    self.over(outcome);
                }
            }
        }
    }

    fn non_cyclic(&self, recording: &Recording, found: Found) -> Result<Definition, TeachError> {
        let (name, source) = (&self.options.name, &self.options.source);
        let marks = NonCyclicMarks {
            rest_s: found.rest_s,
            extreme_s: found.extreme_s,
        };
        Ok(define_non_cyclic(
            &self.set, recording, name, source, marks,
        )?)
    }

    /// The end mark.
    fn end(&mut self, since: f64) {
        let outcome = self.marked(since);
        self.over(outcome);
    }

    fn marked(&self, since: f64) -> Result<Definition, TeachError> {
        let motion = self.recorded(since)?;
        let (recording, start) = (&motion.recording, motion.start);
        let frames = recording.samples.len() - start;
        if frames < FEWEST_FRAMES {
            return Err(TeachError::TooShort { frames });
        }
        let end_s = recording.span_s().1;
        let (name, source) = (&self.options.name, &self.options.source);
        match self.options.kind {
            GestureKind::NonCyclic => {
                let rest_s = recording.samples[start].t;
                let found = Found {
                    rest_s,
                    extreme_s: end_s,
                };
                self.non_cyclic(recording, found)
            }
            GestureKind::Cyclic => {
                // Several periods tell their length better than a hand on a key; one is as marked.
                match motion.period().filter(|p| motion.spans(p, search::EARLY)) {
                    Some(_) => self.conclude(since, motion.period()),
                    None => Ok(with_end(&self.set, recording, name, source, since, end_s)?),
                }
            }
        }
    }

    /// A definition from all that was recorded, or why not.
    fn conclude(
        &self,
        since: f64,
        period: Option<PeriodEstimate>,
    ) -> Result<Definition, TeachError> {
        if self.samples.is_empty() || !self.seen.iter().all(|seen| *seen) {
            return Err(TeachError::NoPoses(self.never_seen()));
        }
        let motion = self.recorded(since)?;
        let (recording, start) = (&motion.recording, motion.start);
        let seconds = (self.now - since).max(0.0);
        let moved_m = motion.moved_m();
        if moved_m <= motion.needed_m {
            return Err(TeachError::NothingMoved {
                seconds,
                moved_mm: 1e3 * moved_m,
                needed_mm: 1e3 * motion.needed_m,
            });
        }
        if self.options.kind == GestureKind::NonCyclic {
            return match motion.extreme() {
                Some(found) => self.non_cyclic(recording, found),
                None => Err(TeachError::NoExtreme { seconds }),
            };
        }
        let period = period.or_else(|| motion.period());
        let periodicity = period.map_or(0.0, |p| p.periodicity);
        let Some(period) =
            period.filter(|p| p.periodicity >= search::PERIODIC && motion.spans(p, search::LEAST))
        else {
            return Err(TeachError::NoPeriod {
                seconds,
                periodicity,
            });
        };
        let start_s = if self.options.hands_free {
            motion.best_start(period.period_s)
        } else {
            recording.samples[start].t
        };
        let (name, source) = (&self.options.name, &self.options.source);
        Ok(with_period(
            &self.set, recording, name, source, start_s, period,
        )?)
    }

    /// What a user interface shows.
    pub fn view(&self) -> TeachView {
        let recorded_s = match self.state {
            State::Recording { since, .. } => (self.now - since).max(0.0),
            _ => 0.0,
        };
        let (phase, left_s) = match &self.state {
            State::Waiting => (TeachPhase::Waiting, 0.0),
            State::CountDown { until } => (TeachPhase::CountDown, (until - self.now).max(0.0)),
            State::Recording { .. } => (TeachPhase::Recording, 0.0),
            State::Over(outcome) => match outcome.as_ref() {
                Ok(_) => (TeachPhase::Done, 0.0),
                Err(TeachError::Cancelled) => (TeachPhase::Cancelled, 0.0),
                Err(_) => (TeachPhase::Failed, 0.0),
            },
        };
        TeachView {
            phase,
            left_s,
            recorded_s,
            pose: self.pose,
            movement: self.movement,
            moved: self.moved,
            period: self.period,
        }
    }

    /// The definition, or why there is none; `None` while the work goes on.
    pub fn outcome(&self) -> Option<&Result<Definition, TeachError>> {
        match &self.state {
            State::Over(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// Whether the result was accepted by a mark.
    pub fn accepted(&self) -> bool {
        self.accepted
    }

    /// Samples held now; never over a fixed bound, however long the stream.
    pub fn held(&self) -> usize {
        self.samples.len()
    }
}
