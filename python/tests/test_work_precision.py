"""The table and the figures of the work–precision study, from made-up results."""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import harness  # noqa: E402
import work_precision as wp  # noqa: E402

ORIGIN = {"repetitions": 3, "date": "today", "commit": "c", "compiler": "g++", "machine": "m"}


def made(method, value, cpu, error, **other):
    return {"problem": "p", "method": method, "options": "", "control": "dt", "value": value, "standard": False,
            "cpu": cpu, "error": error, "evaluations": round(100 * cpu), "steps": 10, **other, **ORIGIN}


@pytest.fixture
def rows():
    """Methods: order 2; order 4 but expensive; never accurate; never finished."""
    return [made("reference", 1e-11, 1000, 1e-12),
            *[made("two", h, 2 / h, 1e-4 * h**2, standard=h == 1) for h in (4, 2, 1, 0.5, 0.25)],
            *[made("four", h, 16 / h, 1e-4 * h**4) for h in (2, 1, 0.5, 0.25)],
            made("poor", 1, 8, 1e-2), made("poor", 0.5, 16, 2e-2),
            {"problem": "p", "method": "none", "options": "", "control": "dt", "value": 1, "standard": False,
             "failure": "stopped at 3 % of the time after 2 s of CPU", **ORIGIN},
            {"problem": "p", "method": "none", "options": "", "control": "dt", "value": 0.1, "standard": False,
             "failure": "the acceleration of coordinate 1 is nan", **ORIGIN}]


def test_parse_leaves_out_what_is_no_row():
    lines = [json.dumps({"problem": name, "method": "m"}) for name in ("a", "b", "a")]
    found = wp.parse("\n".join(["MPI says hello", *lines, ""]))
    assert {name: len(rows) for name, rows in found.items()} == {"a": 2, "b": 1}
    with pytest.raises(harness.BenchError, match="no results"):
        wp.parse("MPI says hello\n")


def test_ratios_need_the_standard_run(rows):
    standard = wp.add_ratios(rows)
    assert standard["value"] == 1 and standard["CPU ratio"] == standard["evaluation ratio"] == 1
    with pytest.raises(harness.BenchError, match="p: no standard run"):
        wp.add_ratios([row for row in rows if not row["standard"]])
    with pytest.raises(harness.BenchError, match="no standard run: too long"):
        wp.add_ratios([{"problem": "p", "standard": True, "failure": "too long"}])


def test_cost_follows_the_order_of_the_method(rows):
    wp.add_ratios(rows)
    of = {name: [row for row in rows if row["method"] == name] for name in wp.methods_of(rows)}
    # Costs ∝ 1/h and errors ∝ h^p are lines in logarithms, which the interpolation meets: cost ∝ error^(−1/p).
    for error in (3e-4, 1e-4, 3e-5, 1e-5):
        assert wp.cost_at(of["two"], error, "CPU ratio") == pytest.approx((error / 1e-4) ** -0.5)
        assert wp.cost_at(of["four"], error, "CPU ratio") == pytest.approx(8 * (error / 1e-4) ** -0.25)
    # Looser than the loosest run: that one. Better than the best: never.
    assert wp.cost_at(of["two"], 1, "CPU ratio") == pytest.approx(0.25)
    assert wp.cost_at(of["two"], 1e-6, "CPU ratio") is None
    # The dearer run of `poor` is the worse one and does not count; a run that failed has no cost.
    assert wp.cost_at(of["poor"], 1e-2, "CPU ratio") == pytest.approx(4)
    assert wp.cost_at(of["none"], 1, "CPU ratio") is None


def test_comparison_and_winners(rows):
    standard = wp.add_ratios(rows)
    shown = {row["method"]: row for row in wp.comparison(rows, standard)}
    assert list(shown) == ["two", "four", "poor", "none"]
    assert shown["two"]["e₀"] == "1 (1)" and shown["two"]["e₀/1000"] == "–"
    assert shown["four"]["e₀/100"].startswith("25.3") and shown["none"]["10 e₀"] == "–"
    best = wp.winners(rows, standard)
    assert best["e₀"] == "two" and best["e₀/1000"] == "none"
    assert best["e₀/100"] == "four"  # where `two` was never measured there is no ratio to it
    four_is_cheap = [row | {"CPU ratio": row["CPU ratio"] / 16} if row["method"] == "four" else row for row in rows
                     if "CPU ratio" in row]
    assert wp.winners(four_is_cheap, standard)["e₀"] == "four 0.5"


def test_statistics_take_what_is_within_the_scatter(rows):
    rows = [row | {"mean_energy": 10, "contacts": 3} for row in rows]
    wp.add_ratios(rows)
    shown, scatter = wp.statistics(rows)
    assert scatter == pytest.approx(1e-4)
    found = {row["method"]: row["CPU"] for row in shown}
    assert found == {"two": 1, "four": 8, "poor": "–", "none": "–"}


def test_failures_say_which_runs(rows):
    assert wp.failures(rows) == "Stopped for taking too long: none (1). Failed: none (0.1)."
    assert wp.failures(rows[:5]) == ""


def test_report_has_a_table_and_a_figure(rows, tmp_path):
    text = wp.report("p", rows, wp.add_ratios(rows), tmp_path / "images")
    assert "e₀ = 0.0001" in text and "| two | 0.316 (0.316) | 1 (1) |" in text
    assert "Two references differ by 1e-12" in text and "commit c" in text
    assert "(../images/work-precision-p.webp)" in text
    assert (tmp_path / "images/work-precision-p.webp").read_bytes()[8:12] == b"WEBP"


def test_flow_averages_over_seeds_and_names_failures(monkeypatch, tmp_path):
    class FakeProgram:
        def hopper(self, options, folder):
            assert "-t_end 0" in options
            return {"dt_critical": 1e-4}, None

    def fake_run(context, model, method, seed, t_start, t_end, dt_critical):
        assert dt_critical == 1e-4
        row = {"problem": f"flow, {model}", "seed": seed, "options": str(method)}
        if method == "broken":
            return row | {"failure": "exit code 3: nan"}, None
        cost = 1 / method
        # Every sample of a seed is the same: the mean is known, and the error follows from 5 + 5 + 5 blocks.
        return row | {"cpu": cost, "evaluations": 100 * cost, "rejected": 25 * cost * (method != 0.2)}, {
            name: np.full(50, 10.0 + seed) for name in wp.FLOW_COLUMNS}

    monkeypatch.setattr(wp, "flow_run", fake_run)
    monkeypatch.setattr(wp, "FLOW_METHODS", {"first": 0.2, "longer": 0.4, "none": "broken"})
    shown, rows = wp.flow(harness.Context(FakeProgram(), tmp_path, 1, False), "smooth")
    assert len(rows) == 6 and rows[0]["method"] == "first" and rows[-1]["failure"] == "exit code 3: nan"
    first, longer, none = shown
    assert first["CPU"] == 1 and longer["CPU"] == pytest.approx(0.5)
    assert longer["rejected"] == "25 %" and first["rejected"] == "0 %"
    # Blocks of 11 and 12, five each: their standard deviation over √10.
    assert first["kinetic energy"] == wp.with_error(11.5, (2.5 / 9 / 10) ** 0.5) == "11.50 ± 0.17"
    assert none == {"run as": "none", "CPU": "exit code 3: nan"}


def test_flow_run_measures_after_the_start(tmp_path):
    class FakeProgram:
        ended_by, fails = "t_end", False

        def hopper(self, options, folder):
            if self.fails:
                raise harness.BenchError("exit code 3: the acceleration of coordinate 0 is nan")
            assert "-dt 7.07107e-06" in options and "-seed 7" in options
            folder.mkdir(parents=True)
            with h5py.File(folder / "run.h5", "w") as file:
                file.create_group("manifest")
                t = np.linspace(0, 3, 61)
                series = {"time": t, "kinetic_energy": np.where(t > 1, 5.0, 99.0), "potential_energy": t, "max_overlap": t,
                          "contact_pairs": np.full(61, 30), "crossed_area": 4 * t}
                for name, values in series.items():
                    file[f"series/{name}"] = values
            return {"ended_by": self.ended_by, "t": 3.0, "particles": 60, "cpu_seconds": 2.0, "force_evaluations": 100,
                    "rejected_steps": 3}, None

    context = harness.Context(FakeProgram(), tmp_path, 1, False)
    row, series = wp.flow_run(context, "smooth", 0.5, 7, 1, 3, 1e-5)
    assert (row["cpu"], row["evaluations"], row["rejected"]) == (2.0, 100, 3)
    assert set(series) == set(wp.FLOW_COLUMNS) and len(series["flow"]) == 40
    assert (series["kinetic_energy"] == 5).all() and (series["contact_pairs"] == 1).all()
    assert series["flow"] == pytest.approx(np.full(40, 4.0))

    context.program.ended_by = "max_wall_time"
    row, series = wp.flow_run(context, "smooth", 0.5, 7, 1, 3, 1e-5)
    assert series is None and row["failure"] == "ended at t = 3: max_wall_time"
    context.program.fails = True
    row, series = wp.flow_run(context, "smooth", 0.5, 7, 1, 3, 1e-5)
    assert series is None and "coordinate 0 is nan" in row["failure"]


def test_overview_reads_what_was_written(rows, tmp_path):
    harness.write_csv(tmp_path / "work-precision-rough.csv", rows)
    text = wp.overview(tmp_path)
    assert "| rough | 0.0001 |" in text and text.count("\n| ") == 1 and "medians of 3 repetitions" in text
    found = wp.read_rows(tmp_path / "work-precision-rough.csv")
    assert found[3]["standard"] is True and found[3]["error"] == 1e-4 and "cpu" not in found[-1]
    assert wp.overview(tmp_path / "nothing") == ""
