#!/bin/sh
# Looks at a real chain and plays ten seconds on it. THE ROBOT MOVES: hang it up or clear the floor.
# Usage: HANDWAVE_HIL_BUS=dynamixel:/dev/ttyUSB0@1000000 hil/real_servos.sh [CONFIG]
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
program=${HANDWAVE:-$root/target/release/handwave}
[ -n "${HANDWAVE_HIL_BUS:-}" ] || { echo "skipped: set HANDWAVE_HIL_BUS to the bus of a robot that may move" >&2; exit 77; }
[ -x "$program" ] || { echo "skipped: build first with cargo build --release" >&2; exit 77; }
"$program" bus scan "$HANDWAVE_HIL_BUS"
"$program" run "$@" --headless --duration 10 --bus "$HANDWAVE_HIL_BUS"
"$program" bus read "$HANDWAVE_HIL_BUS" 1-12 torque_enable
