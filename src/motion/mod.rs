//! Motion: clips, classes, graph, transitions, synthesis.
//!
//! [`clip`] holds one example motion, [`gait`] authors clips for legged robots, [`class`] is a space
//! of clips indexed by amplitude and frequency, [`graph`] moves between classes, [`animator`] is
//! the whole: gesture waves in, poses out.

pub mod analysis;
pub mod animator;
pub mod blending;
pub mod class;
pub mod clip;
pub mod edge;
pub mod export;
pub mod gait;
pub mod gait_frames;
mod gait_paths;
mod gait_plan;
mod gait_presets;
mod gait_stance;
pub mod graph;
pub mod import;
pub mod inertia;
pub mod inverse;
pub mod layer;
mod limbs;
pub mod mapping;
pub mod metrics;
pub mod node;
pub mod pins;
pub mod range;
pub mod search;
mod smooth;
mod spline;
pub mod suggest;
pub mod take;
pub mod warp;
pub mod weights;

pub use animator::Animator;
pub use clip::{Clip, ClipError};
pub use smooth::{Follower, ease, eased_span_s};
