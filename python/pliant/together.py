"""Several simulations that advance at the same time.

>>> pliant.advance([pliant.Simulation(x, 1, zeta=0.1, gravity=(0, -1)) for x in starts], 10)
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable

from .engine import core
from .errors import InputError, NumericalError, PliantWarning, UsageError
from .simulation import Simulation, _as_keywords, _integer, _keywords, _number


def _check(simulations):
    """Errors: InputError, UsageError for simulations that cannot advance together."""
    known = set()
    for k, simulation in enumerate(simulations):
        if not isinstance(simulation, Simulation):
            raise InputError(f"simulation {k} is {simulation!r}, which is not a Simulation; give a list of simulations")
        if id(simulation) in known:
            raise InputError(f"simulation {k} is in the list twice; leave it out once")
        known.add(id(simulation))
        if simulation.closed:
            raise UsageError(f"simulation {k} is closed; make another one, or leave it out")
        cure = "and advance() calls no functions of Python; call its run(), or"
        if simulation.force is not None:
            raise InputError(f"simulation {k} has a force function, {cure} set its force to None")
        if simulation._callbacks:
            raise InputError(f"simulation {k} has a callback of every(), {cure} forget() the callback")


def _left(simulation, k, t, until):
    """The time that simulation k is to run for, or None if it has come to the end."""
    if until is None:
        return t
    left, half = until - simulation.t, simulation.dt / 2
    if -half <= left < half:
        return None
    if left < 0:
        raise InputError(f"advance(until={until:g}): simulation {k} is at t = {simulation.t:g} already; give a later time")
    return left


def _first_of(texts, count):
    first, text = next(iter(texts.items()))
    return f"simulation {first}: {text}" if len(texts) == 1 else f"{len(texts)} of {count} simulations, the first is {first}: {text}"


@_as_keywords
def advance(simulations: Iterable[Simulation], t: float | None = None, until: float | None = None,
            threads: int | None = None) -> None:
    """Runs simulations for the time t, or until a time, as run() does, several at the same time: one on each of `threads` threads,
    by default as many as the process has cores. Each simulation ends in the same state, to the last bit, as after its run().
    Simulations with `output` write their folders.

    until: a simulation that is within half a step of this time does not move, so that the call can be repeated.
    Errors: InputError, before any simulation has moved, for a list with a simulation that has a force function, callbacks of every()
    or an integrator of PETSc, because Python and PETSc compute on one thread. A simulation that fails does not stop the others: when
    they have ended, advance() raises an error of the type of the failed simulation that is first in the list; its attribute `errors`
    has the errors of all failed simulations by number in the list. Ctrl-C stops simulations in progress after their current step."""
    if not isinstance(simulations, Iterable):
        raise InputError(f"simulations: {simulations!r} is not a list of simulations; give one")
    members = list(simulations)
    if (t is None) == (until is None):
        raise InputError("give advance() either the time t that it lasts, or until, the time of its end")
    most = len(os.sched_getaffinity(0)) if threads is None else _integer(threads, "threads")
    if most < 1:
        raise InputError(f"threads is {threads}, but must be at least 1")
    _check(members)
    end = _number(t, "t") if until is None else _number(until, "until")
    left = [_left(simulation, k, end, until) for k, simulation in enumerate(members)]
    ends = [None if time is None else simulation.t + time for simulation, time in zip(members, left)]
    errors, interruption = core.advance([simulation._core for simulation in members], left, most)
    failures, said = {}, {}
    for k, (simulation, error, target) in enumerate(zip(members, errors, ends)):
        if target is None and (before := simulation._core.failure):
            error = NumericalError(before)  # of the call that brought it to this time
        if error is not None:
            simulation._interrupted(error)
            failures[k] = type(error)(_keywords(str(error)))
        elif target is not None:
            if interruption is not None and abs(target - simulation.t) > simulation.dt / 2:
                simulation._interrupted(interruption)
            else:
                simulation._core.interrupt("")
        if warning := simulation._core.take_warning():
            said[k] = _keywords(warning)
    failure = None
    if failures:
        failure = type(next(iter(failures.values())))(_first_of(failures, len(members)))
        failure.errors = failures
    try:
        if said:
            warnings.warn(_first_of(said, len(members)), PliantWarning, stacklevel=3)
    finally:
        if interruption is not None:
            raise interruption from failure
        if failure is not None:
            raise failure
