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

/// Looks at what the control thread sees of values that others set while it runs: to record it, or to show it
/// again what it saw then.
pub trait Witness: Send + Sync + std::fmt::Debug {
    /// The control thread is about to see `value` of the kind `what` (each kind has a number of its own); what
    /// it is to see.
    fn see(&self, what: u8, value: u64) -> u64;
}

/// The kind of value that presses of the stop switch are to a [`Witness`].
pub const STOP_PRESSES: u8 = 1;

/// Counts requests to stop; clones share the count.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    presses: Arc<AtomicUsize>,
    witness: Option<Arc<dyn Witness>>,
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

    /// The same switch for the control thread alone, with a witness to what it is asked for.
    #[must_use]
    pub fn witnessed(&self, witness: Arc<dyn Witness>) -> Self {
        Self {
            presses: Arc::clone(&self.presses),
            witness: Some(witness),
        }
    }

    /// What is asked for.
    pub fn request(&self) -> StopRequest {
        let presses = self.presses.load(Ordering::SeqCst) as u64;
        let seen = match &self.witness {
            Some(witness) => witness.see(STOP_PRESSES, presses),
            None => presses,
        };
        match seen {
            0 => StopRequest::None,
            1 => StopRequest::Orderly,
            _ => StopRequest::AtOnce,
        }
    }
}
