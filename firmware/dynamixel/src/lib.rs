//! Dynamixel Protocol 2.0 on bytes alone: frames, instructions, statuses, for host and device.
#![no_std]
