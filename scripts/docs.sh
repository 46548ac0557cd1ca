#!/usr/bin/env bash
# Writes docs/reference/options.md, the options of all scenarios, and python/pliant/parameters.json, which the figures
# read, from the program's own table. With --check it writes nothing and fails if a file is out of date.
#   scripts/docs.sh [--check] [PROGRAM [PAGE]]     PROGRAM: default build/apps/pliant; any other program needs a PAGE
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

check=no
if [[ ${1:-} == --check ]]; then
  check=yes
  shift
fi
program=${1:-$build/apps/pliant}
page=${2:-$root/docs/reference/options.md}
name=$(basename "$program")
[[ -x $program ]] || die "$program is not there; build it first (scripts/build.sh), or name another program"
[[ $name == pliant || $# -gt 1 ]] || die "$name: name the page to write too"

options=$("$program" -help_markdown)
text="<!-- Made by scripts/docs.sh from the program; edit the options in the sources instead. -->

# Options

Every option has a type, a default, a unit and a range; \`$name SCENARIO -help\` prints the same list, \`-help GROUP\` one group. An unknown name or a
value out of range ends the program with exit code 2 before any work is done. [models](../models/README.md) has the units.

Options come from the command line (\`-name value\`) and from files (\`-options_file FILE\`, may be repeated): YAML
(\`.yaml\`, \`.yml\`), where nested keys join with \`_\`, or plain lines of \`-name value\`. The files are read in their
order, then the command line; the last setting of an option wins. An option that the model or method of the run does not
read (\`-k_a\` with \`-model sp\`) is an error. \`-help\` (or \`-h\`) and \`-version\` print and stop. Options that
begin like PETSc's own (\`-ts_…\`, \`-log_view\`, …) go to PETSc; one that nothing reads is an error, and so are those
that draw in windows, take a debugger or save trajectories. An options file has at most 64 KiB, 1000 keys (aliases
written out) and 20 levels; a value has at most 4096 bytes and is UTF-8 without control characters, a name of a folder too.

A YAML file needs a value for each option of pliant: \`name:\`, \`name: null\` and \`name: ~\` are errors. A plain line
\`-name\` without a value means yes for a yes|no option, as on the command line. PETSc's own flags need no value in either.
Names of input files (outlines, shapes, obstacles) are relative to the folder of the options file that has them, on the
command line to the working directory. \`-output\` and \`-restart\` are always relative to the working directory, so that an
options file can be used from any folder. A UTF-8 byte order mark at the start of an options file or input file is skipped.

The column \"on restart\": with \`-restart DIR\` an option that \"may change\" has the stored value unless another is given, a
\"fixed\" one has the stored value and refuses another, and one that is \"not kept\" has its default unless it is given.
[file-format.md](file-format.md#the-folder-of-a-run) describes restarts and branches. Sizes (\`-n\`, \`-n_vertices\`,
\`-rows\` …) that need more memory than the machine has available are refused before the run starts.
$options"

# keep FILE TEXT: writes the file, or compares.
keep() {
  local difference
  if [[ $check == no ]]; then
    printf '%s\n' "$2" >"$1"
  elif ! difference=$(diff -u "$1" - <<<"$2"); then
    printf '%s\n' "$difference" >&2
    die "${1#"$root/"} is out of date; run scripts/docs.sh"
  fi
}
keep "$page" "$text"
if [[ $name == pliant ]]; then
  entries=
  for scenario in $("$program" -scenarios); do
    entries+="${entries:+,}
\"$scenario\": $("$program" "$scenario" -help_json)"
  done
  keep "$root/python/pliant/parameters.json" "{$entries
}"
fi
