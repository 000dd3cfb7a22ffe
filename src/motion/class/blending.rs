//! How a class blends its clips: quickly, correctly, or by a table between the two.

use super::{ClassError, MotionClass};
use crate::body::PoseSpace;
use crate::body::blend::{Blending, BlendingKind, Hybrid, HybridReport, NonLinear, Refine};
use crate::motion::clip::ClipKind;
use std::f64::consts::TAU;

/// Clips of a class with a table, at most: its cells have as many corners.
pub const MOST_HYBRID_CLIPS: usize = 6;
/// References of a table between the clips, at most.
const MOST_REFERENCES: usize = 32;
/// Frames of a table, along a cycle or path.
const FRAMES: usize = 32;

/// What a class is asked to blend by.
#[derive(Clone, Debug, Default)]
pub struct BlendSpec {
    /// Which way.
    pub kind: BlendingKind,
    /// The correct mean, with the ends that it keeps; of no use for `linear`.
    pub mean: NonLinear,
    /// Of `hybrid`: how far it may be from the correct mean, metres, above zero.
    pub tolerance_m: f64,
}

impl MotionClass {
    /// What `spec` comes to for the clips of this class. The table of `hybrid` is over blend weights and phase,
    /// with limbs on the timelines that they have in a steady motion.
    ///
    /// # Errors
    /// More than [`MOST_HYBRID_CLIPS`] clips for `hybrid`, or a tolerance that it does not reach.
    pub fn blending(
        &self,
        space: &dyn PoseSpace,
        spec: &BlendSpec,
    ) -> Result<Blending, ClassError> {
        match spec.kind {
            BlendingKind::Linear => Ok(Blending::Linear),
            BlendingKind::NonLinear => Ok(Blending::NonLinear(Box::new(spec.mean.clone()))),
            BlendingKind::Hybrid => self
                .table(space, spec)
                .map(|table| Blending::Hybrid(Box::new(table))),
        }
    }

    /// The same class, blending by `blending`, as from [`MotionClass::blending`].
    #[must_use]
    pub fn blended(mut self, blending: Blending) -> Self {
        self.blending = blending;
        self
    }

    fn table(&self, space: &dyn PoseSpace, spec: &BlendSpec) -> Result<Hybrid, ClassError> {
        let clips = self.examples.len();
        if clips > MOST_HYBRID_CLIPS {
            return Err(ClassError::HybridClips {
                class: self.name.clone(),
                found: clips,
                most: MOST_HYBRID_CLIPS,
            });
        }
        let refine = Refine::Until {
            epsilon_m: spec.tolerance_m,
            most: MOST_REFERENCES,
        };
        let periodic = self.kind == ClipKind::Cycle;
        let places = if periodic { FRAMES } else { FRAMES - 1 };
        let mut class = self.clone();
        let size = [FRAMES, clips];
        let table = Hybrid::sampled(
            space,
            &spec.mean,
            size,
            periodic,
            refine,
            &mut |k, w, out| {
                class.weights.copy_from_slice(w);
                class.state.limb_shift.fill(0.0);
                class.shift_limbs(0.0, true);
                class.sample_clips(TAU * k as f64 / places as f64, space.len());
                out.copy_from_slice(&class.sampled);
            },
        );
        let HybridReport {
            worst_m,
            references,
            reached,
            ..
        } = table.report();
        if !reached {
            return Err(ClassError::HybridTolerance {
                class: self.name.clone(),
                asked_m: spec.tolerance_m,
                worst_m,
                references,
            });
        }
        Ok(table)
    }
}
