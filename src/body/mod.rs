//! Pose spaces: what the animator needs to know of a body.
