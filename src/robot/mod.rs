//! Robot: URDF model, kinematics, envelope.
