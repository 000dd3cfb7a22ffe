#!/bin/sh
# Lets the vendor's SDK for Python talk to simulated servos: `hil/vendor_sdk/run.sh`, from anywhere.
# Needs python3 with venv, and PyPI at the first run. HANDWAVE names the program if it is already built.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
venv=${VENDOR_SDK_VENV:-$root/target/vendor_sdk_venv}
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

if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
fi
"$venv/bin/python" -c 'import dynamixel_sdk' 2>/dev/null ||
    "$venv/bin/pip" install --quiet dynamixel-sdk

if [ -z "${HANDWAVE:-}" ]; then
    (cd "$root" && cargo build --quiet --bin handwave)
    HANDWAVE=$root/target/debug/handwave
fi

"$HANDWAVE" sim dynamixel --servos 1-12 --link "$work/servos" >"$work/ready" &
sim=$!
tries=0
until grep -q ready "$work/ready"; do
    tries=$((tries + 1))
    [ "$tries" -le 100 ] || { echo "the simulator did not become ready" >&2; exit 1; }
    sleep 0.05
done

"$venv/bin/python" "$here/exercise.py" "$work/servos" 1000000
