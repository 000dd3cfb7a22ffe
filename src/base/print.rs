//! Lines for the reader on standard output and standard error.
//!
//! `println!` and `eprintln!` panic when nobody reads any more, as behind `| head`; these do not.

use std::fmt::Arguments;
use std::io::Write;

/// Prints a line on standard output. A reader that has gone away is no failure.
pub fn say(line: Arguments) {
    let _unread = writeln!(std::io::stdout(), "{line}");
}

/// Prints a line on standard error. A reader that has gone away is no failure.
pub fn warn(line: Arguments) {
    let _unread = writeln!(std::io::stderr(), "{line}");
}
