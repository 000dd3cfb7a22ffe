//! Runs the puppet: clock, control loop, safety.
