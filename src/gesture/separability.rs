//! How well the gestures of a set can be told apart.

use super::{GestureKind, GestureSet, Plane, References};

/// What one gesture's plane answers to the frames of another.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Response {
    /// Index of the gesture whose plane answers.
    pub gesture: usize,
    /// Index of the gesture whose frames are shown.
    pub shown: usize,
    /// Mean modulus of the answer (mean absolute progression for non-cyclic planes).
    pub mean: f64,
    /// Largest modulus.
    pub largest: f64,
}

/// Every plane's answer to every gesture's reference frames, row by row.
///
/// A cyclic plane should answer 1 to its own frames and 0 to all others. An answer above 0.2
/// between two gestures may start one while the other is performed.
///
/// # Errors
/// The name of an anchor that the set does not have.
pub fn responses(set: &GestureSet) -> Result<Vec<Response>, String> {
    let references = References::new(set)?;
    let mut table = Vec::new();
    for (gesture, shape) in set.gestures.iter().enumerate() {
        let plane = Plane::train(set, &references, gesture);
        for (shown, rows) in references.local.iter().enumerate() {
            let moduli = rows.iter().map(|row| {
                let z = plane.apply(row.as_slice(), false).z;
                match shape.kind {
                    GestureKind::Cyclic => z[0].hypot(z[1]),
                    GestureKind::NonCyclic => z[0].abs(),
                }
            });
            let (mut sum, mut largest) = (0.0, 0.0_f64);
            for modulus in moduli {
                sum += modulus;
                largest = largest.max(modulus);
            }
            table.push(Response {
                gesture,
                shown,
                mean: sum / rows.len().max(1) as f64,
                largest,
            });
        }
    }
    Ok(table)
}
