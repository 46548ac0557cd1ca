#!/usr/bin/env bash
# Writes docs/options.md from the program's own registry of options. With --check it writes nothing and fails if the page
# is out of date.
#   scripts/docs.sh [--check] [PROGRAM]     PROGRAM: the pliant to ask (default: build/apps/pliant)
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

check=no
if [[ ${1:-} == --check ]]; then
  check=yes
  shift
fi
program=${1:-$build/apps/pliant}
page=$root/docs/options.md
[[ -x $program ]] || die "$program is not there; build it first (scripts/build.sh), or name another program"

hopper=$("$program" hopper -help_markdown)
raft=$("$program" raft -help_markdown)
clog=$("$program" clog -help_markdown)
text="<!-- Made by scripts/docs.sh from the program; edit the options in src/scenarios/*/options.cpp instead. -->

# Options of \`pliant hopper\`

Every option has a type, a default, a unit and a range; \`pliant hopper -help\` prints the same list. An unknown name or a
value out of range ends the program with exit code 2 before any work is done. Units are those of [models.md](models.md):
σ_avg = g = ρ = 1, t0 = sqrt(σ_avg/g).

Options come from the command line (\`-name value\`) and from files (\`-options_file FILE\`, may be repeated): YAML
(\`.yaml\`, \`.yml\`), where nested keys join with \`_\`, or plain lines of \`-name value\`. The files are read in their
order, then the command line; the last setting of an option wins. An option that the model or method of the run does not
read (\`-k_a\` with \`-model sp\`) is an error. \`-help\` and \`-version\` print and stop. Options that
begin like PETSc's own (\`-ts_…\`, \`-log_view\`, …) go to PETSc; one that nothing reads is an error, and so are those
that draw in windows, take a debugger or save trajectories. An options file has at most 64 KiB, 1000 keys (aliases
written out) and 20 levels; a value has at most 4096 bytes and is UTF-8 without control characters, a name of a folder too.

$hopper

# Options of \`pliant raft\`

Units: ⟨R⟩ (R), the radius of a large droplet, and the unit of force F in which f0 is given; b = 1, t0 = b⟨R⟩/F. Options that
begin with \`-mobility_ksp_\` and \`-mobility_pc_\` go to the solver for the velocities.

$raft

# Options of \`pliant clog\`

Units are those of rafts, with ⟨R⟩ the mean radius and ρ = 1.

$clog"

if [[ $check == no ]]; then
  printf '%s\n' "$text" >"$page"
elif ! difference=$(diff -u "$page" - <<<"$text"); then
  printf '%s\n' "$difference" >&2
  die "docs/options.md is out of date; run scripts/docs.sh"
fi
