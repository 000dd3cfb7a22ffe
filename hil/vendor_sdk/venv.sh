#!/bin/sh
# Installs the servo maker's SDK for Python into a folder of its own and prints its python. Exit code 77 when that
# cannot be done: no python3 with venv, or PyPI cannot be reached.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
venv=${VENDOR_SDK_VENV:-$root/target/vendor_sdk_venv}
skip() { echo "skipped: $*" >&2; exit 77; }

if [ ! -x "$venv/bin/pip" ]; then
    python3 -m venv "$venv" >&2 || skip "python3 with venv is needed (apt-get install python3-venv)"
fi
# The version that the figures in hil/README.md were measured with.
"$venv/bin/python" -c 'import dynamixel_sdk' 2>/dev/null ||
    "$venv/bin/pip" install --quiet --disable-pip-version-check --retries 1 --timeout 10 'dynamixel-sdk==4.1.0' >&2 ||
    skip "dynamixel-sdk cannot be had from PyPI"
echo "$venv/bin/python"
