//! Handwave: a performer's hands, body or face bring a robot to life.

pub mod base;
pub mod body;
pub mod bus;
pub mod cli;
pub mod config;
pub mod gesture;
pub mod live;
pub mod motion;
pub mod pose;
pub mod puppet;
pub mod robot;
pub mod sim;
pub mod view;
