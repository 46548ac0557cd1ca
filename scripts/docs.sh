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

Every option has a type, a default, a unit and a range. \`$name SCENARIO -help\` prints the same list, \`-help GROUP\` one group; \`-help\` (or \`-h\`) and
\`-version\` print and stop. [models](../models/README.md) has the units. The defaults of \`-dt\` use the [elastic limit dt_elastic, the damping limit dt_damping, and dt_critical](steps.md).

Options come from files (\`-options_file FILE\`, may be repeated), which are read in their order, and then from the command line (\`-name value\`). The last setting
of an option counts.

| file | format |
|---|---|
| \`.yaml\`, \`.yml\` | YAML; nested keys are joined by \`_\`. Every option of pliant needs a value: \`name:\`, \`name: null\` and \`name: ~\` are errors |
| any other | lines of \`-name value\`. For a yes\|no option \`-name\` alone means yes, as on the command line |

- **Errors.** An unknown option, a value out of range, and an option that the model or method of the run does not read (\`-k_a\` with \`-model sp\`) end the program with exit code 2 before the run
  starts, and so does a size (\`-n\`, \`-n_vertices\`, \`-rows\` …) that needs more memory than the machine has available.
- **PETSc.** Options with the prefixes of PETSc (\`-ts_…\`, \`-log_view\`, …) go to PETSc, whose flags need no value. A PETSc option that the run does not use is an error. PETSc options that open windows,
  start a debugger or save trajectories are refused.
- **File names.** Names of input files (outlines, shapes, obstacles) in an options file are relative to its folder, on the command line to the working directory. \`-output\` and \`-restart\` are always
  relative to the working directory, so that an options file can be used from any folder.
- **Limits.** An options file has at most 64 KiB, 1000 keys (with aliases expanded) and 20 levels. Values, and names of folders, have at most 4096 bytes and are UTF-8 without control characters. A byte order
  mark at the start of an options file or input file is skipped.
- **Restarts.** The column \"on restart\" applies to \`-restart DIR\`. An option that \"may change\" keeps the stored value unless another value is given. A \"fixed\" option keeps the stored value and refuses
  another. An option that is \"not kept\" has its default unless a value is given. [file-format.md](file-format.md#the-folder-of-a-run) describes restarts and branches.
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
