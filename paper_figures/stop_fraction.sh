#!/usr/bin/env bash
# The poster's stop criterion, measured: error against path tracing and gather time for each threshold, Cornell box, 256x256, 1000
# directions. Writes one JSON object a line to the file named, by default paper_figures/out/stop_fraction.jsonl.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked --quiet
tool=${CARGO_TARGET_DIR:-target}/release/finalgather
out=${1:-paper_figures/out/stop_fraction.jsonl}
mkdir -p "$(dirname "$out")"
picture=$(mktemp --suffix=.exr)
trap 'rm -f "$picture"' EXIT
: > "$out"
for fraction in 0 0.0003 0.001 0.003 0.01 0.03 0.1; do
    run=$("$tool" render scenes/cornell.toml --size 256 --stop-fraction "$fraction" -o "$picture" --json)
    error=$("$tool" compare "$picture" tests/reference/cornell_256.exr --mask tests/reference/cornell_256_mask.png --trim 0.001 --json)
    python3 - "$run" "$error" >> "$out" << 'END'
import json, sys
run, error = map(json.loads, sys.argv[1:])
print(json.dumps({
    "stop_fraction": round(run["settings"]["stop_fraction"], 6), "layers_mean": run["gather"]["layers_mean"],
    "gather_seconds": round(run["seconds"]["gather"], 2), "bias": round(error["bias"], 6),
    "relative_rmse": round(error["relative_rmse"], 6), "renderer": run["gl"]["renderer"],
}))
END
    tail -n 1 "$out"
done
