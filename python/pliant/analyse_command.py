"""pliant-analyse: quantities measured from frames after a run, or from tables of tracked data."""

import argparse
import math
import types
import typing
from dataclasses import fields
from pathlib import Path

import numpy as np

from . import channel_analysis as channel, pooling, tracks
from .errors import RunError
from .files import finite, read_json, write_json
from .run import Run
from .script import check_output, markdown, with_error
from .sweep import load_runs

_DESCRIPTION = """Non-affine motion of disks that are pushed through a channel: mean displacement field, non-affine
displacement, D2_min, strain clock and rotation. Reads run folders and CSV tables with the columns frame, particle, x,
y, r and, if they are there, angle, push, time, plunger_travel. docs/scenarios/channel-analysis.md has the formulas."""

_EPILOG = """examples:
  pliant-analyse channel runs/bidisperse                          # writes runs/bidisperse/analysis.json
  pliant-analyse channel tracks.csv --scale 0.0254 --flip-y       # writes tracks.analysis.json
  pliant-analyse channel runs/T* --field pooled                   # one file per run

exit codes: 0 done, 2 bad input, 4 output failed"""

RESULT = "analysis.json"


def result_path(path):
    """Where the analysis of a run folder or a table is written."""
    path = Path(path)
    return path / RESULT if path.is_dir() else path.with_name(f"{path.stem}.{RESULT}")


def load_result(path):
    """The analysis of a run folder, of a table, or in a .json file, with NaN for null. Raises RunError, also where a run folder has
    an analysis of an earlier state of the run."""
    path = Path(path)
    if not path.exists():
        raise RunError(f"{path}: no such file or folder")
    file = path if path.suffix == ".json" else result_path(path)
    if not file.exists():
        raise RunError(f"{path}: there is no {file.name}; write it by pliant-analyse channel {path}")
    result = read_result(file)
    if file.name == RESULT and (file.parent / "run.h5").exists():
        with Run(file.parent) as run:
            if result["run"] != tracks.state_of(run):
                raise RunError(f"{file}: the run has changed since this analysis, or an older version wrote it; repeat it by "
                               f"pliant-analyse channel {file.parent}")
    return result


def read_result(file):
    """The analysis in a .json file, with NaN for null; of any state of its run. Raises RunError."""
    def known(value):
        if isinstance(value, dict):
            return {key: known(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [known(entry) for entry in value]
        return math.nan if value is None else value

    result = read_json(file)
    if result is None or result.get("analysis") != "channel" or not isinstance(result.get("choices"), dict):
        raise RunError(f"{file}: not an analysis of a channel (write it by pliant-analyse channel)")
    # There null means: not used, no run.
    plain = {"choices": result.pop("choices"), "run": result.pop("run", None)}
    return known(result) | plain


def write_result(path, result):
    """Raises OutputError."""
    write_json(path, finite(result))


def _number_type(annotation):
    """int or float of `int`, `float | None` …"""
    if isinstance(annotation, types.UnionType):
        annotation = next(t for t in typing.get_args(annotation) if t is not type(None))
    return annotation


def _add_choices(parser):
    group = parser.add_argument_group("choices (all are in the result)")
    for f in fields(channel.Choices):
        unit = f" [{f.metadata['unit']}]" if f.metadata["unit"] else ""
        shown = " ".join(f"{v:g}" for v in f.default) if isinstance(f.default, tuple) else f.default
        text = f.metadata["help"] + unit + (f" (default: {shown})" if f.default is not None else "")
        options = {"default": f.default, "help": text.replace("%", "%%")}
        if "choices" in f.metadata:
            options["choices"] = f.metadata["choices"]
        elif "numbers" in f.metadata:
            options |= {"nargs": len(f.metadata["numbers"]), "type": float, "metavar": f.metadata["numbers"]}
        else:
            options |= {"type": _number_type(f.type), "metavar": "N" if _number_type(f.type) is int else "X"}
        group.add_argument("--" + f.name.replace("_", "-"), **options)


def channel_options(one):
    """Adds the options of `pliant-analyse channel` to a parser."""
    one.add_argument("path", nargs="+", type=Path, metavar="DIR|TABLE.csv", help="run folders or tables")
    one.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"file to write, of a single path (default: "
                     f"DIR/{RESULT}, TABLE.{RESULT})")
    _add_choices(one)
    table = one.add_argument_group("tables")
    table.add_argument("--scale", type=float, default=1.0, metavar="X", help="cm per unit of x, y and r (default: 1)")
    table.add_argument("--origin", type=float, nargs=2, default=(0.0, 0.0), metavar=("X", "Y"),
                       help="outer corner of the channel, in the table's units (default: 0 0)")
    table.add_argument("--flip-y", action="store_true", help="y points down, as in pictures")
    table.add_argument("--fps", type=float, default=6.0, metavar="X",
                       help="frames per second, without the column time (default: 6)")
    table.add_argument("--plunger-speed", type=float, default=0.22, metavar="X",
                       help="cm/s, without the column plunger_travel (default: 0.22)")
    table.add_argument("--frames-per-push", type=int, metavar="N",
                       help="push = frame // N, without the column push (default: one push)")
    table.add_argument("--angle-unit", choices=sorted(tracks.ANGLE_UNITS), default="radians")
    table.add_argument("--angle-period", type=float, default=2 * np.pi, metavar="RAD",
                       help="angles are known up to a multiple of this; pi for a rectangle's (default: 2 pi)")


def _parser():
    looks = {"description": _DESCRIPTION, "epilog": _EPILOG, "formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = argparse.ArgumentParser(prog="pliant-analyse", **looks)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    channel_options(kinds.add_parser("channel", help="disks that are pushed through a channel", **looks))
    return parser


def _table_options(given):
    for name in ("scale", "fps", "plunger_speed", "angle_period"):
        value = getattr(given, name)
        if not (math.isfinite(value) and value > 0):
            raise RunError(f"--{name.replace('_', '-')} {value:g}: must be more than 0")
    if given.frames_per_push is not None and given.frames_per_push < 2:
        raise RunError(f"--frames-per-push {given.frames_per_push}: at least 2")
    if not np.isfinite(given.origin).all():
        raise RunError("--origin: needs two numbers")
    return {name: getattr(given, name) for name in ("scale", "origin", "flip_y", "fps", "plunger_speed",
                                                    "frames_per_push", "angle_unit", "angle_period")}


def _check_pooled(paths):
    """Raises RunError for runs that cannot have one mean field: equal ones, or runs that differ in more than their disks."""
    folders = [path for path in paths if path.is_dir()]
    if len(pooling.distinct_paths(paths)) < len(paths):
        raise RunError("--field pooled: a run or table is given several times; give each once")
    if folders:
        runs, table = pooling.distinct_runs(load_runs(folders), "channel")
        if len(runs) < len(folders):
            raise RunError("--field pooled: several runs have equal options and seeds; give one of them")
        pooling.check(table, "channel", pooling.DISKS)


def _print_summary(path, result):
    rows = [(name, unit, *(with_error(result[name][region]["value"], result[name][region]["error"])
                           for region in channel.REGIONS))
            for name, unit in (("dr_na", "<R>"), ("d2_min_sum", "<R>^2"), ("d2_min_per_neighbour", "<R>^2"),
                               ("exponent_dr_na", ""), ("exponent_d2_min", ""), ("rotation", "rad"),
                               ("rotation_turns", "turns"))]
    print(f"{path}: {result['pushes']} pushes, {result['frames']} frames, {result['disks']} disks, <R> = "
          f"{result['mean_radius']:.4g} cm, delta = {result['polydispersity']:.3f}; displacements over "
          f"{result['interval']['travel']:.4g} cm of travel ({result['interval']['time']:.4g} s)\n")
    print(markdown(["quantity", "unit", *channel.REGIONS], rows), end="\n\n")


def main(arguments=None):
    given = _parser().parse_args(arguments)
    if given.output is not None and len(given.path) > 1:
        raise RunError("--output names one file; leave it out with more than one run or table")
    outputs = [given.output or result_path(path) for path in given.path]
    for output in outputs:
        if given.output or output.is_dir():
            check_output(output)
    chosen = {f.name: getattr(given, f.name) for f in fields(channel.Choices)}
    chosen = {name: tuple(value) if isinstance(value, list) else value for name, value in chosen.items()}
    choices, options = channel.Choices(**chosen), _table_options(given)
    if choices.field == "pooled":
        _check_pooled(given.path)
    runs = [tracks.load(path, **options) for path in given.path]
    results = channel.analyse(runs, choices)
    for path, output, result in zip(given.path, outputs, results):
        if path.is_file():
            result["choices"]["table"] = options
        write_result(output, result)
        _print_summary(path, result)
        print(f"wrote {output}")
