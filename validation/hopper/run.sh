#!/bin/sh
# Runs every row of a list of options and writes one table of what they measured.
#   validation/hopper/run.sh LIST FOLDER [JOBS]     e.g.  validation/hopper/run.sh validation/hopper/soft.txt runs/soft 2
# PLIANT names the program (default: build/apps/pliant). Rows whose run is complete are skipped, stopped ones go on.
set -eu
list=$1 folder=$2 jobs=${3:-2}
here=$(cd "$(dirname "$0")/../.." && pwd)
pliant=${PLIANT:-$here/build/apps/pliant}
mkdir -p "$folder"
grep -v '^#' "$list" | while read -r name options; do
  [ -n "$name" ] || continue
  grep -qs '"status": "\(done\|clogged\|empty\)"' "$folder/$name/summary.json" || echo "-output $folder/$name $options"
done | xargs -r -P "$jobs" -L 1 "$pliant" hopper
python3=/usr/bin/python3
PYTHONPATH="$here/python" $python3 - "$folder" <<'PYTHON'
import sys
from pathlib import Path
from pliant import sweep_table

folder = Path(sys.argv[1])
table = sweep_table(sorted(p.parent for p in folder.glob("*/summary.json")))
table.to_csv(folder / "table.csv", index=False)
print(f"{len(table)} runs in {folder / 'table.csv'}")
PYTHON
