"""Several simulations that advance at the same time.

>>> pliant.advance([pliant.Simulation(x, 1, zeta=0.1, gravity=(0, -1)) for x in starts], 10)
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable

from .engine import core
from .errors import InputError, PliantError, PliantWarning, UsageError
from .simulation import _OPTION, Simulation, _as_keywords, _integer, _number


def _check(simulations):
    """Errors: InputError, UsageError for simulations that cannot advance together."""
    for k, simulation in enumerate(simulations):
        if not isinstance(simulation, Simulation):
            raise InputError(f"simulation {k} is {simulation!r}, which is not a Simulation; give a list of simulations")
        if any(simulation is other for other in simulations[:k]):
            raise InputError(f"simulation {k} is in the list twice; leave it out once")
        if simulation.closed:
            raise UsageError(f"simulation {k} is closed; make another one, or leave it out")
        if simulation._callbacks or simulation.force is not None:
            raise InputError(f"simulation {k} calls functions of Python, one of every() or a force, and advance() calls none; call its "
                             "run(), or forget() the function")


def _left(simulation, k, t, until):
    """The time that simulation k is to run for, or None if it has come to the end."""
    if until is None:
        return t
    left = until - simulation.t
    if abs(left) <= simulation.dt / 2:
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

    until: a simulation that is at that time already does not move, so that the call can be repeated. Output folders are written.
    Errors: InputError, before any simulation has moved, for one with callbacks of every(), with a force function or with an
    integrator of PETSc, because Python and PETSc compute on one thread. A simulation that fails does not stop the others: once they
    have ended, advance() raises the error of the first one, whose `errors` has the errors by number in the list. Ctrl-C stops all
    simulations, each after a step, at different times."""
    if isinstance(simulations, Simulation):
        raise InputError("advance() takes a list of simulations; give [simulation], or call its run()")
    members = list(simulations)
    if (t is None) == (until is None):
        raise InputError("give advance() either the time t that it lasts, or until, the time of its end")
    most = len(os.sched_getaffinity(0)) if threads is None else _integer(threads, "threads")
    if most < 1:
        raise InputError(f"threads is {threads}, but must be at least 1")
    _check(members)
    end = _number(t, "t") if until is None else _number(until, "until")
    left = [_left(simulation, k, end, until) for k, simulation in enumerate(members)]
    try:
        ends = core.advance([simulation._core for simulation in members], left, most)
    except PliantError:  # nothing has moved
        raise
    except BaseException as error:
        for simulation in members:
            simulation._interrupted(error)
        raise
    errors = {k: error for k, error in enumerate(ends) if error is not None}
    said = {}
    for k, simulation in enumerate(members):
        if k in errors:
            simulation._interrupted(errors[k])
        elif left[k] is not None:
            simulation._core.interrupt("")
        if warning := simulation._core.take_warning():
            said[k] = _OPTION.sub(r"\1", warning)
    if said:
        warnings.warn(_first_of(said, len(members)), PliantWarning, stacklevel=3)
    if errors:
        failure = type(next(iter(errors.values())))(_first_of(errors, len(members)))
        failure.errors = errors
        raise failure
