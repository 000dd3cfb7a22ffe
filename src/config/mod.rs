//! Typed configuration, checked at load.
