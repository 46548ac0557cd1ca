"""The scripts that draw runs, for each scenario."""

from .errors import RunError

#: The scripts that draw a run of a scenario.
DRAWN_BY = {"hopper": "snapshot.py, movie.py, forces.py, series.py, profile.py and discharge.py",
            "raft": "raft.py, raft_snapshot.py, snapshot.py and movie.py",
            "clog": "clog_snapshot.py, raft_snapshot.py, snapshot.py and movie.py",
            "pack": "packing.py, density_of_states.py, snapshot.py and movie.py", "shear": "packing.py, snapshot.py and movie.py",
            "vibrate": "series.py, snapshot.py and movie.py",
            "channel": "the channel_ scripts, snapshot.py and movie.py"}


def of_scenario(run, *scenarios):
    """The run; RunError, with the scripts that draw it, if it is not of one of these scenarios."""
    if run.scenario not in scenarios:
        others = f" ({DRAWN_BY[run.scenario]} draw it)" if run.scenario in DRAWN_BY else ""
        raise RunError(f"{run.path}: a run of scenario {run.scenario or 'unknown'}, not of {' or '.join(scenarios)}{others}")
    return run
