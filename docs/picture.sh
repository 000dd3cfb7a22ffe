#!/usr/bin/env bash
# Takes the picture of a run for the README: runs `handwave run` in a terminal of its own and
# writes what it shows after SECONDS as docs/run.svg. Needs tmux and Python with the package `rich`.
# Usage: docs/picture.sh [SECONDS] [PROGRAM]
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-17}
program=${2:-target/release/handwave}
session=handwave-picture-$$
trap 'tmux kill-session -t "$session" 2>/dev/null || true' EXIT
tmux new-session -d -s "$session" -x 112 -y 33 "$program run"
sleep "$seconds"
tmux capture-pane -e -p -t "$session" > docs/run.ansi
python3 - <<'PYTHON'
from rich.console import Console
from rich.text import Text
text = open("docs/run.ansi", encoding="utf-8").read()
console = Console(record=True, width=112, file=open("/dev/null", "w"))
console.print(Text.from_ansi(text.rstrip("\n")))
console.save_svg("docs/run.svg", title="handwave run")
PYTHON
rm docs/run.ansi
