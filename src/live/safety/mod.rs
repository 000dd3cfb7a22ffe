//! Supervision of a run: how every servo stands, what is wrong with it, what is done about it.
//!
//! [`Supervisor`] is a pure state machine: it is shown each cycle ([`Seen`]) and says what follows
//! ([`Verdict`]); it does no I/O, reads no clock and allocates nothing while a run goes on. The control
//! loop carries its verdict out.
//!
//! # States
//!
//! Of every servo, and of the robot as a whole ([`ServoState::of_all`]: the worst leads). The columns are what is
//! seen of a servo in a cycle; a fault outranks silence, silence outranks torque.
//!
//! | state | fault | no answer | answers, no torque | torque, target moves | torque, target stands |
//! |---|---|---|---|---|---|
//! | offline | faulted | offline | present | armed | armed |
//! | present | faulted | offline | present | armed | armed |
//! | armed | faulted | offline | present | moving | holding |
//! | moving | faulted | offline | present | moving | holding |
//! | holding | faulted | offline | present | moving | holding |
//! | faulted | faulted | faulted | faulted | faulted | faulted |
//! | faulted, re-arm granted | faulted | offline | present | armed | armed |
//!
//! A servo that was silent and kept its torque re-enters by itself: offline, armed, moving; the bus ramps its goal.
//! From *present* torque comes back only by a re-arm, from *faulted* nothing leads on without one. A re-arm is
//! asked for by an operator ([`StopSwitch::ask_rearm`](super::StopSwitch::ask_rearm)), or granted by the supervisor
//! itself with `safety.rearm = "auto"`, three times for each servo at most. A latched error is cleared by a
//! reboot first. Every way back into motion is a ramp.
//!
//! # Reactions
//!
//! | found | reaction |
//! |---|---|
//! | hardware error latched, torque lost, following error, stall | `on_servo_fault`: end pose and exit code 4; or the joint is left out (it goes to where it was found and stays) and the others play on |
//! | too hot, overloaded, supply out of range | `on_servo_fault`: end pose and exit code 4; or play on with the least motion, the servo included |
//! | warm, strained, weak supply | motion is made smaller, in amplitude and speed, before any of these |
//! | bus lost | `on_bus_lost`: exit code 3; or wait, and no motion until re-armed |
//! | half of the cycles late | `on_overrun`: hold until they are not, end pose, or nothing |
//! | the motion gives no numbers | the envelope brakes the joints; after 0.1 s end pose and exit code 4 |
//! | a target that is no number after the envelope | stop at once: it is not sent |
//! | stop gesture | as an operator's stop |

mod kind;
mod recovery;
mod state;
mod supervisor;
#[cfg(test)]
mod tests;
mod verdict;
mod watch;
mod words;

pub use kind::{FaultKind, error_names};
pub use state::{ServoState, Signs};
pub use supervisor::Supervisor;
pub use verdict::{Cause, Change, Policy, Reaction, Request, Seen, Verdict};
pub use watch::{Finding, Look, Watch};
pub use words::{Crew, sentence};
