#!/bin/sh
# One run after the other. Started again, it goes on with what is not done.
#   sh cases/sweeps/loop.sh cases/cattaneo_mindlin.toml results/friction
set -eu
case=$1 out=$2
failed=0
for friction in 0.2 0.25 0.3 0.35 0.4; do
    mlsanm run "$case" --set "contact.interface.friction=$friction" \
        --out "$out/friction-$friction" --skip-done --force --quiet || failed=$((failed + 1))
done
mlsanm collect "$out"/friction-* --out "$out/table.csv"
exit $((failed > 0 ? 3 : 0))
