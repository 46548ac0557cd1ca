"""Errors from blocks and seeds: they cover the truth where flows drift, and where they do not."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from pliant import beverloo, ensemble
from pliant.crossover import crossover, fit_crossover

LAW = (1.2, 1.4, 1.5)
WIDTHS = (3.0, 4.0, 5.0, 6.5, 8.0, 10.0)


def runs(rng, drift, seeds=3, blocks=0.02, error=True):
    """A table of runs whose flow is off by `drift` (relative) for good, which their block errors do not know."""
    rows = []
    for w in WIDTHS:
        Q = float(beverloo.beverloo(w, *LAW))
        for seed in range(seeds):
            value = Q * (1 + rng.normal(0, drift) + rng.normal(0, blocks))
            rows.append({"hopper_width": w, "seed": seed, "Q": value, "Q_error": blocks * Q if error else np.nan,
                         "dim": 2, "mu": 3.0, "zeta": 0.0})
    return pd.DataFrame(rows)


@pytest.mark.parametrize("drift, seeds, low, high", [(0.0, 3, 0.60, 0.80), (0.06, 3, 0.58, 0.76), (0.06, 10, 0.62, 0.76),
                                                     (0.06, 2, 0.52, 0.74)])
def test_coverage_of_points(drift, seeds, low, high):
    """The truth lies within one standard error in two thirds of all cases, though single runs drift by three of theirs."""
    rng, inside = np.random.default_rng(1), []
    truth = beverloo.beverloo(WIDTHS, *LAW)
    for _ in range(100):
        points = ensemble.average(runs(rng, drift, seeds), ["hopper_width"], "Q")
        inside.append(abs(points["Q"] - truth) < points["Q_error"])
    assert low < np.mean(inside) < high
    if drift:  # the errors of blocks alone would be too small
        blocks = 0.02 * truth / np.sqrt(seeds)
        alone = [abs(ensemble.average(runs(rng, drift, seeds), ["hopper_width"], "Q")["Q"] - truth) < blocks
                 for _ in range(30)]
        assert np.mean(alone) < 0.35


@pytest.mark.parametrize("drift, low, high", [(0.0, 0.55, 0.82), (0.06, 0.52, 0.80)])
def test_coverage_of_fits(drift, low, high):
    rng, inside = np.random.default_rng(2), []
    for _ in range(40):
        fit = beverloo.fit_seeds(runs(rng, drift), ["mu"], resamples=40)["fit"][0]
        inside.append([abs(fit.beta - LAW[2]) < fit.beta_error, abs(fit.k - LAW[1]) < fit.k_error])
    assert (low < np.mean(inside, axis=0)).all() and (np.mean(inside, axis=0) < high).all(), np.mean(inside, axis=0)


def test_kinds_of_points_have_a_factor_each():
    """A chaotic point does not enlarge the error of a point that hardly depends on the seed."""
    table = pd.DataFrame([{"rows": rows, "k": 6 + scale * seed, "k_error": 1e-5} for rows, scale in ((7, 1e-4), (6, 0.3)) for seed in (-1, 0, 1)])
    together, apart = (ensemble.average(table, ["rows"], "k", pool=pool).set_index("rows")["k_error"] for pool in ((), ["rows"]))
    assert apart[7] == pytest.approx(1e-4 / np.sqrt(3), rel=0.01) and apart[6] == pytest.approx(0.3 / np.sqrt(3), rel=0.01)
    assert together[7] > 0.05


def test_one_seed():
    table = runs(np.random.default_rng(3), 0.06, seeds=1)
    points = ensemble.average(table, ["hopper_width"], "Q")
    assert_allclose(points["Q_error"], table["Q_error"])
    assert "one seed" in ensemble.seeds_remark(points)
    assert "one seed" in beverloo.fit_seeds(table, ["mu"])["note"][0]
    some = ensemble.average(runs(np.random.default_rng(3), 0.06)[1:-1].iloc[[0, 1, 2, 3, 4, 5, 8, 11, 14]],
                            ["hopper_width"], "Q")
    assert "points with one seed" in ensemble.seeds_remark(some) and (some["Q_error"] > 0).all()
    # A single seed gets the drift error of the other points.
    assert some["Q_error"].iloc[-1] > 1.5 * 0.02 * beverloo.beverloo(10, *LAW)
    assert ensemble.seeds_remark(ensemble.average(runs(np.random.default_rng(3), 0), ["hopper_width"], "Q")) == ""


def test_scatter_takes_the_place_of_missing_errors():
    table = runs(np.random.default_rng(4), 0.05, seeds=5, error=False)
    points = ensemble.average(table, ["hopper_width"], "Q")
    assert_allclose(points["Q_error"] / points["Q"], 0.054 / np.sqrt(5), rtol=0.45)
    alone = ensemble.average(table[table["seed"] == 0], ["hopper_width"], "Q")
    assert alone["Q_error"].isna().all()
    some = table.assign(Q_error=np.where(table["seed"] == 0, 0.02 * table["Q"], np.nan))
    assert_allclose(ensemble.average(some[some["seed"] < 2], ["hopper_width"], "Q")["runs"], 2)
    one = some[(some["seed"] == 0) | (some["hopper_width"] == 3)].copy()
    one.loc[one["hopper_width"] == 8, "Q_error"] = np.nan
    assert (ensemble.average(one, ["hopper_width"], "Q")["Q_error"] > 0).all()


def test_runs_without_a_value_and_clogged_ones():
    table = runs(np.random.default_rng(5), 0.0)
    table.loc[0, "Q"] = np.nan
    table.loc[table["hopper_width"] == 4, ["Q", "Q_error"]] = 0.0, np.nan
    points = ensemble.average(table, ["hopper_width"], "Q")
    assert list(points["runs"]) == [2, 3, 3, 3, 3, 3]
    assert points["Q"][1] == 0 and points["Q_error"][1] == 0 and np.isfinite(points["Q_error"]).all()


def test_draws_have_the_points_errors():
    rng = np.random.default_rng(6)
    points = ensemble.average(runs(rng, 0.05, 4), ["hopper_width"], "Q")
    drawn = ensemble.draws(points, "Q", 4000)
    assert_allclose(drawn.mean(0), points["Q"], rtol=0.01)
    assert_allclose(drawn.std(0), points["Q_error"], rtol=0.06)
    assert (ensemble.draws(points, "Q", 50) == ensemble.draws(points, "Q", 50)).all()
    assert (ensemble.draws(points, "Q", 50, seed=2) != ensemble.draws(points, "Q", 50)).any()


@pytest.mark.parametrize("dim", [2, 3])
def test_crossover(dim):
    lam = np.array([0, 1e-3, 1e-2, 3e-2, 0.1, 1, np.inf])
    ends = dim - 1.5, dim - 0.5
    beta = crossover(lam, 0.05, 0.8, *ends)
    assert_allclose(beta[[0, -1]], ends[::-1])
    assert crossover(0.05, 0.05, 0.8, *ends) == dim - 1
    held = fit_crossover(lam, beta, np.full(7, 0.02), ends)
    assert held.lam_c == pytest.approx(0.05, rel=1e-3) and held.b == pytest.approx(0.8, rel=1e-3)
    assert held.low_error == 0 and 0 < held.lam_c_error < 0.02 and held.chi2_reduced < 1e-3 and held.note == ""
    free = fit_crossover(lam, beta + 0.3, np.full(7, 0.02))
    assert free.lam_c == pytest.approx(0.05, rel=1e-2) and free.high == pytest.approx(ends[1] + 0.3, abs=1e-2)
    assert free.lam_c_error > held.lam_c_error * 0.9 and free.high_error > 0


def test_a_crossover_that_is_not_there():
    lam = np.array([0, 1e-3, 1e-2, 3e-2, 0.1, 1, np.inf])  # ends that hardly differ have no middle
    alike = fit_crossover(lam, crossover(lam, 0.05, 0.5, 1.1, 1.3), np.full(7, 0.15))
    assert np.isnan(alike.lam_c_error) and "only" in alike.note
    flat = fit_crossover([1e-3, 1e-2, 0.1, 1], [1.5, 1.5, 1.49, 1.5], np.full(4, 0.02), (0.5, 1.5))
    assert "outside" in flat.note and np.isnan(flat.lam_c_error)
    steep = fit_crossover([1e-3, 3e-3, 1e-2, 0.1, 1], crossover([1e-3, 3e-3, 1e-2, 0.1, 1], 5e-4, 0.5, 0.4, 9.0), np.full(5, 0.02))
    assert "friction end at its bound" in steep.note and np.isnan(steep.high_error) and np.isnan(steep.lam_c_error)
    assert steep.low == pytest.approx(0.4, abs=0.05) and steep.low_error > 0
    tail = np.array([0.1, 0.3, 1, 3, np.inf])  # a small step does not end the sum
    for name, at, middle, noise in (("friction", tail, 0.02, [-0.01, 0.0, 0.0, 0.0, 0.0]),
                                    ("drag", 1 / tail, 50, [0.0, -0.01, 0.01, 0.0, 0.0])):
        one = fit_crossover(at, crossover(at, middle, 0.8, 0.95, 2.2) + noise, np.full(5, 0.03))
        assert f"too few lambda for the {name} end" in one.note and np.isnan(one.lam_c_error)
    sharp = fit_crossover(lam, np.where(lam < 0.02, 1.6, np.where(lam > 0.05, 0.45, 0.8)), np.full(7, 0.02), (0.5, 1.5))
    assert sharp.lam_c == pytest.approx(0.03, rel=0.1) and "step" in sharp.note and np.isnan(sharp.lam_c_error)
    with pytest.raises(beverloo.RunError, match="too few"):
        fit_crossover([0, 1e-2, np.inf], [1.5, 1.0, 0.5], np.full(3, 0.02))


def test_a_point_that_scatters_more_than_the_others():
    table = runs(np.random.default_rng(7), 0.0, seeds=6)
    wild = table["hopper_width"] == 5
    before = ensemble.average(table, ["hopper_width"], "Q")["Q_error"]
    table.loc[wild, "Q"] *= 1 + 0.3 * np.array([-1, 1, -1, 1, -1, 1])
    after = ensemble.average(table, ["hopper_width"], "Q")["Q_error"]
    ratio = (after / before).to_numpy()
    assert ratio[2] > 1.3 * np.delete(ratio, 2).max()


def test_fits_are_drawn_over_seeds(monkeypatch):
    table = runs(np.random.default_rng(8), 0.05)
    Q = table.groupby("hopper_width")["Q"].mean().to_numpy()
    w = np.array(WIDTHS)
    order = np.array([3, 0, 5, 1, 4, 2])
    drawn = ensemble.draws(ensemble.average(table, ["hopper_width"], "Q"), "Q", 100)
    sorted_fit = beverloo.fit_beverloo(w, Q, 0.02 * Q, draws=drawn)
    assert beverloo.fit_beverloo(w[order], Q[order], 0.02 * Q[order], draws=drawn[:, order]) == sorted_fit
    assert sorted_fit.beta_error > 1.3 * beverloo.fit_beverloo(w, Q, 0.02 * Q).beta_error
    monkeypatch.setattr(ensemble, "draws", lambda points, value, count: np.tile(points[value], (5, 1)))
    assert beverloo.fit_seeds(table, ["mu"])["fit"][0].beta_error < 1e-6


def test_equal_fractions_have_the_error_of_their_number():
    table = pd.DataFrame({"x": [1] * 5 + [2] * 5 + [3] * 5 + [4], "count": [2] * 5 + [6] * 5 + [2] * 6,
                          "part": [0.5] * 5 + [1.0] * 5 + [0.0, 1.0, 0.0, 1.0, 1.0] + [0.5]})
    points = ensemble.scatter(table, ["x"], "part", "count")
    assert_allclose(points["part"], [0.5, 1, 0.6, 0.5])
    assert_allclose(points["part_error"], [np.sqrt(0.25 / 10), np.sqrt(30.5 * 0.5) / 31 / np.sqrt(30),
                                           np.sqrt(0.3 / 5), np.sqrt(0.25 / 2)])
    assert_allclose(points["part_error"].iloc[2], ensemble.scatter(table, ["x"], "part")["part_error"].iloc[2])
    assert len(ensemble.scatter(table.iloc[:0], ["x"], "part", "count")) == 0
