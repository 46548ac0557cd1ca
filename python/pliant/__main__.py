"""Continues the run of a pliant.Simulation from its last checkpoint, in its folder, without the program that has made it."""

import argparse
import sys

from . import script
from .errors import InputError
from .simulation import Simulation


def main():
    sys.argv[0] = "python3 -m pliant"  # in messages
    parser = argparse.ArgumentParser(prog=sys.argv[0], description=__doc__,
                                     epilog="Ctrl-C writes a checkpoint. A run of a scenario continues with "
                                            "`pliant SCENARIO -restart FOLDER`.")
    parser.add_argument("folder", help="output of the Simulation")
    parser.add_argument("--until", type=float, required=True, metavar="T", help="time of the end")
    parser.add_argument("--without-functions", action="store_true",
                        help="also if the run called functions of Python (callbacks, force); they are not called any more")
    arguments = parser.parse_args()
    with Simulation.restart(arguments.folder) as sim:
        if sim.called_functions and not arguments.without_functions:
            raise InputError(f"{arguments.folder}: the run called functions of its Python program (callbacks or a force), which no "
                             "checkpoint contains; continue it there with pliant.Simulation.restart, or without them by "
                             "--without-functions")
        sim.run(until=arguments.until)
        print(f"{arguments.folder}: t = {sim.t:g}, {sim.steps} steps")


if __name__ == "__main__":
    script.run(main)
