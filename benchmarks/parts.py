"""The parts of the suite. Each runs its cases and returns its tables, {name: (rows of the CSV file, columns shown)},
and notes on omitted cases."""

import json
import math
import os
import re
import shutil
import statistics
from pathlib import Path

import numpy as np
from harness import Unsupported, interleave, read_csv, run, say, spread
from lammps import peer as lammps
from scipy.stats import bootstrap

FRICTION, DRAG = "-mu 31.6227766", "-zeta 0.316227766"
QUIET = "-checkpoint_interval 0 -frame_interval 1e9"  # first and last frame only
POLYGONS = "-n 400 -hopper_wall_distance 30"
# The contacts of docs/validation/hopper-deformable.md: as printed for rough particles, softer for smooth particles.
# Outlines that cross themselves would end the long runs.
ROUGH = "-model rough -e_c 1e4 -e_w 1e4 -dt 1e-4 -self_crossing count"
SMOOTH = "-model smooth -e_c 250 -e_w 250 -dt 7.5e-5 -self_crossing count"


# ------------------------------------------------------------------------------------------------- targets and LAMMPS

# Name, options of a dense flow, end of the run, target and stretch (ns), the case of LAMMPS that belongs to it.
TARGETS = [
    ("soft 2D, friction", f"-hopper_width 10 -dt 7e-4 {FRICTION}", 30, 25, 15, "2D, friction"),
    ("soft 2D, drag", f"-hopper_width 10 -dt 1e-3 {DRAG}", 30, 25, 15, "2D, drag"),
    ("soft 3D, friction", f"-dim 3 -hopper_width 10 -dt 7e-4 {FRICTION}", 8, 40, 25, "3D, friction"),
    ("soft 3D, drag", f"-dim 3 -hopper_width 10 -dt 1e-3 {DRAG}", 8, 40, 25, "3D, drag"),
    ("rough, friction", f"{ROUGH} {POLYGONS} -hopper_width 10 {FRICTION}", 6, 25, 15, None),
    ("smooth, friction", f"{SMOOTH} {POLYGONS} -hopper_width 10 {FRICTION}", 6, 60, 35, None),
]
# Cases for both programs: options, end of the run, pair styles. A discharge in 2D, a closed pile in 3D: LAMMPS has no
# re-insertion, and no region with a circular lip.
PEER_DT, PEER_SAMPLE = 5e-4, 0.2
PEERS = {
    "2D, friction": (f"-flow discharge -hopper_width 5 {FRICTION}", 10, ("granular", "gran_hooke")),
    "2D, drag": (f"-flow discharge -hopper_width 5 {DRAG}", 10, ("granular", "gran_hooke", "table")),
    "3D, friction": (f"-dim 3 -hopper_width 0.01 {FRICTION}", 4, ("granular", "gran_hooke")),
    "3D, drag": (f"-dim 3 -hopper_width 0.01 {DRAG}", 4, ("granular", "gran_hooke", "table")),
}


def named(keys, heads):
    """{key: head of its column}, the key itself unless `heads` has another head."""
    return {key: heads.get(key, key) for key in keys}


def targets(context):
    shorter = 10 if context.quick else 1
    jobs = {}

    def flow(options, t_end):
        def job(_):
            return context.program.hopper(f"{options} -t_end {t_end / shorter:g} {QUIET}", context.folder("flow"))[0]
        return job

    def ours(case, options, t_end):
        def job(_):
            folder = context.folder(f"peer {case}".replace(", ", "-").replace(" ", "-"))
            summary, _ = context.program.hopper(f"-model sp {options} -dt {PEER_DT} -t_end {t_end / shorter:g} "
                                                f"-sample_interval {PEER_SAMPLE} {QUIET}", folder)
            return lammps.reference(folder), summary["particles"], summary["steps"], folder
        return job

    def theirs(case, pair):
        def job(repetition):
            _, _, steps, folder = results_of[case][repetition]
            return lammps.peer(folder, pair, steps, round(PEER_SAMPLE / PEER_DT), context.program.pin)
        return job

    results_of = {}

    def remember(case, job):
        def remembering(repetition):
            result = job(repetition)
            results_of.setdefault(case, []).append(result)
            return result
        return remembering

    for name, options, t_end, *_ in TARGETS:
        jobs[name] = flow(options, t_end)
    for case, (options, t_end, pairs) in PEERS.items():
        jobs[case, "Pliant"] = remember(case, ours(case, options, t_end))
        for pair in pairs:
            jobs[case, pair] = theirs(case, pair)
    results, reasons = interleave(jobs, context.repetitions, "targets")

    peer_rows, best = [], {}
    for case, (options, _, pairs) in PEERS.items():
        for pair in pairs:
            if (case, pair) in reasons:
                continue
            reference = [r[0] for r in results[case, "Pliant"]]
            _, particles, steps, _ = results[case, "Pliant"][0]
            per = 1e9 / (particles * steps)
            found = results[case, pair]
            ns = spread([per * p.seconds for p in found])
            ratio = statistics.median(p.seconds / r.seconds for p, r in zip(found, reference))
            exact = pair in lammps.EXACT
            peer_rows.append({
                "case": case, "LAMMPS pair style": pair.replace("_", "/"), "law of Pliant": "yes" if exact else "nearly", **ns,
                "Pliant": statistics.median(per * r.seconds for r in reference), "LAMMPS/Pliant": ratio,
                "E_kin, LAMMPS": f"{found[0].kinetic_energy:.4g}", "E_kin, Pliant": f"{reference[0].kinetic_energy:.4g}",
                "height, LAMMPS": f"{found[0].height:.4g}", "height, Pliant": f"{reference[0].height:.4g}",
                "left, LAMMPS": found[0].particles, "left, Pliant": reference[0].particles, **context.origin})
            if exact and (case not in best or ns["median"] < best[case]["LAMMPS, other flow"]):
                best[case] = {"LAMMPS, other flow": ns["median"], "Pliant, other flow": peer_rows[-1]["Pliant"],
                              "LAMMPS/Pliant": ratio}

    rows = []
    for name, options, _, target, stretch, case in TARGETS:
        kind = "ns_per_vertex_step" if "-model" in options else "ns_per_particle_step"
        ns = spread([summary[kind] for summary in results[name]])
        rows.append({"case": name, **ns, "target": target, "stretch": stretch, "median/target": ns["median"] / target,
                     **best.get(case, {}), "force evaluations": results[name][0]["force_evaluations"],
                     "steps": results[name][0]["steps"], "options": options, **context.origin})
    shown = ["case", "median", "min–max", "target", "stretch", "median/target", "LAMMPS, other flow", "Pliant, other flow",
             "LAMMPS/Pliant"]
    tables = {"targets": (rows, shown)}
    if peer_rows:
        columns = ["case", "LAMMPS pair style", "law of Pliant", "median", "min–max", "Pliant", "LAMMPS/Pliant", "E_kin, LAMMPS",
                   "E_kin, Pliant", "height, LAMMPS", "height, Pliant"]
        tables["lammps"] = (peer_rows, named(columns, {"median": "LAMMPS, median", "min–max": "LAMMPS, min–max",
                                                       "Pliant": "Pliant, median"}))
    return tables, sorted(set(reasons.values()))


# --------------------------------------------------------------------------------------------------- frictional disks

# Options of the full model, and of the part that LAMMPS has: no substrate, one coefficient for sticking and sliding.
DISKS = {"bidisperse": "-distribution bidisperse", "T4": "-distribution T4"}
CHANNEL = "-pushes 1 -frame_travel 10.7 -sample_travel 0.107 -checkpoint_interval 0"
NO_BASE = "-mu_base 0 -mu_disk 0.4 -mu_disk_dynamic 0.4 -mu_wall 0.4 -mu_wall_dynamic 0.4"


def disks(context):
    speed = 44 if context.quick else 4.4
    jobs, started = {}, {}

    def whole(options):
        def job(_):
            return context.program.start("channel", f"{options} {CHANNEL} -plunger_speed {speed}",
                                         context.folder("channel"))[0]
        return job

    def ours(case, options):
        def job(_):
            started[case] = context.folder(f"channel {case}".replace(" ", "-"))
            summary, _ = context.program.start("channel", f"{options} {CHANNEL} {NO_BASE} -plunger_speed {speed}",
                                               started[case])
            return lammps.reference(started[case]), summary
        return job

    def theirs(case, lists):
        def job(_):
            with lammps.Run(started[case]) as run:
                steps = run.summary["steps"]
            return lammps.channel(started[case], lists, steps, max(steps // 100, 1), context.program.pin)
        return job

    for case, options in DISKS.items():
        jobs[case, "whole"] = whole(options)
        jobs[case, "Pliant"] = ours(case, options)
        for lists in ("bin", "multi"):
            jobs[case, lists] = theirs(case, lists)
    results, reasons = interleave(jobs, context.repetitions, "disks")
    rows = []
    for case in DISKS:
        mine, summaries = zip(*results[case, "Pliant"])
        per = 1e9 / (summaries[0]["particles"] * summaries[0]["steps"])
        row = {"case": case, "N": summaries[0]["particles"],
               "with substrate": statistics.median(s["ns_per_particle_step"] for s in results[case, "whole"]),
               **spread([per * p.seconds for p in mine])}
        found = {lists: results[case, lists] for lists in ("bin", "multi") if (case, lists) not in reasons}
        if found:
            lists = min(found, key=lambda name: statistics.median(p.seconds for p in found[name]))
            theirs_ = found[lists]
            row |= {"LAMMPS": statistics.median(per * p.seconds for p in theirs_), "LAMMPS lists": lists,
                    "LAMMPS/Pliant": statistics.median(p.seconds / q.seconds for p, q in zip(theirs_, mine)),
                    "height, LAMMPS": f"{theirs_[0].height:.4g}", "height, Pliant": f"{mine[0].height:.4g}",
                    "E_kin, LAMMPS": f"{theirs_[0].kinetic_energy:.3g}",
                    "E_kin, Pliant": f"{mine[0].kinetic_energy:.3g}"}
        rows.append(row | context.origin)
    shown = named(["case", "N", "with substrate", "median", "min–max", "LAMMPS", "LAMMPS/Pliant", "LAMMPS lists",
                   "E_kin, LAMMPS", "E_kin, Pliant", "height, LAMMPS", "height, Pliant"],
                  {"with substrate": "Pliant, with substrate", "median": "Pliant, median", "min–max": "Pliant, min–max",
                   "LAMMPS": "LAMMPS, median"})
    return {"disks": (rows, shown)}, sorted(set(reasons.values()))


# ------------------------------------------------------------------------------------------------- frictional spheres

# In a closed cylinder: LAMMPS has no re-insertion, and no region with a circular lip.
SPHERES = "-model disk -dim 3 -hopper_width 0.01 -mu_wall 0.4"
SPHERES_DT, SPHERES_STEPS, SPHERES_SAMPLE = 5e-4, 2000, 0.1
SPHERE_STYLES = {"granular": "yes", "gran_hooke_history": "no"}  # whether they are the same law


def spheres(context):
    size = "-n 300 -hopper_wall_distance 6.5" if context.quick else "-n 3000 -hopper_wall_distance 14"
    started = []

    def ours(_):
        folder = context.folder("spheres")
        summary, _ = context.program.hopper(f"{SPHERES} {size} -dt {SPHERES_DT} -t_end {SPHERES_DT * SPHERES_STEPS:g} "
                                            f"-sample_interval {SPHERES_SAMPLE} {QUIET}", folder)
        started.append(folder)
        return lammps.reference(folder), summary

    def theirs(pair):
        def job(repetition):
            return lammps.spheres(started[repetition], pair, SPHERES_STEPS, round(SPHERES_SAMPLE / SPHERES_DT),
                                  context.program.pin)
        return job

    jobs = {"Pliant": ours} | {pair: theirs(pair) for pair in SPHERE_STYLES}
    results, reasons = interleave(jobs, context.repetitions, "spheres")
    mine, summaries = zip(*results["Pliant"])
    per = 1e9 / (summaries[0]["particles"] * summaries[0]["steps"])
    programs = [("Pliant", "", mine)] + [(f"LAMMPS {pair.replace('_', '/')}", same, results[pair])
                                         for pair, same in SPHERE_STYLES.items() if pair not in reasons]
    rows = [{"program": name, "law of Pliant": same, "N": summaries[0]["particles"], **spread([per * p.seconds for p in found]),
             "time/Pliant's time": statistics.median(p.seconds / q.seconds for p, q in zip(found, mine)),
             "kinetic energy": f"{found[0].kinetic_energy:.4g}", "height": f"{found[0].height:.4g}", **context.origin}
            for name, same, found in programs]
    shown = ["program", "law of Pliant", "N", "median", "min–max", "time/Pliant's time", "kinetic energy", "height"]
    return {"spheres": (rows, shown)}, sorted(set(reasons.values()))


# ------------------------------------------------------------------------------------------------ scaling and parallel

def soft_system(points, dim):
    """Options of N soft particles: above the published N only the width of the hopper grows, so that the filling has
    the same height, pressure and overlaps at every N; smaller hoppers keep their shape."""
    if dim == 2:
        width = 50 * (points / 1600 if points > 1600 else math.sqrt(points / 1600))
        packed = "-pack_fraction 0.84"
    else:
        width = 25 * (math.sqrt(points / 6400) if points > 6400 else (points / 6400) ** (1 / 3))
        packed = "-pack_fraction 0.63"
    # Overlaps of about 1 % are there from the start on: contacts as in a flow, without waiting until it settles.
    return f"-model sp -dim {dim} -n {points} -dt 7e-4 {packed} -pack_tolerance 0.05 {hopper(width)}", 7e-4


def polygons(points, model):
    particles = max(round(points / 16), 4)
    width = 30 * (particles / 400 if particles > 400 else math.sqrt(particles / 400))
    return f"{model} -n {particles} -pack_tolerance 1e-3 {hopper(width)}", float(model.split("-dt ")[1])


def hopper(width):
    return f"-hopper_wall_distance {width:.6g} -hopper_width {min(5, width / 4):.6g} -clog_time 1e9 {FRICTION}"


SYSTEMS = {
    "soft 2D": lambda points: soft_system(points, 2),
    "soft 3D": lambda points: soft_system(points, 3),
    "rough": lambda points: polygons(points, ROUGH),
    "smooth": lambda points: polygons(points, SMOOTH),
}
SILENT = f"{QUIET} -sample_interval 1e9"
FEW = 50  # steps of the part that is subtracted


SETTLED = 2.0  # t0: by then the filling is dense, at any N


class Chain:
    """A system that is packed, runs until it is dense, and is run on by restarts, each time first for a few and then
    for many steps: the difference of the two is free of starting, reading and writing."""

    def __init__(self, context, name, system, points, steps):
        options, self.dt = SYSTEMS[system](points)
        self.context, self.folder, self.steps = context, context.folder(name), steps
        self.taken = 10
        say(f"packing {system}, N = {points}")
        summary, self.start = context.program.hopper(f"{options} -t_end {self.taken * self.dt:.9g} {SILENT}",
                                                     self.folder)
        self.points = summary["particles"] * (16 if system in ("rough", "smooth") else 1)
        if not context.quick:
            self.taken = round(SETTLED / self.dt)
            context.program.restart(self.folder, self.taken * self.dt)

    def measure(self):
        """CPU time of the many steps, in ns per point and step."""
        found = []
        for steps in (FEW, FEW + self.steps):
            self.taken += steps
            found.append(self.context.program.restart(self.folder, self.taken * self.dt)[1])
        difference = found[1].cpu - found[0].cpu
        if difference <= 0:
            raise Unsupported(f"{self.folder.name}: the machine was too busy to time {self.steps} steps")
        return 1e9 * difference / (self.steps * self.points)


def scaling(context):
    sizes = [100, 1000, 10_000] + ([] if context.quick else [100_000, 1_000_000])
    beyond = {} if context.quick else {"rough": [4_000_000]}  # one system only: packing takes a quarter of an hour
    work = 2e6 if context.quick else 1e8  # point-steps
    _, smallest = context.program.hopper(f"{SYSTEMS['soft 2D'](10)[0]} -t_end 10 {SILENT}", context.folder("smallest"))
    chains, rows = {}, []
    for system in SYSTEMS:
        for points in sizes + beyond.get(system, []):
            chains[system, points] = Chain(context, f"scaling-{system}-{points}".replace(" ", "-"), system, points,
                                           max(200, round(work / points)))
    jobs = {key: (lambda _, chain=chain: chain.measure()) for key, chain in chains.items()}
    results, reasons = interleave(jobs, context.repetitions, "scaling")
    for (system, points), ns in results.items():
        chain, compared = chains[system, points], results.get((system, 10_000))
        kb = (chain.start.peak_kb - smallest.peak_kb) / chain.points
        rows.append({"case": system, "N": chain.points, **spread(ns),
                     "cost/cost at N = 10⁴": statistics.median(ns) / statistics.median(compared) if compared else None,
                     "kB per point": kb if points >= 10_000 else None,  # of fewer, the program itself is most
                     "packing [s]": chain.start.cpu, "steps": chain.steps, **context.origin})
        shutil.rmtree(chain.folder)
    shown = ["case", "N", "median", "min–max", "cost/cost at N = 10⁴", "kB per point", "packing [s]"]
    return {"scaling": (rows, shown)} if rows else {}, sorted(set(reasons.values()))


def ranks_prefix(ranks):
    mpiexec = shutil.which("mpiexec")
    root = ["--allow-run-as-root"] if os.geteuid() == 0 else []
    # Not bound to cores: the threads of one rank use the cores of other ranks while these sleep.
    return [mpiexec, *root, "--bind-to", "none", "-n", ranks]


def interval_of_median(values):
    """5 and 95 % of the medians of resampled values."""
    return bootstrap((values,), np.median, confidence_level=0.9, method="percentile", random_state=1).confidence_interval


def parallel(context):
    if not context.program.speedup.is_file():
        return {}, [f"parallel: {context.program.speedup.name} is not built (-DPLIANT_BUILD_BENCHMARKS=ON)"]
    points, cycles = (10_000, 2) if context.quick else (100_000, 8 * context.repetitions)
    cores = len(os.sched_getaffinity(0))
    workers = [n for n in (2, 4, 8, 16, 32, 64) if n <= cores]
    if not workers:
        return {}, ["parallel: there is only one core"]
    if shutil.which("mpiexec") is None:
        return {}, ["parallel: mpiexec is not installed"]
    rows = []
    for system in SYSTEMS:
        chain = Chain(context, "parallel", system, points, FEW)
        for n in workers:
            say(f"parallel: {system} on {n}")
            command = [*ranks_prefix(n), context.program.speedup, chain.folder,
                       400 if system in ("rough", "smooth") else 200, cycles]
            found = json.loads(run(command, env=os.environ | {"OMP_NUM_THREADS": "1"}).output.strip().splitlines()[-1])
            serial = found.pop("serial")
            row = {"case": system, "N": chain.points}
            if n == workers[0]:
                rows.append({**row, "run as": "serial", "workers": 1, **spread(serial), "speed-up": 1.0})
            for kind, ns in found.items():
                ratios = [a / b for a, b in zip(serial, ns)]
                low, high = interval_of_median(ratios)
                rows.append({**row, "run as": f"{n} {kind}", "workers": n, **spread(ns),
                             "speed-up": statistics.median(ratios), "5 %": low, "95 %": high,
                             "speed-up of the means": statistics.mean(serial) / statistics.mean(ns)})
        shutil.rmtree(chain.folder)
    rows = [{**row, **context.origin, "repetitions": cycles} for row in rows]
    columns = ["case", "run as", "median", "min–max", "speed-up", "5 %", "95 %", "speed-up of the means"]
    return {"parallel": (rows, named(columns, {"5 %": "speed-up, 5 % point", "95 %": "speed-up, 95 % point"}))}, []


# --------------------------------------------------------------------------------------------------------- flow rates

FLOW_RTOL = 0.03
FLOW = {
    "soft, friction": f"-model sp -e_sp 100 -hopper_width 5 {FRICTION}",
    "soft, drag": f"-model sp -e_sp 100 -hopper_width 5 {DRAG}",
    "rough, friction": f"{ROUGH} {POLYGONS} -k_l 10 -k_b 0.1 -hopper_width 5 {FRICTION}",
    "rough, drag": f"{ROUGH} {POLYGONS} -k_l 10 -k_b 0.1 -hopper_width 5 {DRAG}",
    "smooth, friction": f"{SMOOTH} {POLYGONS} -k_l 10 -k_b 0.1 -hopper_width 5 {FRICTION}",
    "smooth, drag": f"{SMOOTH} {POLYGONS} -k_l 10 -k_b 0.1 -hopper_width 5 {DRAG}",
}


def flow(context):
    if not context.program.has_option("-hopper_q_rtol"):
        return {}, ["flow: the program has no option -hopper_q_rtol"]
    before = {row["case"]: row for row in read_csv(Path(__file__).parent / "before.csv")}
    rtol, t_end = (0.2, 100) if context.quick else (FLOW_RTOL, 5000)
    repetitions = min(context.repetitions, 3)  # when a run may stop depends on its seed

    def job(name, options):
        def one(repetition):
            stop = f"-hopper_q_rtol {rtol} -t_end {t_end}"
            summary, done = context.program.hopper(f"{options} -seed {repetition + 1} {stop} {QUIET}",
                                                   context.folder("flow"))
            return done.cpu, summary
        return one

    results, _ = interleave({name: job(name, options) for name, options in FLOW.items()}, repetitions, "flow")
    rows, notes = [], []
    for name, found in results.items():
        cpu = spread([cpu for cpu, _ in found])
        summary = found[0][1]
        if not summary["Q"]["error"] or summary["Q"]["error"] > 1.001 * rtol * summary["Q"]["value"]:
            notes.append(f"{name}: Q did not reach {100 * rtol:g} % until t = {t_end} t0")
        earlier = float(before[name]["cpu_seconds"]) if name in before and not context.quick else None
        rows.append({"case": name, **cpu, "median before": earlier, "before/now": earlier / cpu["median"] if earlier else None,
                     "Q": summary["Q"]["value"], "error of Q": summary["Q"]["error"], "t [t0]": summary["t"],
                     "Q before": before.get(name, {}).get("Q"), "options": FLOW[name],
                     **context.origin, "repetitions": repetitions})
    columns = ["case", "median", "min–max", "median before", "before/now", "Q", "error of Q", "t [t0]", "Q before"]
    return {"flow": (rows, columns)}, notes


# ------------------------------------------------------------------------------------------------------------ kernels

COUNTERS = {"listed_per_point": "listed pairs per point", "contacts_per_point": "touching pairs per point",
            "rebuilds_per_1000_steps": "list rebuilds per 1000 steps", "fire_iterations": "iterations of FIRE"}


def kernels(context):
    program = context.program
    if not program.kernels.is_file():
        return {}, [f"kernels: {program.kernels.name} is not built (-DPLIANT_BUILD_BENCHMARKS=ON)"]
    say("kernels")
    done = run([*program.pin, program.kernels, "--benchmark_format=json",
                f"--benchmark_repetitions={context.repetitions}", "--benchmark_enable_random_interleaving=true",
                f"--benchmark_min_time={0.02 if context.quick else 0.1}"])
    # Lines of the library about the machine come before the JSON.
    repeated, counters = {}, {}
    found = json.loads(re.search(r"^\{.*\}", done.output, re.S | re.M)[0])["benchmarks"]
    for row in sorted(found, key=lambda row: row["family_index"]):
        if row["run_type"] != "iteration":
            continue
        system, kernel = row["run_name"].split("/", 1)
        repeated.setdefault((kernel, system), []).append(1e9 * row["per_point"])
        for counter, label in COUNTERS.items():
            if counter in row:
                counters[label, system] = row[counter]
    rows = [{"kernel": kernel, "case": system, **spread(ns), **context.origin}
            for (kernel, system), ns in sorted(repeated.items())]
    systems = list(dict.fromkeys(system for _, system in repeated))
    text = {key: "{median:.2f} ({min:.2f}–{max:.2f})".format(**spread(ns)) for key, ns in repeated.items()}
    shown = [{"kernel": kernel} | {system: text[kernel, system] for system in systems if (kernel, system) in text}
             for kernel in sorted({kernel for kernel, _ in repeated})]
    shown += [{"kernel": label} | {system: f"{counters[label, system]:.3g}" for system in systems
                                   if (label, system) in counters} for label in COUNTERS.values()]
    columns = named(["kernel", *systems], {"sp_2d": "soft 2D", "sp_3d": "soft 3D"})
    return {"kernels": (rows, columns, [row for row in shown if len(row) > 1])}, []


PARTS = {"targets": targets, "disks": disks, "spheres": spheres, "scaling": scaling, "parallel": parallel, "flow": flow,
         "kernels": kernels}
