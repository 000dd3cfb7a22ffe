#!/bin/sh
# Ours beside the servo maker's SDK for Python, on the same simulated servos: cycles per second, processor time, and what
# a silent servo costs. Usage: hil/compare_sdk.sh [ROUNDS]. Takes about 30 s a round; builds for release first.
# Exit code 77 when the SDK cannot be installed.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/.." && pwd)
rounds=${1:-5}
python=$("$here/vendor_sdk/venv.sh")
(cd "$root" && cargo build --quiet --release --locked --bin handwave --example servo_chain)
HANDWAVE=$root/target/release/handwave
SERVO_CHAIN=$root/target/release/examples/servo_chain
export HANDWAVE SERVO_CHAIN
compare=$here/vendor_sdk/compare.py

echo "Servos that answer at once (--unpaced)"
"$here/with_servos.sh" --servos 1-12 --unpaced -- "$python" "$compare" --rounds "$rounds"
echo
echo "Servos at 1 Mbaud, bytes in their time"
"$here/with_servos.sh" --servos 1-12 -- "$python" "$compare" --rounds "$rounds"
echo
echo "Servo 6 of 12 falls silent, 1 Mbaud, bytes in their time"
"$here/with_servos.sh" --servos 1-12 --fault 6:silent@5s -- "$python" "$compare" --silent 6 --seconds 4
