#!/usr/bin/python3
"""Work against precision of integrators; called by `scripts/work-precision.sh`.

Writes FOLDER/performance-data/work-precision-*.csv, FOLDER/images/work-precision-*.webp and the tables of
FOLDER/validation/integrators.md."""

import json
import math
import sys
from itertools import pairwise

import numpy as np

from harness import BenchError, Context, measure, parser, read_csv, run, say, write_csv
from report import ABOVE, COLORS, MARKERS, cell, insert, origin, plt, save, table

from pliant import Run  # report.py sets the path

#: Errors at which methods are compared, relative to the standard run, which has the default fixed step.
TARGETS = {"10 e₀": 10, "e₀": 1, "e₀/10": 0.1, "e₀/100": 0.01, "e₀/1000": 0.001}
ERRORS = {"error": "rms error of positions / σ_avg", "energy_error": "largest error of the energy / energy of the fall",
          "statistics": "relative error of the mean energy"}
DASHED = ("implicit", "imex", "bdf", "rosw", "alpha", "mri")  # words in the names of methods that solve equations

PROBLEMS = ["smooth-drag", "smooth", "rough", "droplets", "bounce", "settling", "settled"]
FLOWS = {"flow-rough": "rough", "flow-smooth": "smooth"}
#: Dense flow with drag, whole runs: rows of (name, dt over the limit of one contact, or options).
FLOW = ("-n 60 -hopper_wall_distance 8 -hopper_width 4 -mu 0 -zeta 0.316 -sample_interval 0.05 -frame_interval 1000 "
        "-max_wall_time 200 -model")
CONTROLLED = "-integrator ts -ts_type verlet -ts_adapt_type basic -ts_adapt_dt_max 0.02"
FLOW_METHODS = {"verlet, 0.2": 0.2, "verlet, 0.35": 0.35, "verlet, 0.5": 0.5, "verlet, 0.7": 0.7,
                **{f"controlled verlet, {e}": f"{CONTROLLED} -ts_rtol {e} -ts_atol {e}" for e in ("1e-2", "3e-3", "1e-3")},
                "rk 3bs, 1e-3": "-integrator ts -ts_rk_type 3bs -ts_adapt_dt_max 0.02 -ts_rtol 1e-3 -ts_atol 1e-3"}
FLOW_COLUMNS = {"kinetic_energy": "kinetic energy", "potential_energy": "potential energy",
                "contact_pairs": "contacts", "flow": "Q", "max_overlap": "largest overlap"}


def mean_of_blocks(values, blocks):
    """The mean of a series of several seeds, and its standard error from consecutive blocks."""
    means = [block.mean() for block in np.array_split(np.asarray(values, float), blocks)]
    return np.mean(values), np.std(means, ddof=1) / math.sqrt(blocks)


def parse(text):
    """{problem: rows} of the program's output; lines of MPI between them are omitted."""
    problems = {}
    for line in text.splitlines():
        if line.startswith("{"):
            row = json.loads(line)
            problems.setdefault(row["problem"], []).append(row)
    if not problems:
        raise BenchError("pliant_work_precision printed no results")
    return problems


def add_ratios(rows):
    """Costs relative to the standard run, which is returned."""
    standard = next((row for row in rows if row["standard"]), {})
    if "cpu" not in standard:
        raise BenchError(f"{rows[0]['problem']}: no standard run: {standard.get('failure', 'it is not in the output')}")
    for row in rows:
        if "cpu" in row:
            row["CPU ratio"] = row["cpu"] / standard["cpu"]
            row["evaluation ratio"] = row["evaluations"] / standard["evaluations"]
    return standard


def methods_of(rows):
    return [name for name in dict.fromkeys(row["method"] for row in rows) if name != "reference"]


def front(rows, cost, error):
    """The runs of a method that nothing cheaper beats, from cheap to dear."""
    best = []
    for row in sorted((row for row in rows if row.get(cost) is not None), key=lambda row: row[cost]):
        if row.get(error) is not None and (not best or row[error] < best[-1][error]):
            best.append(row)
    return best


def cost_at(rows, target, cost, error="error"):
    """The cost of a method for a given error, interpolated between its runs in
    logarithms; None if no run was that accurate."""
    best = front(rows, cost, error)
    if not best or best[-1][error] > target:
        return None
    if best[0][error] <= target:
        return best[0][cost]
    dear, cheap = next((b, a) for a, b in pairwise(best) if b[error] <= target)
    low = max(dear[error], 1e-300)
    part = math.log(cheap[error] / target) / math.log(cheap[error] / low)
    return cheap[cost] * (dear[cost] / cheap[cost]) ** part


def comparison(rows, standard, error="error"):
    """A row per method: CPU time and, in brackets, force evaluations for each target, over the standard run's."""
    result = []
    for method in methods_of(rows):
        mine = [row for row in rows if row["method"] == method]
        shown = {"method": method}
        for name, factor in TARGETS.items():
            cpu, evaluations = (cost_at(mine, factor * standard[error], key, error)
                                for key in ("CPU ratio", "evaluation ratio"))
            shown[name] = "–" if cpu is None else f"{cell(cpu)} ({cell(evaluations)})"
        result.append(shown)
    return result


def statistics(rows):
    """A row per method: its cheapest run whose mean energy agrees with runs with the standard step and shorter steps,
    which differ by chance."""
    main = methods_of(rows)[0]
    longest = next(row["value"] for row in rows if row["standard"])
    scatter = max(row["error"] for row in rows if row["method"] == main and "error" in row and row["value"] <= longest)
    result = []
    for method in methods_of(rows):
        good = [row for row in rows if row["method"] == method and row.get("error", math.inf) <= scatter]
        shown = {"method": method, "CPU": "–"}
        if good:
            best = min(good, key=lambda row: row["cpu"])
            shown |= {"CPU": best["CPU ratio"], "evaluations": best["evaluation ratio"],
                      best["control"]: best["value"], "energy": f"{best['mean_energy']:.5g}",
                      "contacts": best["contacts"]}
        result.append(shown)
    return result, scatter


def winners(rows, standard, error="error"):
    """The cheapest method for each target, and the cost of the standard method there."""
    methods, shown = methods_of(rows), {}
    for name, factor in TARGETS.items():
        cost = {method: cost_at([row for row in rows if row["method"] == method], factor * standard[error],
                                "CPU ratio", error) for method in methods}
        cost = {method: value for method, value in cost.items() if value is not None}
        if not cost:
            shown[name] = "none"
            continue
        best = min(cost, key=cost.get)
        own = cost.get(methods[0])
        shown[name] = best + (f" {cell(cost[best] / own)}" if own and best != methods[0] else "")
    return shown


def failures(rows):
    """One sentence on each way in which runs ended early; none if all went well."""
    slow, failed = {}, {}
    for row in rows:
        if "failure" in row:
            (slow if row["failure"].startswith("stopped at") else failed).setdefault(row["method"], []).append(
                f"{row['value']:.2g}")
    text = ""
    for what, found in (("Stopped for taking too long", slow), ("Failed", failed)):
        if found:
            text += f"{what}: " + "; ".join(f"{method} ({', '.join(v)})" for method, v in found.items()) + ". "
    return text.strip()


def draw(rows, error, label, path):
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 4.2), sharey=True, layout="constrained")
    for i, method in enumerate(methods_of(rows)):
        mine = [row for row in rows if row["method"] == method and row.get(error)]
        if not mine:
            continue
        style = "--" if any(word in method for word in DASHED) else "-"
        for axes, cost in ((left, "CPU ratio"), (right, "evaluation ratio")):
            axes.plot([row[cost] for row in mine], [row[error] for row in mine], style, color=COLORS[i % len(COLORS)],
                      marker=MARKERS[i % len(MARKERS)], markersize=4, linewidth=1.1, label=method,
                      fillstyle="full" if i < len(COLORS) else "none")
    left.set(xscale="log", yscale="log", xlabel="CPU time / standard run",
             ylabel=label.replace("σ_avg", r"$\sigma_{avg}$"))
    right.set(xscale="log", xlabel="force evaluations / standard run")
    # Half of the legend above each panel.
    handles, labels = left.get_legend_handles_labels()
    half = -(-len(labels) // 2)
    for axes, part in ((left, slice(None, half)), (right, slice(half, None))):
        axes.legend(handles[part], labels[part], **ABOVE | {"ncols": 3})
    save(figure, path)


HEADS = {"CPU": "CPU time/standard run", "evaluations": "evaluations/standard run"}  # of columns of ratios


def report(problem, rows, standard, images):
    """The text between the markers of a problem; draws its figures."""
    errors = [error for error in ("error", "energy_error") if error in standard]
    text = []
    for error in errors:
        if "mean_energy" in standard:
            shown, scatter = statistics(rows)
            columns = ["method", "CPU", "evaluations", "dt", "tolerance", "energy", "contacts"]
            columns = {key: HEADS.get(key, key) for key in columns}
            label = ERRORS["statistics"]
            text.append(f"The mean energies of runs with the standard step and with shorter steps differ by up to a fraction of {scatter:.1g} "
                        "from the reference. The table shows the cheapest run of each method whose mean energy differs by no more:")
        else:
            shown, columns, label = comparison(rows, standard, error), ["method", *TARGETS], ERRORS[error]
            if problem == "droplets":  # their unit of length
                label = label.replace("σ_avg", "⟨R⟩")
            text.append(f"CPU time (force evaluations in brackets) relative to the standard run; {label}, "
                        f"e₀ = {standard[error]:.2g}:")
        name = f"work-precision-{problem}{'-energy' * (error == 'energy_error')}.webp"
        draw(rows, error, label, images / name)
        text += ["", table(shown, columns), "", f"![{problem}: {label}](../images/{name})", ""]
    trusted = next((row["error"] for row in rows if row["method"] == "reference" and "error" in row), None)
    trust = "" if trusted is None else f"Two references differ by {trusted:.1g}. "
    text.append(f"{trust}Standard run: {standard['method']}, dt = {standard['value']:.2g}, {standard['evaluations']} "
                f"evaluations, {standard['cpu']:.2g} s. {failures(rows)}".strip())
    return "\n".join([*text, "", origin(standard)])


def flow_run(context, model, method, seed, t_start, t_end, dt_critical):
    """One run as a row, and its series after `t_start`; a run that fails gives its reason and None."""
    # Walls set the limit of these flows: dt_critical counts two of them.
    options = method if isinstance(method, str) else f"-dt {method * 2**0.5 * dt_critical:.6g}"
    row = {"problem": f"flow, {model}", "seed": seed, "options": options}
    folder = context.folder(f"flow-{model}")
    try:
        summary, _ = context.program.hopper(f"{FLOW} {model} -t_end {t_end} -seed {seed} {options}", folder)
    except BenchError as failure:
        return row | {"failure": str(failure)}, None
    if summary["ended_by"] != "t_end":
        return row | {"failure": f"ended at t = {summary['t']:.3g}: {summary['ended_by']}"}, None
    with Run(folder) as done:
        series = done.series[done.series["time"] > t_start]
    n = summary["particles"]
    found = {"kinetic_energy": series["kinetic_energy"], "potential_energy": series["potential_energy"],
             "contact_pairs": 2 * series["contact_pairs"] / n, "max_overlap": series["max_overlap"],
             "flow": np.gradient(series["crossed_area"], series["time"])}
    return row | {"cpu": summary["cpu_seconds"], "evaluations": summary["force_evaluations"],
                  "rejected": summary["rejected_steps"]}, {name: np.asarray(values) for name, values in found.items()}


def flow(context, model):
    """Means over time and seeds for each way to integrate, with standard errors from blocks; and the rows of all
    runs. The first way is the unit of costs."""
    seeds, t_start, t_end = ([1], 1, 3) if context.quick else ([1, 2], 2, 8)
    program, rows, shown, standard = context.program, [], [], None
    probe, _ = program.hopper(f"{FLOW} {model} -t_end 0", context.folder("probe"))
    for name, method in FLOW_METHODS.items():
        mine, series = [], []
        for seed in seeds:
            say(f"flow, {model}: {name}, seed {seed}")
            row, found = flow_run(context, model, method, seed, t_start, t_end, probe["dt_critical"])
            mine.append({"method": name} | row)
            series.append(found)
        rows += mine
        failures_ = [row["failure"] for row in mine if "failure" in row]
        if failures_:
            shown.append({"run as": name, "CPU": failures_[0]})
            continue
        cost = {key: sum(row[key] for row in mine) for key in ("cpu", "evaluations", "rejected")}
        standard = standard or cost
        shown.append({"run as": name, "CPU": cost["cpu"] / standard["cpu"],
                      "evaluations": cost["evaluations"] / standard["evaluations"],
                      "rejected": f"{100 * cost['rejected'] / cost['evaluations']:.0f} %"} | {
            label: with_error(*mean_of_blocks(values, 5 * len(seeds)))
            for key, label in FLOW_COLUMNS.items() for values in [np.concatenate([found[key] for found in series])]})
    return shown, rows


def with_error(value, error):
    digits = max(0, 1 - math.floor(math.log10(error))) if error > 0 else 3
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def read_rows(path):
    """Rows of a CSV file with numbers where there are any; empty fields are left out."""
    def value(text):
        try:
            return float(text)
        except ValueError:
            return {"True": True, "False": False}.get(text, text)
    return [{name: value(text) for name, text in row.items() if text != ""} for row in read_csv(path)]


def overview(folder):
    """The cheapest methods of all problems whose results are in `folder`."""
    best, last = [], None
    for problem in PROBLEMS:
        path = folder / f"work-precision-{problem}.csv"
        if problem == "settled" or not path.is_file():
            continue
        rows = read_rows(path)
        standard = last = add_ratios(rows)
        best.append({"problem": problem, "e₀": f"{standard['error']:.1g}"} | {
            f"error {name}": text for name, text in winners(rows, standard).items()})
    return table(best, list(best[0])) + "\n\n" + origin(last | {"repetitions": int(last["repetitions"])}) if best else ""


def study(context, problem, output):
    """Runs a problem and writes its rows and figures; returns the text between its markers."""
    program = context.program
    done = run([*program.pin, program.path.parents[1] / "benchmarks/pliant_work_precision", problem,
                *["--quick"] * context.quick])
    say(f"{problem}: {done.cpu:.0f} s of CPU, {done.wall:.0f} s")
    rows = parse(done.output)[problem]
    rows = [row | Context(program, context.scratch, row["repetitions"], context.quick).origin for row in rows]
    standard = add_ratios(rows)
    write_csv(output / "performance-data" / f"work-precision-{problem}.csv", rows)
    return report(problem, rows, standard, output / "images")


def flow_study(context, model, output):
    shown, rows = flow(context, model)
    rows = [row | context.origin for row in rows]
    write_csv(output / "performance-data" / f"work-precision-flow-{model}.csv", rows)
    columns = ["run as", "CPU", "evaluations", "rejected", *FLOW_COLUMNS.values()]
    return table(shown, {key: HEADS.get(key, key) for key in columns}) + "\n\n" + origin(rows[0])


def study_all(context, page, names):
    output = page.parents[1]
    for name in names:
        # Each part is written when it is done, because a later one may fail.
        try:
            text = (study(context, name, output) if name in PROBLEMS else
                    flow_study(context, FLOWS[name], output))
        except BenchError as reason:
            say(f"{name}: {reason}")
            text = f"Not measured: {reason}."
        insert(page, {f"work-precision-{name}": text})
    insert(page, {"work-precision": overview(output / "performance-data")})


def main():
    names = [*PROBLEMS, *FLOWS]
    args = parser("work-precision", __doc__.splitlines()[0], "PROBLEM", names, "work-precision").parse_args()
    return measure(args, 1, "validation/integrators.md", lambda context, page: study_all(context, page, args.only or names))


if __name__ == "__main__":
    sys.exit(main())
