//! The linear map from a pose to a gesture's plane (Rhodin 2016, section 9.4.1, eq. 9.1 and 9.2).

use super::figure::Figure;
use super::{GestureKind, GestureSet, PlanePoint, Shape};
use crate::pose::GlobalFit;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Frames, even in phase, to which a reference is brought for the nearest-neighbour test.
const NEIGHBOUR_FRAMES: usize = 64;
/// Nearest frames that are asked (the thesis's n).
const NEIGHBOURS: usize = 10;
/// Variance that ten neighbours on a loop may have: with it a loop never looks like a line.
const LOOP_SPREAD: f64 = 0.3;
/// Weight of every gesture's frames together in the regression, so that neither the tracker's rate
/// nor a gesture's length decides how much it counts.
const BLOCK_WEIGHT: f64 = 100.0;
/// Share of a gesture's energy below which a direction of movement is not relied on.
const FAINT: f64 = 0.018;
/// Weight of the gesture's own mean pose, a rest pose where amplitude is zero.
const REST_WEIGHT: f64 = 25.0;
/// Share of its target that a component must explain to count at all, and to be brought to full size.
const EXPLAINED: (f64, f64) = (0.3, 0.65);

/// The reference frames of a set without their global motion, ready for training.
#[derive(Clone, Debug)]
pub struct References {
    /// Removes global motion, of references and live poses alike.
    pub fit: GlobalFit,
    /// Per gesture one flat row (x, y, z per point) per frame, metres.
    pub local: Vec<Vec<DVector<f64>>>,
    /// Per gesture its mean pose over time.
    pub mean: Vec<DVector<f64>>,
    /// Root mean square distance of a frame from its gesture's mean, over all gestures, metres.
    pub scale_m: f64,
    /// How far any point gets from its mean place in a gesture, metres.
    pub reach_m: f64,
}

impl References {
    /// Removes the global motion of all frames of `set`.
    ///
    /// # Errors
    /// The name of an anchor that the set does not have.
    pub fn new(set: &GestureSet) -> Result<Self, String> {
        let mut fit = GlobalFit::new(&set.header, &set.reference, &set.global)?;
        let frames = || set.gestures.iter().flat_map(|gesture| &gesture.frames);
        // Twice: the first weights come from a fit to which the gestures themselves still belonged.
        // Not oftener: the weights would gather on whichever point moves least.
        for _ in 0..2 {
            fit.weigh(frames().map(Vec::as_slice));
        }
        let mut out = vec![[0.0; 3]; set.header.points.len()];
        let mut flat = |frame: &Vec<[f64; 3]>| {
            fit.remove(frame, None, &mut out);
            DVector::from_iterator(out.len() * 3, out.iter().flatten().copied())
        };
        let mut local: Vec<Vec<DVector<f64>>> = set
            .gestures
            .iter()
            .map(|gesture| gesture.frames.iter().map(&mut flat).collect())
            .collect();
        if local.is_empty() {
            // Without gestures (a pose map alone) the reference frame is all that is known of poses.
            local.push(vec![flat(&set.reference)]);
        }
        let mean: Vec<DVector<f64>> = local
            .iter()
            .map(|rows| {
                rows.iter().fold(
                    DVector::zeros(set.header.points.len() * 3),
                    |sum: DVector<f64>, row| sum + row,
                ) / rows.len().max(1) as f64
            })
            .collect();
        let sizes = local
            .iter()
            .zip(&mean)
            .map(|(rows, mean)| size_of(rows, mean));
        let square: f64 = sizes.map(|size| size * size).sum();
        let scale_m = (square / local.len().max(1) as f64).sqrt();
        let mut reach_m = 0.0_f64;
        for (rows, mean) in local.iter().zip(&mean) {
            for row in rows {
                let away = row - mean;
                let squares = away
                    .as_slice()
                    .chunks(3)
                    .map(|p| p.iter().map(|v| v * v).sum());
                reach_m = squares.fold(reach_m, |most, square: f64| most.max(square.sqrt()));
            }
        }
        Ok(Self {
            fit,
            local,
            mean,
            scale_m,
            reach_m,
        })
    }
}

/// Ridge regression of `z` on `x` (rows are weighted samples), by singular values.
///
/// Beside the ridge of eq. 9.2, a direction fades out in which the pose moves by less than
/// [`FAINT`] of the gesture's energy: the regression would blow it up to tell the phase by it, and
/// another performer, or the same one tomorrow, moves differently there.
fn solve(x: DMatrix<f64>, z: &DMatrix<f64>, ridge: f64) -> DMatrix<f64> {
    let (dim, faint) = (x.ncols(), FAINT * BLOCK_WEIGHT);
    let svd = x.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return DMatrix::zeros(dim, 2);
    };
    let mut onto = u.transpose() * z;
    for (k, value) in svd.singular_values.iter().enumerate() {
        let square = value * value;
        let gain = if square > 1e-12 {
            value / (square + ridge + faint * faint / square)
        } else {
            0.0
        };
        onto.row_mut(k).scale_mut(gain);
    }
    v.transpose() * onto
}

/// Per component the share of its targets that the plane explains.
fn explained(plane: &Plane, rows: &[DVector<f64>], own: &[[f64; 2]]) -> [f64; 2] {
    let (mut product, mut square) = ([0.0; 2], [0.0; 2]);
    for (row, target) in rows.iter().zip(own) {
        let z = plane.linear(row.as_slice());
        for component in 0..2 {
            product[component] += z[component] * target[component];
            square[component] += target[component] * target[component];
        }
    }
    std::array::from_fn(|c| {
        if square[c] > 0.0 {
            product[c] / square[c]
        } else {
            0.0
        }
    })
}

/// Root mean square distance of the frames from their mean, metres; 1 where nothing moves.
fn size_of(rows: &[DVector<f64>], mean: &DVector<f64>) -> f64 {
    let square: f64 = rows.iter().map(|row| (row - mean).norm_squared()).sum();
    let size = (square / rows.len().max(1) as f64).sqrt();
    if size > 0.0 { size } else { 1.0 }
}

/// Target of frame `k` on the gesture's plane before the phase is shifted.
pub(super) fn targets(set: &GestureSet, references: &References, index: usize) -> Vec<[f64; 2]> {
    let gesture = &set.gestures[index];
    let duration = gesture.duration_s.max(1e-9);
    if gesture.kind == GestureKind::NonCyclic {
        return gesture
            .times_s
            .iter()
            .map(|t| [t / duration, 0.0])
            .collect();
    }
    // Phase zero is at the frame farthest from the mean pose.
    let far = (0..references.local[index].len())
        .max_by(|a, b| {
            let distance =
                |k: usize| (&references.local[index][k] - &references.mean[index]).norm();
            distance(*a).total_cmp(&distance(*b))
        })
        .unwrap_or(0);
    let origin = gesture.times_s.get(far).copied().unwrap_or(0.0);
    gesture
        .times_s
        .iter()
        .map(|t| {
            let (sin, cos) = (TAU * (t - origin) / duration).sin_cos();
            [cos, sin]
        })
        .collect()
}

/// The frames of a cyclic gesture brought to even steps of phase, relative to the mean, with their
/// targets: ten neighbours then are the same share of a period whatever the tracker's rate.
fn evenly(
    set: &GestureSet,
    references: &References,
    index: usize,
    own: &[[f64; 2]],
) -> Vec<(DVector<f64>, [f64; 2])> {
    let gesture = &set.gestures[index];
    let (times, rows) = (&gesture.times_s, &references.local[index]);
    let Some(first) = own.first().filter(|_| rows.len() == times.len()) else {
        return Vec::new();
    };
    let origin = first[1].atan2(first[0]);
    (0..NEIGHBOUR_FRAMES)
        .map(|k| {
            let t = gesture.duration_s * k as f64 / NEIGHBOUR_FRAMES as f64;
            let before = times.partition_point(|time| *time <= t).max(1) - 1;
            // After the last frame the first comes again.
            let (after, end) = match times.get(before + 1) {
                Some(time) => (before + 1, *time),
                None => (0, gesture.duration_s),
            };
            let span = (end - times[before]).max(1e-9);
            let u = ((t - times[before]) / span).clamp(0.0, 1.0);
            let pose = &rows[before] * (1.0 - u) + &rows[after] * u - &references.mean[index];
            let (sin, cos) = (origin + TAU * t / gesture.duration_s).sin_cos();
            (pose, [cos, sin])
        })
        .collect()
}

/// One gesture's map from a pose (without global motion) to its plane.
#[derive(Clone, Debug)]
pub struct Plane {
    kind: GestureKind,
    /// One row per component, each as long as a flat pose.
    rows: [DVector<f64>; 2],
    bias: [f64; 2],
    /// Reference frames relative to their mean, for the nearest-neighbour test.
    neighbours: Vec<(DVector<f64>, [f64; 2])>,
    mean: DVector<f64>,
    /// Variance per component, averaged over the reference.
    usual_variance: [f64; 2],
    shape: Shape,
}

impl Plane {
    /// Trains the map of gesture `index`: its frames run once round the unit circle (or from 0 to 1),
    /// all frames of the other gestures and the mean pose map to zero.
    ///
    /// Ridge regression with a bias, weak directions faded out. A last step divides each component by the share the
    /// regression explains, so that the reference itself measures amplitude 1, and drops one that it
    /// hardly explains; a non-cyclic map is brought to exactly 0 and 1 at its marks.
    pub fn train(set: &GestureSet, references: &References, index: usize) -> Self {
        Self::train_among(set, references, index, |_| true)
    }

    /// The same where only the gestures for which `competes` holds are kept apart from: those that
    /// can be performed from one place in the motion graph (section 9.4.1). The gesture itself
    /// always takes part.
    pub fn train_among(
        set: &GestureSet,
        references: &References,
        index: usize,
        competes: impl Fn(usize) -> bool,
    ) -> Self {
        let gesture = &set.gestures[index];
        let own = targets(set, references, index);
        let plane = Self::regressed(set, references, index, &own, &competes);
        let told = plane.told(&references.local[index], &own);
        if gesture.kind == GestureKind::NonCyclic || told > EXPLAINED.1 {
            return plane.finished(set, references, index, &own);
        }
        // A gesture in the very directions of another one cannot be kept apart from it by a plane: it would
        // not answer to itself. Their figures tell the two apart.
        let figure = Figure::new(set, references, index);
        let apart = |other: usize| {
            competes(other)
                && (set.gestures[other].kind == GestureKind::NonCyclic
                    || !figure.rivals(&Figure::new(set, references, other)))
        };
        Self::regressed(set, references, index, &own, &apart).finished(set, references, index, &own)
    }

    /// The regression alone.
    fn regressed(
        set: &GestureSet,
        references: &References,
        index: usize,
        own: &[[f64; 2]],
        competes: &dyn Fn(usize) -> bool,
    ) -> Self {
        let gesture = &set.gestures[index];
        let mean = &references.mean[index];
        let dim = mean.len();
        let scale_m = size_of(&references.local[index], mean);
        let mut inputs: Vec<(DVector<f64>, [f64; 2], f64)> = Vec::new();
        for (other, rows) in references.local.iter().enumerate() {
            if other != index && !competes(other) {
                continue;
            }
            let weight = BLOCK_WEIGHT / rows.len().max(1) as f64;
            for (k, row) in rows.iter().enumerate() {
                let target = if other == index { own[k] } else { [0.0; 2] };
                inputs.push((row.clone(), target, weight));
            }
        }
        if gesture.kind == GestureKind::Cyclic {
            inputs.push((mean.clone(), [0.0; 2], REST_WEIGHT));
        }
        let n = inputs.len();
        // Rows of x and z times the root of their weight.
        let mut x = DMatrix::zeros(n, dim + 1);
        let mut z = DMatrix::zeros(n, 2);
        for (k, (pose, target, weight)) in inputs.iter().enumerate() {
            let root = weight.sqrt();
            for axis in 0..dim {
                x[(k, axis)] = root * (pose[axis] - mean[axis]) / scale_m;
            }
            x[(k, dim)] = root;
            z[(k, 0)] = root * target[0];
            z[(k, 1)] = root * target[1];
        }
        let solution = solve(x, &z, set.options.ridge);
        Self {
            kind: gesture.kind,
            rows: [0, 1]
                .map(|c| DVector::from_iterator(dim, (0..dim).map(|a| solution[(a, c)] / scale_m))),
            bias: [0, 1].map(|c| solution[(dim, c)]),
            neighbours: Vec::new(),
            mean: mean.clone(),
            usual_variance: [1.0, 1.0],
            shape: Shape::LOOP,
        }
    }

    /// Share of its targets that the better component of the plane explains.
    fn told(&self, rows: &[DVector<f64>], own: &[[f64; 2]]) -> f64 {
        let explained = explained(self, rows, own);
        explained[0].max(explained[1])
    }

    /// Calibrated, with its reference's figure and neighbours.
    fn finished(
        mut self,
        set: &GestureSet,
        references: &References,
        index: usize,
        own: &[[f64; 2]],
    ) -> Self {
        self.calibrate(&references.local[index], own);
        if self.kind == GestureKind::Cyclic {
            self.neighbours = evenly(set, references, index, own);
            let mut sum = [0.0; 2];
            for (frame, _) in &self.neighbours {
                let variance = self.variance_of(frame.iter().copied());
                sum[0] += variance[0] / NEIGHBOUR_FRAMES as f64;
                sum[1] += variance[1] / NEIGHBOUR_FRAMES as f64;
            }
            self.usual_variance = sum;
            self.shape = self.shape_of(own);
        }
        self
    }

    fn calibrate(&mut self, rows: &[DVector<f64>], own: &[[f64; 2]]) {
        let place = |plane: &Self, row: &DVector<f64>| plane.linear(row.as_slice());
        if self.kind == GestureKind::NonCyclic {
            let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
                return;
            };
            let (rest, extreme) = (place(self, first)[0], place(self, last)[0]);
            if extreme - rest > EXPLAINED.0 {
                let gain = 1.0 / (extreme - rest);
                self.rows[0] *= gain;
                self.bias[0] = (self.bias[0] - rest) * gain;
            }
            return;
        }
        let explained = explained(self, rows, own);
        for (component, explained) in explained.into_iter().enumerate() {
            let (least, enough) = EXPLAINED;
            let gain = if explained >= enough {
                1.0 / explained
            } else {
                // What the pose hardly tells is noise in any other performer: it fades out.
                ((explained - least) / (enough - least)).max(0.0) / enough
            };
            self.rows[component] *= gain;
            self.bias[component] *= gain;
        }
    }

    /// First harmonic of the reference on this plane; `own` are the targets of its frames.
    fn shape_of(&self, own: &[[f64; 2]]) -> Shape {
        let origin = own.first().map_or(0.0, |first| first[1].atan2(first[0]));
        let places = self.neighbours.iter().map(|(relative, _)| {
            let mut z = self.bias;
            for (axis, value) in relative.iter().enumerate() {
                z[0] += self.rows[0][axis] * value;
                z[1] += self.rows[1][axis] * value;
            }
            z
        });
        Shape::of_period(places, origin)
    }

    /// The figure that the gesture's reference draws on this plane; a circle for non-cyclic gestures.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    fn linear(&self, pose: &[f64]) -> [f64; 2] {
        let mut z = self.bias;
        for (axis, value) in pose.iter().enumerate().take(self.mean.len()) {
            let value = value - self.mean[axis];
            z[0] += self.rows[0][axis] * value;
            z[1] += self.rows[1][axis] * value;
        }
        z
    }

    /// The place of a flat pose (x, y, z per point, metres, without global motion) on the plane.
    ///
    /// Allocates nothing. The variance per component is the mean squared distance between the
    /// targets of the ten nearest reference frames ("Under-constrained input"), half of this pose,
    /// half averaged over the whole reference, above the spread that neighbours have on any loop:
    /// being a line is a property of the gesture, and a short window does not see all of it.
    pub fn apply(&self, pose: &[f64], with_variance: bool) -> PlanePoint {
        let mut point = PlanePoint {
            z: self.linear(pose),
            ..PlanePoint::default()
        };
        if with_variance && !self.neighbours.is_empty() {
            let relative = pose.iter().zip(self.mean.iter()).map(|(v, m)| v - m);
            let live = self.variance_of(relative);
            let usual = self.usual_variance;
            point.variance =
                [0, 1].map(|component| LOOP_SPREAD + 0.5 * (live[component] + usual[component]));
        }
        point
    }

    /// Mean squared pairwise distance, per component, of the targets of the nearest frames.
    fn variance_of(&self, relative: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
        let mut nearest = [(f64::INFINITY, [0.0; 2]); NEIGHBOURS];
        for (frame, target) in &self.neighbours {
            let mut distance = 0.0;
            for (value, frame) in relative.clone().zip(frame.iter()) {
                distance += (value - frame) * (value - frame);
            }
            if distance < nearest[NEIGHBOURS - 1].0 {
                let at = nearest.partition_point(|(other, _)| *other <= distance);
                nearest[at..].rotate_right(1);
                nearest[at] = (distance, *target);
            }
        }
        [0, 1].map(|component| {
            let (mut sum, mut square) = (0.0, 0.0);
            for (_, target) in &nearest {
                sum += target[component];
                square += target[component] * target[component];
            }
            let n = NEIGHBOURS as f64;
            // The mean squared distance over all pairs is 2 n / (n - 1) times the variance.
            2.0 * (square - sum * sum / n).max(0.0) / (n - 1.0)
        })
    }
}
