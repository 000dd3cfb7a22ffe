#!/bin/sh
# Lets the crate `rustypot` talk to simulated servos: `hil/rust_peer/run.sh`, from anywhere.
# Builds it first, for which it needs crates.io; without that it ends with code 77.
# HANDWAVE names the program if it is already built.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
target=$(cd "$here/../.." && pwd)/target/rust_peer
cd "$here"
cargo fetch --quiet --locked || { echo "skipped: rustypot cannot be had from crates.io" >&2; exit 77; }
cargo build --quiet --locked --target-dir "$target"
"$here/../with_servos.sh" --servos 1-12 -- sh -c '"$1" "$SERVOS"' peer "$target/debug/rust_peer"
