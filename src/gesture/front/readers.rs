//! One reader per gesture and neighbourhood of the motion graph: its plane and what reads it.

use crate::base::angle::wrap_tau;
use crate::gesture::figure::{self, Figure};
use crate::gesture::foreign::{Span, Trust};
use crate::gesture::wave::ProgressionSmoother;
use crate::gesture::{
    Estimator, EstimatorKind, GestureKind, GestureOptions, GestureSet, Plane, References,
};
use std::f64::consts::TAU;

/// Amplitude, frequency and phase of one gesture.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct GestureEstimate {
    /// Cyclic: 0 = not performed, 1 = as large as shown. Non-cyclic: progression, 0 at rest, 1 at
    /// the extreme. Not clamped.
    pub amplitude: f64,
    /// Cycles per second, negative in the opposite sense; 0 for non-cyclic gestures.
    pub frequency_hz: f64,
    /// [0, 2 pi); for non-cyclic gestures 2 pi times the progression, wrapped.
    pub phase_rad: f64,
    /// Cyclic: how much of the motion is that wave; non-cyclic: share of points seen. 0..1.
    pub quality: f64,
    /// Whether the gesture repeats.
    pub kind: GestureKind,
}

impl GestureEstimate {
    /// Not performed.
    pub(super) fn silent(kind: GestureKind) -> Self {
        Self {
            amplitude: 0.0,
            frequency_hz: 0.0,
            phase_rad: 0.0,
            quality: 0.0,
            kind,
        }
    }
}

/// Two planes whose answers differ by less than this to every frame that either knows are one.
const SAME_ANSWER: f64 = 0.05;

/// How one gesture is read.
enum Reading {
    Wave(Box<dyn Estimator>),
    Progression(ProgressionSmoother),
}

struct Reader {
    gesture: usize,
    /// Gestures that its plane keeps apart from its own.
    known: Vec<usize>,
    plane: Plane,
    trust: Trust,
    figure: Figure,
    reading: Reading,
    estimate: GestureEstimate,
}

/// Readers of all gestures in all neighbourhoods of the motion graph.
///
/// Only gestures that can be performed from the place where one is in the graph compete (Rhodin 2016,
/// section 9.4.1), so a gesture may have another plane at another place. A wave estimator's history
/// lives on one plane; so every plane that differs has an estimator of its own, all of them are
/// kept warm, and going from node to node only changes which ones are listened to.
pub(super) struct Readers {
    readers: Vec<Reader>,
    span: Span,
    /// Pairs of readers of one neighbourhood whose gestures move in the same directions.
    rivals: Vec<(usize, usize)>,
    /// Per reader: a rival's figure is performed.
    wrong: Vec<bool>,
    last_t: Option<f64>,
    /// Per neighbourhood and gesture its reader; `None` where the gesture is out of reach.
    sets: Vec<Vec<Option<usize>>>,
    /// Neighbourhood of each node.
    set_of_node: Vec<usize>,
    active: usize,
    estimates: Vec<GestureEstimate>,
    with_variance: bool,
}

impl Readers {
    /// Trains what differs. `neighbourhoods`: per node the gestures that compete there.
    pub fn new(
        set: &GestureSet,
        references: &References,
        estimator: EstimatorKind,
        settings: &GestureOptions,
        neighbourhoods: &[Vec<usize>],
    ) -> Self {
        let mut distinct: Vec<Vec<usize>> = Vec::new();
        let mut set_of_node = Vec::new();
        for gestures in neighbourhoods {
            let mut gestures = gestures.clone();
            gestures.retain(|gesture| *gesture < set.gestures.len());
            gestures.sort_unstable();
            gestures.dedup();
            let known = distinct.iter().position(|other| *other == gestures);
            set_of_node.push(known.unwrap_or(distinct.len()));
            if known.is_none() {
                distinct.push(gestures);
            }
        }
        let mut readers: Vec<Reader> = Vec::new();
        let mut sets = Vec::new();
        for known in &distinct {
            let mut row = vec![None; set.gestures.len()];
            for gesture in known {
                let competes = |other: usize| known.contains(&other);
                let plane = Plane::train_among(set, references, *gesture, competes);
                let same = readers.iter().position(|reader| {
                    reader.gesture == *gesture && answer_alike(references, reader, &plane, known)
                });
                row[*gesture] = Some(same.unwrap_or(readers.len()));
                if same.is_none() {
                    let kind = set.gestures[*gesture].kind;
                    readers.push(Reader {
                        gesture: *gesture,
                        known: known.clone(),
                        reading: match kind {
                            GestureKind::Cyclic => {
                                Reading::Wave(estimator.build(settings, plane.shape()))
                            }
                            GestureKind::NonCyclic => Reading::Progression(
                                ProgressionSmoother::new(settings.progression_smoothing_s),
                            ),
                        },
                        figure: Figure::new(set, references, *gesture),
                        trust: Trust::new(
                            references,
                            *gesture,
                            set.gestures[*gesture].duration_s,
                            &plane,
                        ),
                        plane,
                        estimate: GestureEstimate::silent(kind),
                    });
                }
            }
            sets.push(row);
        }
        let kinds = set.gestures.iter().map(|gesture| gesture.kind);
        let mut rivals = Vec::new();
        for (one, reader) in readers.iter().enumerate() {
            for (other, rival) in readers.iter().enumerate().skip(one + 1) {
                let together = sets.iter().any(|row: &Vec<Option<usize>>| {
                    row.contains(&Some(one)) && row.contains(&Some(other))
                });
                let waves = [reader, rival].map(|r| r.estimate.kind) == [GestureKind::Cyclic; 2];
                if together && waves && reader.figure.rivals(&rival.figure) {
                    rivals.push((one, other));
                }
            }
        }
        Self {
            rivals,
            wrong: vec![false; readers.len()],
            last_t: None,
            readers,
            span: Span::new(set, references),
            sets,
            set_of_node,
            active: 0,
            estimates: kinds.map(GestureEstimate::silent).collect(),
            with_variance: settings.under_constrained && estimator.reads_variance(),
        }
    }

    /// Reads the flat pose at `t`, of which the share `seen` was seen.
    pub fn push(&mut self, t: f64, flat: &[f64], seen: f64) {
        let outside = self.span.outside(flat);
        for reader in &mut self.readers {
            let (plane, estimate) = (&reader.plane, &mut reader.estimate);
            match &mut reader.reading {
                Reading::Wave(estimator) => {
                    let mut point = plane.apply(flat, self.with_variance);
                    point.trust = reader.trust.push(t, outside, point.z);
                    estimator.push(t, point);
                    let wave = estimator.estimate();
                    estimate.amplitude = wave.amplitude;
                    estimate.frequency_hz = wave.frequency_hz;
                    estimate.phase_rad = wave.phase_rad;
                    estimate.quality = wave.quality;
                }
                Reading::Progression(smoother) => {
                    let progression = smoother.push(t, plane.apply(flat, false).z[0]);
                    estimate.amplitude = progression;
                    estimate.phase_rad = wrap_tau(TAU * progression);
                    estimate.quality = seen;
                }
            }
        }
        self.compete(t, flat);
        self.gather();
    }

    /// Takes back the amplitude of gestures whose figure is not the one performed.
    fn compete(&mut self, t: f64, flat: &[f64]) {
        let dt = self.last_t.replace(t).map_or(0.0, |last| t - last);
        for index in 0..self.readers.len() {
            let rival = |(one, other): &(usize, usize)| *one == index || *other == index;
            if self.rivals.iter().any(rival) {
                let Reader {
                    figure, estimate, ..
                } = &mut self.readers[index];
                figure.push(t, flat, estimate.amplitude, estimate.phase_rad);
            }
        }
        let left = |index: usize| {
            let reader = &self.readers[index];
            reader.figure.left(reader.estimate.amplitude)
        };
        for index in 0..self.readers.len() {
            let wrong = self.rivals.iter().any(|(one, other)| {
                let rival = match index {
                    i if i == *one => *other,
                    i if i == *other => *one,
                    _ => return false,
                };
                matches!((left(index), left(rival)), (Some(own), Some(best)) if figure::wrong(own, best))
            });
            self.wrong[index] = wrong;
        }
        for (reader, wrong) in self.readers.iter_mut().zip(&self.wrong) {
            reader.estimate.amplitude *= reader.figure.settle(dt, *wrong);
        }
    }

    /// Listens to the neighbourhood of `node`; one that does not exist changes nothing.
    pub fn set_active(&mut self, node: usize) {
        if let Some(set) = self.set_of_node.get(node)
            && *set != self.active
        {
            self.active = *set;
            self.gather();
        }
    }

    fn gather(&mut self) {
        let row = &self.sets[self.active];
        for (estimate, reader) in self.estimates.iter_mut().zip(row) {
            *estimate = match reader {
                Some(index) => self.readers[*index].estimate,
                None => GestureEstimate::silent(estimate.kind),
            };
        }
    }

    /// The estimates at the last sample, one per gesture; one that is out of reach is silent.
    pub fn estimates(&self) -> &[GestureEstimate] {
        &self.estimates
    }

    /// Number of planes that are read.
    pub fn planes(&self) -> usize {
        self.readers.len()
    }

    /// Forgets all samples; the neighbourhood stays.
    pub fn reset(&mut self) {
        for reader in &mut self.readers {
            reader.trust.reset();
            reader.figure.reset();
            match &mut reader.reading {
                Reading::Wave(estimator) => estimator.reset(),
                Reading::Progression(smoother) => smoother.reset(),
            }
            reader.estimate = GestureEstimate::silent(reader.estimate.kind);
        }
        self.last_t = None;
        self.gather();
    }
}

/// Whether `plane`, trained among `known`, would tell the same as the reader's own plane.
fn answer_alike(references: &References, reader: &Reader, plane: &Plane, known: &[usize]) -> bool {
    let frames = reader.known.iter().chain(known);
    frames
        .flat_map(|gesture| &references.local[*gesture])
        .all(|row| {
            let [one, other] = [&reader.plane, plane].map(|p| p.apply(row.as_slice(), false).z);
            (one[0] - other[0]).hypot(one[1] - other[1]) < SAME_ANSWER
        })
}
