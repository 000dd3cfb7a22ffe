//! Real-time scheduling of the control thread, as far as the system allows it.

/// What the system granted, for the reader.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealTime {
    /// The thread runs under SCHED_FIFO.
    pub fifo: bool,
    /// Memory is locked.
    pub locked: bool,
    /// Why something was not granted.
    pub notes: Vec<String>,
}

/// Priority of the control thread: above ordinary real-time work, below the kernel's own threads.
const PRIORITY: i32 = 70;

/// Asks for SCHED_FIFO and locked memory for the calling thread. Never fails: what is refused is noted.
#[allow(unsafe_code)]
pub fn request() -> RealTime {
    let mut granted = RealTime::default();
    // SAFETY: plain system calls with valid arguments that outlive the call; no memory is handed over.
    unsafe {
        let mut param: libc::sched_param = std::mem::zeroed();
        param.sched_priority = PRIORITY;
        granted.fifo = libc::sched_setscheduler(0, libc::SCHED_FIFO, &param) == 0;
    }
    if !granted.fifo {
        granted.notes.push(
            "no real-time priority (needs CAP_SYS_NICE or an rtprio limit): cycles may come late under load"
                .into(),
        );
    }
    granted.locked = may_lock_all() && lock_all();
    if !granted.locked {
        granted
            .notes
            .push("memory is not locked (needs an unlimited memlock limit): a page may have to be fetched in mid-cycle".into());
    }
    granted
}

/// Whether locking cannot run into a limit later: with a finite limit an allocation in mid-run would fail.
#[allow(unsafe_code)]
fn may_lock_all() -> bool {
    // SAFETY: the structure outlives the call, which only fills it in; geteuid has no arguments.
    unsafe {
        let mut limit: libc::rlimit = std::mem::zeroed();
        libc::geteuid() == 0
            || (libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit) == 0
                && limit.rlim_cur == libc::RLIM_INFINITY)
    }
}

#[allow(unsafe_code)]
fn lock_all() -> bool {
    // SAFETY: no pointers; affects paging only.
    unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) == 0 }
}
