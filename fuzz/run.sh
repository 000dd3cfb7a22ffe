#!/usr/bin/env bash
# Fuzzes each target for SECONDS_EACH (default 310: two targets a parser, so over ten minutes for each), then
# keeps the smallest corpus that covers the same. Needs a nightly toolchain and `cargo install cargo-fuzz`.
#
#   fuzz/run.sh            all targets
#   fuzz/run.sh 60         a minute each
#   fuzz/run.sh 60 parse_two
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-310}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(parse_two noise_two parse_one noise_one)
for target in "${targets[@]}"; do
    echo "== $target, $seconds s"
    mkdir -p "fuzz/corpus/$target"
    cargo +nightly fuzz run --fuzz-dir fuzz "$target" -- \
        -max_total_time="$seconds" -max_len=600 -print_final_stats=1 -verbosity=0
    cargo +nightly fuzz cmin --fuzz-dir fuzz "$target" -- -max_len=600 >/dev/null
    echo "   corpus: $(find "fuzz/corpus/$target" -type f | wc -l) files"
done
