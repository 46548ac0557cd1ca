#!/usr/bin/env bash
# Writes docs/options.md, the options of all scenarios, from the program's own table. With --check it writes nothing and
# fails if the page is out of date.
#   scripts/docs.sh [--check] [PROGRAM [PAGE]]     PROGRAM: the one to ask (default: build/apps/pliant); another than pliant
#                                                  has a PAGE of its own
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

check=no
if [[ ${1:-} == --check ]]; then
  check=yes
  shift
fi
program=${1:-$build/apps/pliant}
page=${2:-$root/docs/options.md}
name=$(basename "$program")
[[ -x $program ]] || die "$program is not there; build it first (scripts/build.sh), or name another program"
[[ $name == pliant || $# -gt 1 ]] || die "$name: name the page to write too"

options=$("$program" -help_markdown)
text="<!-- Made by scripts/docs.sh from the program; edit the options in the sources instead. -->

# Options

Every option has a type, a default, a unit and a range; \`$name SCENARIO -help\` prints the same list. An unknown name or a
value out of range ends the program with exit code 2 before any work is done. [models.md](models.md) has the units.

Options come from the command line (\`-name value\`) and from files (\`-options_file FILE\`, may be repeated): YAML
(\`.yaml\`, \`.yml\`), where nested keys join with \`_\`, or plain lines of \`-name value\`. The files are read in their
order, then the command line; the last setting of an option wins. An option that the model or method of the run does not
read (\`-k_a\` with \`-model sp\`) is an error. \`-help\` and \`-version\` print and stop. Options that
begin like PETSc's own (\`-ts_…\`, \`-log_view\`, …) go to PETSc; one that nothing reads is an error, and so are those
that draw in windows, take a debugger or save trajectories. An options file has at most 64 KiB, 1000 keys (aliases
written out) and 20 levels; a value has at most 4096 bytes and is UTF-8 without control characters, a name of a folder too.
$options"

if [[ $check == no ]]; then
  printf '%s\n' "$text" >"$page"
elif ! difference=$(diff -u "$page" - <<<"$text"); then
  printf '%s\n' "$difference" >&2
  die "${page#"$root/"} is out of date; run scripts/docs.sh"
fi
