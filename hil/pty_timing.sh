#!/bin/sh
# Times the whole wire: `handwave run` at 200 Hz against simulated servos in another process.
# Usage: hil/pty_timing.sh [SECONDS]. HANDWAVE names the program (default: the release build).
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
program=${HANDWAVE:-$root/target/release/handwave}
seconds=${1:-30}
work=$(mktemp -d)
[ -x "$program" ] || { echo "skipped: build first with cargo build --release" >&2; exit 77; }
"$program" sim dynamixel --servos 1-12 --link "$work/servos" > "$work/sim.log" &
sim=$!
trap 'kill $sim 2>/dev/null || true; rm -rf "$work"' EXIT
tries=0
until [ -e "$work/servos" ]; do
    tries=$((tries + 1))
    [ $tries -lt 100 ] || { echo "the simulator did not come up: $(cat "$work/sim.log")" >&2; exit 1; }
    sleep 0.1
done
"$program" run --headless --duration "$seconds" --bus "dynamixel:$work/servos@1000000"
