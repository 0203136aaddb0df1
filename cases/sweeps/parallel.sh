#!/bin/sh
# As loop.sh, with GNU parallel: a job log, and two values that vary.
#   sh cases/sweeps/parallel.sh cases/cattaneo_mindlin.toml results/friction 4
set -eu
case=$1 out=$2 jobs=$3
mkdir -p "$out"
status=0
parallel --quote --jobs "$jobs" --joblog "$out/jobs.log" \
    mlsanm run "$case" --set "contact.interface.friction={1}" --set "load.shear.force=[{2}, 0.0]" \
    --out "$out/friction-{1}-shear-{2}" --skip-done --force --quiet \
    ::: 0.2 0.25 0.3 0.35 0.4 ::: 20.0 30.0 || status=3
mlsanm collect "$out"/friction-* --out "$out/table.csv"
exit "$status"
