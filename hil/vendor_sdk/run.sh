#!/bin/sh
# Lets the vendor's SDK for Python talk to simulated servos: `hil/vendor_sdk/run.sh`, from anywhere.
# Needs python3 with venv, and PyPI at the first run; without them it ends with code 77.
# HANDWAVE names the program if it is already built.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
python=$("$here/venv.sh")
"$here/../with_servos.sh" --servos 1-12 -- sh -c '"$1" "$2" "$SERVOS" 1000000' exercise "$python" "$here/exercise.py"
