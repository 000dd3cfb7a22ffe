#!/usr/bin/env bash
# Measures what the default build and each feature cost: clean release builds, one after the other,
# with the sources of all dependencies already downloaded. Prints the rows of the README's table.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo fetch --locked --quiet
build() {
    local label=$1; shift
    local target; target=$(mktemp -d)
    local crates; crates=$(cargo tree --locked -e normal,build --prefix none "$@" | sed 's/ (.*//' | sort -u | wc -l)
    local start=$SECONDS
    local cpu; cpu=$( { TIMEFORMAT='%U %S'; time CARGO_TARGET_DIR=$target cargo build --release --locked --quiet "$@" >/dev/null 2>&1; } 2>&1 | awk '{printf "%.0f", $1 + $2}')
    printf '| %s | %s | %s s | %s s | %s MB |\n' "$label" "$crates" "$((SECONDS - start))" "$cpu" \
        "$(du -m "$target/release/handwave" | cut -f1)"
    rm -rf "$target"
}
echo '| build | crates | wall clock | CPU | program |'
echo '|---|---|---|---|---|'
build 'default (`tui`, `plot`)'
build 'without `tui`' --no-default-features --features plot
build 'without `plot`' --no-default-features --features tui
build 'with none of them' --no-default-features
build 'with `dxl-serial2`' --features dxl-serial2
