#!/bin/sh
# An array of SLURM jobs; submitted again, those that are done end at once.
#   sbatch --export=ALL,case=cases/cattaneo_mindlin.toml,out=results/friction cases/sweeps/slurm.sh
#   mlsanm collect results/friction/friction-* --out results/friction/table.csv
#SBATCH --array=0-4
#SBATCH --cpus-per-task=1
#SBATCH --time=00:30:00
#SBATCH --mem=2G
set -eu
set -- 0.2 0.25 0.3 0.35 0.4
shift "$SLURM_ARRAY_TASK_ID"
exec mlsanm run "$case" --set "contact.interface.friction=$1" \
    --out "$out/friction-$1" --skip-done --force --quiet
