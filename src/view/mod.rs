//! Terminal view of a run.
