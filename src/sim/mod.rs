//! The other end of the wire: simulated servos.
