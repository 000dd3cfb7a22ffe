//! Robot: URDF model, kinematics, legs, envelope.
//!
//! [`model`] reads and checks a URDF, [`kinematics`] places its links, [`leg`] finds legs and
//! solves them, [`ik`] solves any other chain, [`envelope`] is the last thing every target passes before it leaves,
//! [`guard`] may stop it on the way (feature `collision`: links that would come too near each other).

pub mod adapt;
#[cfg(feature = "collision")]
pub mod collision;
pub mod envelope;
pub mod guard;
pub mod ik;
pub mod kinematics;
pub mod leg;
mod limits;
pub mod model;
pub mod tip;
mod words;

pub use envelope::{Envelope, JointEnvelope};
pub use guard::Guard;
pub use ik::ChainIk;
pub use leg::{Facing, Leg};
pub use model::{JointLimits, ModelError, RobotModel};
