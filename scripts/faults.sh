#!/bin/sh
# Loss of power and lack of memory in many more places than the tests try: scripts/faults.sh [power|memory [PLACES]]
# power: hoppers (small, long, large, with threads, on ranks, killed and restarted up to three times) and a clog.
# PLACES: allocations that fail, per case (200). The program and the test libraries must be built in build/.
set -eu
cd "$(dirname "$0")/.."
what=${1:-all}
export PLIANT_PROGRAM="${PLIANT_PROGRAM:-$PWD/build/apps/pliant}"
if [ "$what" != memory ]; then
  PLIANT_ALL_LOSSES=1 /usr/bin/python3 -B -m pytest -q -s -p no:cacheprovider tests/apps/test_power.py
fi
if [ "$what" != power ]; then
  PLIANT_ALL_ALLOCATIONS=${2:-200} /usr/bin/python3 -B -m pytest -q -s -p no:cacheprovider tests/apps/test_memory.py
fi
