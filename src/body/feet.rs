//! Feet: the ends of a body that stand on the ground, and how to put them somewhere.

use nalgebra::{Point3, Vector3};

/// The feet of a body, in its travelling frame (x forward, y left, z up, origin on the ground).
pub trait Feet: Send + Sync {
    /// Number of feet.
    fn count(&self) -> usize;

    /// Name of the limb that ends in foot `foot`, as clips call it (`front_left`).
    fn name(&self, foot: usize) -> &str;

    /// Where `foot` is in `pose`, metres.
    fn position(&self, pose: &[f64], foot: usize) -> Point3<f64>;

    /// Moves the joints of one leg so that `foot` is at `goal`; the rest of the pose stays. Returns
    /// the distance left, metres: 0 but for rounding where the leg reaches. Allocates nothing.
    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64;

    /// Moves the whole body of `pose` by `way`, metres; feet and all.
    fn shift(&self, pose: &mut [f64], way: Vector3<f64>);

    /// How far the leg of `foot` reaches, metres: the scale of what counts as small.
    fn reach_m(&self, foot: usize) -> f64;
}
