"""Command line of the plotting scripts: arguments, errors as one line, tables."""

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from uncertainties import ufloat

from .errors import OutputError, PliantError


def parser(description, example, output):
    """An ArgumentParser whose help ends with an example, with --output."""
    result = argparse.ArgumentParser(description=description, epilog=f"example:\n  {example}",
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--output", "-o", type=Path, default=Path(output), metavar="FILE",
                        help=f"file to write, its ending picks the format (default: {output})")
    return result


def arguments(parser):
    """The arguments of this call. Raises OutputError, before any work, if --output cannot be written."""
    result = parser.parse_args()
    check_output(result.output)
    return result


def check_output(path):
    """Raises OutputError if a file cannot be written because its folder is missing, or because a folder has its name."""
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise OutputError(f"{path}: is a folder (name a file)")


def _say(kind, message):
    print(f"{Path(sys.argv[0]).name}: {kind}: {message}", file=sys.stderr)


def _drop_output():
    """All later output, and output waiting to be written, is lost without another error."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def remark(text):
    """Prints a line about a continuing process; an unreadable output is not an error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        _drop_output()
        _say("warning", f"standard output cannot be written: {error.strerror}; continuing")


def run(main):
    """Calls main() and exits; a PliantError becomes one line on stderr and its exit code, and so does output that does
    not arrive."""
    code = 0
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal without μ or ± gets their codes
            stream.reconfigure(errors="backslashreplace")
    try:
        try:
            main()
        except SystemExit as end:
            code = end.code
        if sys.stdout is not None:
            sys.stdout.flush()
    except PliantError as error:
        _say("error", error)
        code = error.exit_code
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:  # the reader, as in `| head`, has seen enough
        _drop_output()
        code = 141
    except OSError as error:
        if error.filename is not None:
            raise
        _drop_output()
        _say("error", f"standard output cannot be written: {error.strerror}")
        code = OutputError.exit_code
    sys.exit(code)


def with_error(value, error):
    """'1.50 ± 0.03', rounded by the error; '–' for a missing value."""
    if value is None or not np.isfinite(value):
        return "–"
    if error is None or not np.isfinite(error):
        return f"{value:.4g}"
    if error == 0:
        return f"{value:g}"
    return f"{ufloat(value, error):P}".replace("±", " ± ")


def markdown(headers, rows):
    """A Markdown table of strings, its columns aligned."""
    cells = [list(headers)] + [[str(c) for c in row] for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(headers))]
    lines = ["| " + " | ".join(c.ljust(n) for c, n in zip(row, widths)) + " |" for row in cells]
    return "\n".join([lines[0], "|" + "|".join("-" * (n + 2) for n in widths) + "|"] + lines[1:])
