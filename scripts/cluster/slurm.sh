#!/usr/bin/env bash
# A picture or a bake in 16 shards on Slurm, and their merge once all are done:
#
#   scripts/cluster/slurm.sh box.exr render scenes/cornell.toml --directions 100000
#
# Parts and logs go to box.exr.parts/. The same line again goes on with what is not complete there.
set -euo pipefail
out=$1 parts=$1.parts
shift
mkdir -p "$parts"
array=$(sbatch --parsable --output="$parts/%a.log" "${BASH_SOURCE%/*}/slurm_shard.sh" "$@" -o "$parts/{shard}.part")
sbatch --dependency="afterok:$array" --kill-on-invalid-dep=yes --output="$parts/merge.log" --job-name=finalgather-merge \
    --wrap="finalgather merge $(printf %q "$parts")/*.part -o $(printf %q "$out")"
