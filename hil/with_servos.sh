#!/bin/sh
# Runs a command while simulated servos are there, and ends them with it:
#   hil/with_servos.sh [OPTIONS OF handwave sim dynamixel...] -- COMMAND [ARGS...]
# The command finds their port in $SERVOS and the program in $HANDWAVE. HANDWAVE names a program that is built already.
set -eu

root=$(cd "$(dirname "$0")/.." && pwd)
options=
while [ "${1:---}" != "--" ]; do
    options="$options $1"
    shift
done
[ $# -gt 1 ] || { echo "usage: with_servos.sh [OPTIONS...] -- COMMAND [ARGS...]" >&2; exit 2; }
shift
work=$(mktemp -d)
sim=

finish() {
    if [ -n "$sim" ]; then
        kill "$sim" 2>/dev/null || true
        wait "$sim" 2>/dev/null || true
    fi
    rm -rf "$work"
}
trap finish EXIT
trap 'exit 130' INT TERM

if [ -z "${HANDWAVE:-}" ]; then
    (cd "$root" && cargo build --quiet --locked --bin handwave)
    HANDWAVE=$root/target/debug/handwave
fi
SERVOS=$work/servos
export HANDWAVE SERVOS

# Options are words without spaces.
# shellcheck disable=SC2086
"$HANDWAVE" sim dynamixel $options --link "$SERVOS" >"$work/ready" &
sim=$!
tries=0
until grep -q ready "$work/ready"; do
    tries=$((tries + 1))
    [ "$tries" -le 200 ] || { echo "the simulator did not become ready" >&2; exit 1; }
    kill -0 "$sim" 2>/dev/null || { echo "the simulator ended" >&2; exit 1; }
    sleep 0.05
done

"$@"
