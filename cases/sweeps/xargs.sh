#!/bin/sh
# As loop.sh, on as many processes as are named. The first run goes ahead, the others find its operators.
#   sh cases/sweeps/xargs.sh cases/cattaneo_mindlin.toml results/friction 4
set -eu
case=$1 out=$2 jobs=$3
export case out
run='mlsanm run "$case" --set "contact.interface.friction=$0" --out "$out/friction-$0" --skip-done --force --quiet'
status=0
sh -c "$run" 0.2 || status=3
printf '%s\n' 0.25 0.3 0.35 0.4 | xargs -P "$jobs" -n 1 sh -c "$run" || status=3
mlsanm collect "$out"/friction-* --out "$out/table.csv"
exit "$status"
