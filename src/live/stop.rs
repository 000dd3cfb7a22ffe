//! What an operator asks of a run by signals, keys, gestures: to stop, in order at first, at once the second time;
//! to take servos back into control.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// How urgently a run shall end.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum StopRequest {
    /// Go on.
    None,
    /// Settle, lie down, torque off.
    Orderly,
    /// Torque off now.
    AtOnce,
}

/// Counts requests to stop, and keeps one to re-arm; clones share them. Whoever lets an operator speak (terminal,
/// page, gamepad) holds a clone.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    presses: Arc<AtomicUsize>,
    rearm: Arc<AtomicBool>,
}

impl StopSwitch {
    /// A switch nobody has pressed.
    pub fn new() -> Self {
        Self::default()
    }

    /// Presses the switch at each SIGINT, SIGTERM and SIGHUP (the terminal was closed), twice at SIGQUIT; asks for a
    /// re-arm at SIGUSR1.
    pub fn on_signals(&self) -> std::io::Result<()> {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGUSR1};
        let rearm = Arc::clone(&self.rearm);
        // SAFETY: the handler only sets an atomic, which is allowed in a signal handler.
        #[allow(unsafe_code)]
        unsafe {
            signal_hook::low_level::register(SIGUSR1, move || {
                rearm.store(true, Ordering::SeqCst);
            })?;
        }
        for (signal, count) in [(SIGINT, 1), (SIGTERM, 1), (SIGHUP, 1), (SIGQUIT, 2)] {
            let presses = Arc::clone(&self.presses);
            let add = move || {
                presses.fetch_add(count, Ordering::SeqCst);
            };
            // SAFETY: the handler only adds to an atomic, which is allowed in a signal handler.
            #[allow(unsafe_code)]
            unsafe {
                signal_hook::low_level::register(signal, add)?;
            }
        }
        Ok(())
    }

    /// Asks for a stop; a second call asks for it at once.
    pub fn press(&self) {
        self.presses.fetch_add(1, Ordering::SeqCst);
    }

    /// Asks that servos which fell out, or a bus that is back, be taken into control again: the operator has
    /// looked at the robot, and it may move.
    pub fn ask_rearm(&self) {
        self.rearm.store(true, Ordering::SeqCst);
    }

    /// Whether that was asked since the last call.
    pub fn take_rearm(&self) -> bool {
        self.rearm.swap(false, Ordering::SeqCst)
    }

    /// What is asked for.
    pub fn request(&self) -> StopRequest {
        match self.presses.load(Ordering::SeqCst) {
            0 => StopRequest::None,
            1 => StopRequest::Orderly,
            _ => StopRequest::AtOnce,
        }
    }
}
