"""When a hopper flowed, and how high its filling stood on the axis: the samples that averages may use."""

from dataclasses import dataclass

import numpy as np

from .errors import RunError

QUIET = 10          # mean times between crossings without one, after which the flow counts as ended
DISCHARGE = 0.2     # share of the particles that left a discharge: the first and the last of these are excluded from
                    # averages
FILLED = 0.8        # share of the largest number density on the axis; a lower density is above the filling


def is_discharge(run):
    return run.scenario == "hopper" and run.parameters.get("flow") == "discharge"


def flow_end(series):
    """Time of the last crossing if the flow ended with it, None if it continued to the end of the series, or never began.

    The flow has ended if no particle has crossed for QUIET times the mean interval between crossings.
    """
    time, crossed = series["time"].to_numpy(), series["crossed_count"].to_numpy()
    if not len(time) or crossed[-1] <= crossed[0]:
        return None
    last = int(np.argmax(crossed >= crossed[-1]))
    apart = (time[last] - time[0]) / (crossed[-1] - crossed[0])
    return float(time[last]) if time[-1] - time[last] > QUIET * apart else None


def flow_rate(time, crossed, bins):
    """Mean flow rate in `bins` equal pieces of the run: edges [bins+1], rates [bins]."""
    edges = np.linspace(time[0], time[-1], bins + 1)
    return edges, np.diff(np.interp(edges, time, crossed)) / np.diff(edges)


def flowing(run, start=None):
    """(start, end, remark) of the time to average over; the remark is None where it is the steady state that
    summary.json names. `start` overrides the first. Raises RunError if the run has not flowed."""
    series = run.series
    time, crossed = series["time"].to_numpy(), series["crossed_count"].to_numpy()
    if not len(time) or crossed[-1] <= crossed[0]:
        raise RunError(f"{run.path}: nothing has crossed the orifice: no flow to average over")
    ended = flow_end(series)
    end = float(time[-1]) if ended is None else ended
    if is_discharge(run) and start is None:
        left = crossed[-1] - crossed[0]
        start, end = (float(time[np.argmax(crossed >= crossed[0] + share * left)]) for share in (DISCHARGE, 1 - DISCHARGE))
        return start, end, "a discharge is never steady"
    remark = None if ended is None else f"the flow ended at t = {end:g} t0"
    if start is not None:
        return start, end, remark
    # A steady state of a run whose flow has ended would describe the particles at rest.
    if ended is None and run.steady_start is not None:
        return run.steady_start, end, None if run.summary.get("steady", True) else "not steady"
    return (float(time[0]) + end) / 2, end, remark or "no steady state in summary.json"


def filling_top(profile):
    """Largest height of the axis profile that lies in the filling: the highest one whose number density is at least
    FILLED of the largest. Above it the reinserted particles fall freely."""
    density = profile.weight.mean(0)
    return float(profile.height[np.flatnonzero(density >= FILLED * density.max())[-1]])


@dataclass(frozen=True)
class AxisVelocity:
    """Velocity along gravity on the axis of a run, up to the top of its filling, in sigma_avg/t0."""

    height: np.ndarray    #: [H] above the orifice
    velocity: np.ndarray  #: [H]
    error: np.ndarray     #: [H] of the steady state, as the program computes it; NaN for other times
    start: float          #: start of the averaged time
    end: float
    remark: str | None    #: as of `flowing`


def axis_velocity(run, start=None):
    """AxisVelocity of a run; `start` overrides the time from which the flow is averaged. Raises RunError if the run has
    not flowed."""
    begin, end, remark = flowing(run, start)
    used = run.profile.between(begin, end)
    if "longest_sample_interval" in run.summary:  # a restart has changed the interval
        used = used.every(run.summary["longest_sample_interval"])
    if not len(used.time):
        raise RunError(f"{run.path}: no samples from t = {begin:g} to {end:g} t0")
    filled = used.height <= filling_top(used)
    with np.errstate(divide="ignore", invalid="ignore"):
        velocity = used.momentum.sum(0) / used.weight.sum(0)
    error = np.full(len(velocity), np.nan)
    if start is None and remark is None:
        known = run.summary.get("axis_velocity", {}).get("error")
        if known is not None:
            error = np.array(known, float)
        elif "axis_velocity" not in run.summary:
            remark = "no errors: summary.json is from an older version"
    return AxisVelocity(used.height[filled], velocity[filled], error[filled], begin, end, remark)
