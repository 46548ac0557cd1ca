"""Contents of the report of a run, apart from its frames: results, time series, profiles and fits, options."""

import math

import numpy as np

from ..flow import axis_velocity, flow_end, flow_rate, is_discharge
from ..symbols import model_name
from .frames import force_unit, units

_SAMPLES = 800  # of a curve, at most
_BINS = 60      # intervals of the flow rate

#: Members of summary.json that are counters or settings, not results.
_COUNTERS = {"seed", "t", "dt", "dt_critical", "steps", "rejected_steps", "steps_above_tolerance", "force_evaluations", "jacobian_evaluations",
             "linear_iterations", "list_rebuilds", "skin", "packing_iterations", "cpu_seconds", "wall_seconds", "particles",
             "particle_steps_per_second", "ns_per_particle_step", "ns_per_vertex_step", "steady", "longest_sample_interval"}

#: Options that do not change a run.
_OF_THE_COMMAND = ("output", "ensemble", "ensemble_over", "ensemble_workers")

#: Names of quantities in summary.json → label.
_LABELS = {
    "fraction": "packing fraction φ", "pressure": "pressure p", "shear_stress": "shear stress σ_xy", "strain": "strain γ",
    "shear_modulus": "shear modulus G", "bulk_modulus": "bulk modulus B", "coordination": "touching neighbours per particle",
    "contacts": "contacts without rattlers", "isostatic_contacts": "isostatic number of contacts", "touching_pairs": "touching pairs",
    "zero_modes": "modes with the frequency zero",
    "rattlers": "rattlers", "backbone": "particles without rattlers", "energy": "energy U", "max_force": "largest force on a point",
    "Q": "flow rate Q", "Q_corrected": "flow rate over packing fraction at the orifice, Q′", "Q_correlation_time": "correlation time of Q",
    "orifice_density": "number density at the orifice", "orifice_velocity": "velocity at the orifice", "bulk_fraction": "packing fraction",
    "contacts_per_particle": "contacts per particle", "top_height": "height of the filling", "max_overlap": "largest overlap",
    "c0": "discharge coefficient c0", "c0_chi2_per_dof": "χ² per degree of freedom of c0", "c0_start": "start of the fit of c0",
    "c0_end": "end of the fit of c0", "c0_start_count": "particles at the start of the fit", "c0_residue": "particles that stay",
    "left_in_hopper": "particles in the hopper at the end", "flow_ended": "last crossing", "total_time": "time until empty",
    "steady_start": "start of the steady state", "steady_samples": "samples in the steady state", "crossed_count": "particles that crossed",
    "drag_friction_ratio": "drag over friction", "largest_wall_overlap": "largest overlap with a wall, over the radius",
    "passing_overlap": "particles that passed through each other", "self_crossing_particles": "particles that cross themselves",
    "avalanche_size": "avalanche size s", "capillary_length": "capillary length δ", "w_over_capillary_length": "w/δ",
    "work": "work of walls or of the box", "relaxed": "energy removed by minimisations", "dissipated": "dissipated energy", "budget_error": "error of the energy budget",
    "wall_distance": "distance of the walls", "start_distance": "distance of the walls at the start", "rows": "rows", "broken": "broken bonds",
    "formed": "formed bonds", "d_eq": "rest distance of two droplets", "k1": "stiffness of a bond", "E1": "energy of a bond",
    "h_eq": "rest distance from a wall", "k_wall": "stiffness at a wall", "E_wall": "energy of a bond with a wall",
    "largest_overlap": "largest overlap", "largest_plunger_force": "largest force on a plunger", "plunger_work": "work of the plungers",
    "heat": "dissipated energy", "area_fraction": "area fraction", "weight": "weight of all disks", "pushes": "pushes",
    "frame_travel": "travel between frames", "opened_at": "time at which the lid opened",
    "acceleration": "largest acceleration of the container", "mean_height": "centre of mass above the floor",
    "fluctuation_energy": "energy of velocity fluctuations", "power": "power of the walls", "steady_cycles": "cycles in the steady state",
}

#: Columns of /series → (label, kind of unit); a kind is a key of _kinds.
_COLUMNS = {
    "crossed_count": ("particles that crossed", ""), "crossed_area": ("area that crossed", "volume"), "in_hopper": ("particles in the hopper", ""),
    "kinetic_energy": ("kinetic energy", "energy"), "potential_energy": ("potential energy", "energy"), "contact_pairs": ("touching pairs", ""),
    "drag_force": ("mean drag force", "force"), "friction_force": ("mean friction force", "force"), "heat": ("dissipated energy", "energy"),
    "orifice_density": ("number density at the orifice", "density"), "bulk_fraction": ("packing fraction", ""),
    "top_height": ("height of the filling", "length"), "max_speed": ("largest speed", "speed"), "max_overlap": ("largest overlap", ""),
    "self_crossing_particles": ("particles that cross themselves", ""), "dt": ("time step", "time"), "bonds": ("bonds", ""),
    "tense_bonds": ("bonds under tension", ""), "energy": ("energy", "energy"), "work": ("work of walls, reinsertion or the box", "energy"), "relaxed": ("energy removed by minimisations", "energy"),
    "gravity_energy": ("energy of the weight", "energy"), "cycle": ("cycle", ""), "displacement": ("displacement of the container", "length"),
    "mean_height": ("centre of mass above the floor", "length"), "fluctuation_energy": ("energy of velocity fluctuations", "energy"),
    "wall_force": ("force on the container", "force"),
    "dissipated": ("dissipated energy", "energy"), "withdrawn": ("withdrawn energy", "energy"), "budget_error": ("error of the energy budget", "energy"),
    "wall_distance": ("distance of the walls", "length"), "fixed_wall_force": ("force on the fixed wall", "force"),
    "moving_wall_force": ("force on the moving wall", "force"), "fixed_wall_bonds": ("droplets bound to the fixed wall", ""),
    "moving_wall_bonds": ("droplets bound to the moving wall", ""), "rows": ("rows", ""), "broken": ("broken bonds", ""),
    "formed": ("formed bonds", ""), "open": ("lid open", ""), "left": ("droplets that left", ""), "push": ("push", ""),
    "plunger_travel": ("travel of the plunger", "length"), "elastic_energy": ("elastic energy", "energy"), "plunger_work": ("work of the plungers", "energy"),
}
#: Series that come first, in this order.
_FIRST = ("crossed_area", "kinetic_energy", "contact_pairs", "top_height", "bulk_fraction", "bonds", "wall_distance", "in_hopper", "left",
          "plunger_travel")
_SCENARIOS = {"hopper": "hopper flow", "raft": "raft of droplets", "clog": "clog of droplets", "channel": "bent channel",
              "pack": "jammed packing", "shear": "shear of a packing", "vibrate": "vibrated container"}


def _kinds(run):
    length, time = units(run)
    d = run.dim
    if run.scenario == "channel":
        energy = "erg"
    elif run.scenario in ("pack", "shear"):
        energy = "eps"
    else:
        energy = "F0 R" if run.droplets else f"rho g sigma_avg^{d + 1}"
    return {"": "", "length": length, "time": time, "speed": f"{length}/{time}", "volume": f"{length}^{d}", "density": f"{length}^-{d}",
            "force": force_unit(run), "energy": energy}


# ---- header ----------------------------------------------------------------------------------------------------------

TONES = {"done": "good", "clogged": "good", "at_rest": "good", "empty": "good", "jammed": "good", "failed": "bad", "damaged": "bad"}


def status_of(run, running):
    """{text, tone} of a run; `running`: whether a process writes to its folder."""
    text = "running" if running else run.summary.get("status", "not ended")
    return {"text": str(text).replace("_", " "), "tone": TONES.get(text, "busy")}


def subtitle(run):
    model = model_name(run)
    scenario = _SCENARIOS.get(run.scenario, run.scenario)
    count = run.topology.particles
    return f"{scenario} · {model} · {run.dim}D · {count} particle{'s' * (count != 1)}"


# ---- results and options ---------------------------------------------------------------------------------------------

def results(run):
    """[{name, label, value, error, unit}] of the quantities in summary.json."""
    found = []
    for name, entry in run.summary.items():
        if name in _COUNTERS or name in ("parameters", "energy_audit") or isinstance(entry, (bool, str, list)) or entry is None:
            continue
        unit = entry.get("unit") or "" if isinstance(entry, dict) else ""
        if isinstance(entry, dict) and "value" not in entry:
            continue
        value, error = run.measured(name)
        if math.isfinite(value):
            found.append({"name": name, "label": _LABELS.get(name, name), "value": value, "error": error, "unit": unit})
    order = {name: place for place, name in enumerate(_LABELS)}
    return sorted(found, key=lambda one: order.get(one["name"], len(order)))


def parameters(run):
    """[{name, value, unit, term, given}] of all options that the run's model reads."""
    listed = run.manifest["options"] | run.summary.get("parameters", {})
    unread = set(run.unread_parameters)
    found = []
    for name, entry in listed.items():
        entry = entry if isinstance(entry, dict) else {"value": entry}
        if name in unread or name in _OF_THE_COMMAND:
            continue
        first = run.manifest["options"].get(name)
        default = first.get("is_default", first.get("source") == "default") if isinstance(first, dict) else False
        found.append({"name": name, "value": value_text(entry.get("value")), "unit": entry.get("unit") or "", "term": entry.get("term"),
                      "given": not default})
    return sorted(found, key=lambda one: one["name"])


def value_text(value):
    """A value of an option as the command line takes it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(map(value_text, value))
    return "automatic" if value is None else str(value)


def details(run):
    """[(label, value)] of the program, its steps and its cost."""
    s, m = run.summary, run.manifest
    audit = s.get("energy_audit") if isinstance(s.get("energy_audit"), dict) else {}
    relative = audit.get("relative_error")
    entries = [
        ("folder", str(run.path)), ("ended by", s.get("ended_by") or s.get("message")), ("steady state", s.get("steady_explanation")),
        ("integrator", s.get("integrator")), ("time step", s.get("dt")), ("stability limit", s.get("dt_critical")), ("steps", s.get("steps")),
        ("error of the energy balance", f"{100 * relative:.2g} %" if isinstance(relative, (int, float)) else None),
        ("computing time", f"{s['cpu_seconds']:.3g} s" if isinstance(s.get("cpu_seconds"), (int, float)) else None),
        ("per particle and step", f"{s['ns_per_particle_step']:.3g} ns" if isinstance(s.get("ns_per_particle_step"), (int, float)) else None),
        ("seed", m.get("seed")), ("started", m.get("created")), ("program", f"pliant {m.get('version', '')}"), ("build", m.get("build"))]
    return [(label, value_text(value) if isinstance(value, (int, float)) else str(value)) for label, value in entries if value is not None]


# ---- charts ----------------------------------------------------------------------------------------------------------

def _thin(x, y):
    """The curve with at most _SAMPLES points that keeps the extremes of every piece."""
    if len(x) <= _SAMPLES:
        return x, y
    edges = np.linspace(0, len(x), _SAMPLES // 2 + 1).astype(int)
    kept = []
    for a, b in zip(edges[:-1], edges[1:]):
        piece = y[a:b]
        known = np.flatnonzero(np.isfinite(piece))
        if len(known):
            kept.extend({a + known[np.argmin(piece[known])], a + known[np.argmax(piece[known])]})
    kept = np.unique([0, *kept, len(x) - 1])
    return x[kept], y[kept]


def numbers(values):
    """List with six digits, enough for a chart."""
    return [float(f"{v:.6g}") for v in np.asarray(values, float)]


def line(x, y, thin=True, **notes):
    """A line of a chart; `notes`: kind (line, steps, points), label, colour, dashed, error, low, high."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if thin:
        x, y = _thin(x, y)
    return {"x": numbers(x), "y": numbers(y)} | {k: numbers(v) if k in ("error", "low", "high") else v for k, v in notes.items()}


def series_charts(run):
    """(charts of the columns of /series that change, the flow rate of a hopper first; a sentence on the others). Raises
    RunError for damaged data."""
    series = run.series
    if len(series) < 2:
        return [], "The run has fewer than two samples: -sample_interval sets the time between them."
    kinds, time, charts, constant = _kinds(run), series["time"].to_numpy(), [], []
    axis = {"label": "time", "unit": units(run)[1]}
    marks, spans = _marks(run)
    common = {"x": axis, "marks": marks, "spans": spans}
    if run.scenario == "hopper" and "crossed_area" in series:
        charts.append(_flow_chart(run, kinds, common))
    names = [c for c in series.columns if c not in ("time", "crossed_area") or (c == "crossed_area" and run.scenario != "hopper")]
    order = {name: place for place, name in enumerate(_FIRST)}
    for name in sorted(names, key=lambda n: order.get(n, len(order))):
        values = series[name].to_numpy(float)
        known = values[np.isfinite(values)]
        label, kind = _COLUMNS.get(name, (name.replace("_", " "), "energy" if name.endswith(("energy", "_sliding", "_damping")) else ""))
        if not len(known) or known.min() == known.max():
            constant.append(f"{label} {value_text(float(known[0])) if len(known) else 'unknown'}")
            continue
        charts.append(common | {"title": label, "unit": kinds[kind], "lines": [line(time, values, colour=len(charts) % 6)]})
    for chart in charts[1:]:
        chart["marks"] = [mark | {"text": ""} for mark in marks]
    return charts, f"Constant in time: {', '.join(constant)}." if constant else ""


def _marks(run):
    """Marks and spans of charts against time: the steady state, and the time without flow."""
    if run.scenario != "hopper" or "crossed_count" not in run.series:
        return [], []
    ended = flow_end(run.series)
    if ended is not None:
        return [{"x": ended, "text": "flow ends"}], [{"from": ended, "to": float(run.series["time"].iloc[-1])}]
    if run.steady_start is None:
        return [], []
    return [{"x": run.steady_start, "text": "steady state" if run.summary.get("steady") else "averages from here"}], []


def _flow_chart(run, kinds, common):
    series = run.series
    time, crossed = series["time"].to_numpy(), series["crossed_area"].to_numpy()
    ended = flow_end(series)
    flow = slice(None) if ended is None else time <= ended
    edges, rate = flow_rate(time[flow], crossed[flow], max(1, min(_BINS, len(time[flow]) - 1)))
    lines = [line(edges, [*rate, rate[-1]], thin=False, kind="steps", label="mean of short intervals", colour=0)]
    value, error = run.measured("Q")
    if ended is None and run.steady_start is not None and math.isfinite(value):
        span, half = [run.steady_start, time[-1]], 0.0 if math.isnan(error) else error
        lines.append(line(span, [value] * 2, label="Q, steady state", colour=1, low=[value - half] * 2, high=[value + half] * 2))
    return common | {"title": "flow rate", "unit": f"{kinds['volume']}/{kinds['time']}", "lines": lines, "zero": True}


def fit_charts(run):
    """The chart of the profile or fit of the scenario, if it has one. Raises RunError."""
    makers = {"hopper": _discharge_chart if is_discharge(run) else _profile_chart, "raft": _force_chart, "channel": _plunger_chart}
    chart = makers[run.scenario](run, _kinds(run)) if run.scenario in makers else None
    return [chart] if chart else []


def _profile_chart(run, kinds):
    curve = axis_velocity(run)
    used = f"Mean from t = {curve.start:g} to {curve.end:g} with block errors, up to the top of the filling"
    return {"title": "velocity on the axis along gravity", "unit": kinds["speed"], "x": {"label": "height above the orifice", "unit": kinds["length"]},
            "zero": bool((curve.velocity - np.nan_to_num(curve.error)).min() > 0),
            "lines": [line(curve.height, curve.velocity, thin=False, low=curve.velocity - curve.error, high=curve.velocity + curve.error)],
            "note": used + (f" ({curve.remark})." if curve.remark else ".")}


def _discharge_chart(run, kinds):
    if "in_hopper" not in run.series:
        return None
    time, left = run.series["time"].to_numpy(), run.series["in_hopper"].to_numpy()
    lines = [line(time, left, label="particles in the hopper")]
    c0, error = run.measured("c0")
    start, end, count, chi2 = (run.measured(f"c0_{name}")[0] for name in ("start", "end", "start_count", "chi2_per_dof"))
    note = "The law dN/dt = −c0 √(N − N_res) has not been fitted (the run has not ended, or too few particles have left)."
    if np.isfinite([c0, start, end, count]).all():
        residue = int(run.summary.get("c0_residue", 0))
        t = np.linspace(start, end, 100)
        lines.append(line(t, residue + np.maximum(np.sqrt(count) - c0 * (t - start) / 2, 0) ** 2, label="law", colour=1))
        note = f"Law dN/dt = −c0 √(N − {residue}), fitted from t = {start:.4g} to {end:.4g}: c0 = {c0:.4g} ± {error:.2g}, χ²/dof = {chi2:.2g}."
    return {"title": "discharge", "unit": "", "x": {"label": "time", "unit": kinds["time"]}, "lines": lines, "note": note, "zero": True}


def _force_chart(run, kinds):
    series = run.series
    if not {"fixed_wall_force", "moving_wall_force", "wall_distance"} <= set(series):
        return None
    force = (series["fixed_wall_force"] + series["moving_wall_force"]).to_numpy() / 2
    distance = series["wall_distance"].to_numpy()
    lines = [line(distance, force)]
    note = "Mean of both walls; positive: the raft pushes the walls apart."
    if run.summary:
        from .. import raft_analysis  # imports scipy.signal, which other scenarios do not need
        curve = raft_analysis.Compression.of(run)
        peaks = curve.peaks()
        lines[0]["label"] = "force"
        lines.append(line(distance[peaks], force[peaks], thin=False, kind="points", label=f"{len(peaks)} peaks", colour=1))
        table = curve.reductions()
        if len(table):
            k1, error = raft_analysis.fit_k1(table)
            note += f" Stiffness of a bond from {len(table)} reductions of rows: k1 = {k1:.3g}" + (f" ± {error:.1g}." if math.isfinite(error) else ".")
    falling = bool(len(distance) and distance[-1] < distance[0])
    return {"title": "force on the walls", "unit": kinds["force"], "x": {"label": "distance of the walls", "unit": kinds["length"], "reversed": falling},
            "lines": lines, "note": note}


def _plunger_chart(run, kinds):
    """Force on the plunger against its travel, a line per push; at most six pushes."""
    series = run.series
    force = run.vector_series.get("plunger_force")
    if force is None or not {"push", "plunger_travel"} <= set(series):
        return None
    push, travel = series["push"].to_numpy(), series["plunger_travel"].to_numpy()
    pushes = np.unique(push)[:6]
    lines = []
    for i, number in enumerate(pushes):
        rows = push == number
        active = np.argmax(np.abs(force[rows]).max(axis=0))
        lines.append(line(travel[rows], force[rows][:, active], label=f"push {int(number)}", colour=i))
    return {"title": "force on the plunger", "unit": kinds["force"], "x": {"label": "travel of the plunger", "unit": kinds["length"]}, "lines": lines,
            "note": f"The first {len(pushes)} pushes." if len(np.unique(push)) > len(pushes) else None}
