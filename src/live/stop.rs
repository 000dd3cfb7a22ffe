//! The stop switch: signals and keys end a run, in order at first, at once the second time.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Counts requests to stop; clones share the count.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    presses: Arc<AtomicUsize>,
}

impl StopSwitch {
    /// A switch nobody has pressed.
    pub fn new() -> Self {
        Self::default()
    }

    /// Presses the switch at each SIGINT, SIGTERM and SIGHUP (the terminal was closed), twice at SIGQUIT.
    pub fn on_signals(&self) -> std::io::Result<()> {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
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

    /// What is asked for.
    pub fn request(&self) -> StopRequest {
        match self.presses.load(Ordering::SeqCst) {
            0 => StopRequest::None,
            1 => StopRequest::Orderly,
            _ => StopRequest::AtOnce,
        }
    }
}
