"""Continues the run of a pliant.Simulation from its last checkpoint, in its folder, without the program that has made it."""

import argparse
import signal
import sys

from . import script
from .errors import InputError
from .simulation import Simulation

STOPPED = 75  # exit code, as of the program
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGXCPU)


class Stopped(Exception):
    """A signal has come."""


def _stop(number, _):
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN)  # the checkpoint takes less than a second
    raise Stopped(signal.Signals(number).name)


def main():
    sys.argv[0] = "python3 -m pliant"  # in messages
    parser = argparse.ArgumentParser(prog=sys.argv[0], description=__doc__,
                                     epilog="Ctrl-C and SIGTERM end the run with a checkpoint and exit code 75. A run of a scenario "
                                            "continues with `pliant SCENARIO -restart FOLDER`.")
    parser.add_argument("folder", help="output of the Simulation")
    parser.add_argument("--until", type=float, required=True, metavar="T", help="time of the end")
    parser.add_argument("--without-functions", action="store_true",
                        help="also if the run called functions of Python (callbacks, force); they are not called any more")
    arguments = parser.parse_args()
    sim = Simulation.restart(arguments.folder)
    try:
        if sim.called_functions and not arguments.without_functions:
            raise InputError(f"{arguments.folder}: the run called functions of its Python program (callbacks or a force), which no "
                             "checkpoint contains; continue it there with pliant.Simulation.restart, or without them by "
                             "--without-functions")
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _stop)
        sim.run(until=arguments.until)
        print(f"{arguments.folder}: t = {sim.t:g}, {sim.steps} steps")
    except Stopped:
        print(f"stopped at t = {sim.t:.6g} with a checkpoint; run the same command again to resume")
        raise SystemExit(STOPPED) from None
    finally:
        sim.close()


if __name__ == "__main__":
    script.run(main)
