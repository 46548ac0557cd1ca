"""Clogs over many runs: intervals, fits and figures of made tables whose parameters are known."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from pliant import RunError, clog_analysis as clog
from pliant.clog_figures import draw_avalanches, draw_curves, draw_probabilities


def made_table(seeds=400, law=(0.12, 0.029), seed=1, phi=(0, 5e-5, 1e-4, 2e-4), n=190, widths=np.arange(2, 12.1, 0.5)):
    """Runs that follow [T 4.17, 4.19] in w/delta*, delta = sqrt(phi_c/1e-4), delta_crit = 0.8: every run draws the
    avalanche that would be, and clogs if it is smaller than n."""
    rng = np.random.default_rng(seed)
    rows = []
    for phi_c in phi:
        delta = np.sqrt(phi_c / 1e-4)
        for width in widths:
            mean = clog.avalanche_law(2 * width / max(delta, 0.8), *law)
            for size in rng.geometric(1 / (1 + mean), seeds) - 1:
                rows.append({"n": n, "phi_c": phi_c, "g": 0.01, "hopper_width": width,
                             "status": "clogged" if size < n else "empty", "avalanche_size": min(size, n),
                             "capillary_length": delta})
    return pd.DataFrame(rows)


def test_binomial_interval():
    # Wilson: (p + z²/2n ± z sqrt(p(1-p)/n + z²/4n²))/(1 + z²/n), z = 1.95996
    z, n, p = 1.959964, 20, 0.25
    half = z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    middle = p + z**2 / (2 * n)
    assert_allclose(clog.binomial_interval(5, 20), [(middle - half) / (1 + z**2 / n), (middle + half) / (1 + z**2 / n)],
                    rtol=1e-6)
    assert clog.binomial_interval(0, 20)[0] == 0 and 0.1 < clog.binomial_interval(0, 20)[1] < 0.2
    assert clog.binomial_interval(20, 20)[1] == 1


def test_points():
    table = pd.DataFrame({"n": 190, "phi_c": 1e-4, "g": 0.01, "hopper_width": [3, 3, 3, 4.0], "capillary_length": 1.0,
                          "status": ["clogged", "empty", "clogged", "empty"], "avalanche_size": [10, 190, 40, 190]})
    points = clog.clog_points(table)
    assert list(points["hopper_width"]) == [3, 4] and list(points["runs"]) == [3, 1]
    assert list(points["clogged"]) == [2, 0]
    assert_allclose(points["s"], [80, 190])
    assert_allclose(points["s_error"][0], np.std([10, 190, 40], ddof=1) / np.sqrt(3))
    assert np.isnan(points["s_error"][1])


def test_sigmoid_finds_its_parameters():
    x = np.linspace(2, 4, 21)
    runs = np.full(21, 1e6)
    fit = clog.fit_sigmoid(x, clog.sigmoid(x, 2.9, 0.13) * runs, runs)
    assert_allclose([fit.x0, fit.alpha], [2.9, 0.13], rtol=1e-4)
    assert 0 < fit.x0_error < 1e-3
    small = clog.fit_sigmoid(1e-3 * x, clog.sigmoid(x, 2.9, 0.13) * runs, runs)  # g is of this size
    assert_allclose([small.x0, small.alpha], [2.9e-3, 0.13e-3], rtol=1e-4)


def test_sigmoid_errors_cover():
    """68 % of the true parameters lie within one standard error."""
    x, rng = np.linspace(2, 4, 9), np.random.default_rng(3)
    pulls = []
    for _ in range(300):
        fit = clog.fit_sigmoid(x, rng.binomial(30, clog.sigmoid(x, 3.03, 0.25)), np.full(9, 30))
        pulls.append([(fit.x0 - 3.03) / fit.x0_error, (fit.alpha - 0.25) / fit.alpha_error])
    covered = (np.abs(pulls) < 1).mean(axis=0)
    assert ((covered > 0.58) & (covered < 0.78)).all(), covered


def test_sigmoid_weighs_runs():
    x, runs = [1.0, 2, 3, 4], np.array([1, 1000, 1000, 1])
    fit = clog.fit_sigmoid(x, [0, 700, 300, 1], runs)  # the two single runs have the opposite outcome
    assert abs(fit.x0 - 2.5) < 0.02


def test_a_step_has_no_width():
    fit = clog.fit_sigmoid([2, 4, 3, 2.5], [20, 0, 0, 20], [20] * 4)
    assert (fit.x0, fit.x0_error) == (2.75, 0.25) and np.isnan(fit.alpha) and "step" in fit.note
    assert_allclose(fit([2.5, 3]), [1, 0], atol=1e-9)


def test_a_step_but_for_one_point():
    """The errors follow from the likelihood, whose curvature vanishes at a width of 0."""
    x = np.array([3.5, 4.5, 5.5, 6.5])
    fit = clog.fit_sigmoid(x, [4, 4, 1, 0], [4] * 4)
    assert 5 < fit.x0 < 5.5 and 0.1 < fit.x0_error < 0.5 and np.isnan(fit.alpha) and "step" in fit.note
    many = clog.fit_sigmoid(x, [400, 400, 100, 0], [400] * 4)
    assert 5 < many.x0 < 5.5 and many.x0_error < fit.x0_error
    edge = clog.fit_sigmoid(x, [3, 0, 0, 0], [4] * 4)  # nothing clogs always
    assert 3.5 < edge.x0 < 4.5 and 0 < edge.x0_error < 0.5
    more = clog.fit_sigmoid(x, [4, 3, 1, 0], [4] * 4)
    assert np.isfinite(more.alpha) and 0.2 < more.x0_error < 1


@pytest.mark.parametrize("x, clogged", [([1, 2, 3], [20, 20, 18]), ([1, 2, 3], [0, 1, 0]), ([1, 2, 3], [20, 10, 10]),
                                        ([1, 1, 1], [20, 10, 0]), ([1, 2, 3, 4], [9, 11, 12, 12])])
def test_no_sigmoid_without_both_sides(x, clogged):
    with pytest.raises(RunError, match="does not pass one half"):
        clog.fit_sigmoid(x, clogged, [20] * len(x))


def test_regimes():
    delta = np.array([0, 0.3, 0.5, 0.7, 1.0, 1.3, 1.6, 1.9])
    truth = np.maximum(2.6, 2.96 * delta)
    fit = clog.fit_regimes(delta, truth, np.full(8, 0.05))
    assert_allclose([fit.low, fit.slope, fit.delta_crit], [2.6, 2.96, 2.6 / 2.96])
    assert_allclose(fit.effective([0.1, 1.5]), [2.6 / 2.96, 1.5])
    assert_allclose(fit(delta), truth)
    assert_allclose(fit.low_error, 0.05 / 2)  # four points
    noisy = clog.fit_regimes(delta, truth + 0.1 * np.cos(np.arange(8) * 2.0), np.full(8, 1e-3))
    assert abs(noisy.slope - 2.96) < 4 * noisy.slope_error and noisy.slope_error > 0.01  # by the scatter
    with pytest.raises(RunError, match="too few"):
        clog.fit_regimes(delta[:3], truth[:3], np.ones(3))


def test_laws():
    assert_allclose(clog.avalanche_law(0, 0.5, 3), 1)
    assert_allclose(clog.clog_law(5, 0.12, 0.029, 190), -np.expm1(-190 / (np.exp(0.029 * 25) / 0.12 - 1)))
    assert clog.clog_law(0, 1, 1, 190) == 1  # an avalanche of none


def test_avalanches_find_the_law():
    x = np.linspace(2, 14, 13)
    s = clog.avalanche_law(x, 0.12, 0.029)
    fit = clog.fit_avalanches(x, np.minimum(s, 190), 0.05 * s + 1, np.full(13, 190))
    assert_allclose([fit.A, fit.B], [0.12, 0.029], rtol=1e-6)
    assert fit.points == (s < 0.75 * 190).sum() < 13
    with pytest.raises(RunError, match="too few"):
        clog.fit_avalanches(x[-3:], np.minimum(s, 190)[-3:], s[-3:], np.full(3, 190))


def test_whole_chain_on_drawn_runs():
    """Sigmoids, the regimes and the collapse find the parameters from which the runs were drawn."""
    points = clog.clog_points(made_table())
    fits = clog.fit_sigmoids(points, "hopper_width")
    assert list(fits["delta"]) == pytest.approx([0, 0.7071, 1, 1.4142], rel=1e-3)
    # 1 - exp(-n/s) = 1/2 at s = n/ln 2
    half = np.sqrt(np.log(0.12 * (190 / np.log(2) + 1)) / 0.029) / 2
    # The law is not a sigmoid, which shifts the middle by 2 %.
    assert_allclose(fits["x0"], half * np.maximum(fits["delta"], 0.8), rtol=0.04)
    assert clog.fit_sigmoids(points, "g").empty
    regimes = clog.fit_regimes(fits["delta"], fits["x0"], fits["x0_error"])
    assert abs(regimes.delta_crit - 0.8) < 0.02
    # <s> of runs of few droplets is cut by their number, which bends ln(<s> + 1) down; drawn without that cut:
    free = clog.clog_points(made_table(n=100000, widths=np.arange(1, 4.1, 0.5)))
    fit = clog.fit_avalanches(2 * free["hopper_width"] / np.maximum(free["delta"], 0.8), free["s"], free["s_error"],
                              free["n"])
    assert abs(fit.A - 0.12) < 4 * fit.A_error and abs(fit.B - 0.029) < 4 * fit.B_error
    assert fit.A_error < 0.01 and fit.B_error < 0.002


def test_means_of_avalanches_that_are_cut_off():
    mean, error = clog.uncut_mean([10, 30, 190, 190], [True, True, False, False])
    assert mean == 210 and error == pytest.approx(210 / np.sqrt(2))
    assert np.isnan(clog.uncut_mean([190, 190], [False, False])).all()
    points = clog.clog_points(made_table(seeds=2000, widths=(4.0, 5.0)))
    expected = clog.avalanche_law(2 * points["hopper_width"] / np.maximum(points["delta"], 0.8), 0.12, 0.029)
    assert (points["clogged"] < points["runs"]).any()
    assert ((points["s_uncut"] - expected).abs() < 4 * points["s_uncut_error"] + 1).all()
    largest = np.argmax(expected)  # where the mean of all runs is half of it
    assert points["s"][largest] < 0.6 * expected[largest]


def test_probabilities_find_the_law():
    x, runs = np.linspace(6, 14, 9), np.full(9, 1e7)
    clogged = np.round(runs * clog.clog_law(x, 0.12, 0.029, 190))
    fit = clog.fit_clog_law(x, clogged, runs, np.full(9, 190))
    assert_allclose([fit.A, fit.B], [0.12, 0.029], rtol=1e-3)
    with pytest.raises(RunError, match="too few"):
        clog.fit_clog_law(x, np.where(x < 10, runs, 0), runs, np.full(9, 190))


def test_what_decides_the_collapse():
    """The means of all runs, cut by their number, make B too small; with the cut counted, and from P_clog, it is found."""
    points = pd.concat([clog.clog_points(made_table(n=n, seed=n)) for n in (95, 190, 285)], ignore_index=True)
    other = clog.clog_points(made_table(seed=9, widths=(4.0, 5.0, 6.0)).assign(g=0.02))
    points = pd.concat([points, other, clog.clog_points(made_table(phi=(3e-4,)))], ignore_index=True)
    fits = clog.collapse_fits(points, clog.effective_width(points, 0.8))
    assert set(fits) == {"all", "scaled", "N = 95", "N = 285", "phi_c = 0", "phi_c = 5e-05", "phi_c = 0.0001",
                         "phi_c = 0.0002", "phi_c = 0.0003", "widths at one g", "other g", "cut off", "P_clog"}
    assert fits["all"].B < 0.029 - 4 * fits["all"].B_error, "a mean that is cut is too small"
    for name in ("cut off", "P_clog"):
        assert abs(fits[name].B - 0.029) < 3 * fits[name].B_error < 0.004, name
        assert abs(fits[name].A - 0.12) < 3 * fits[name].A_error < 0.09, name
        assert fits[name].chi2_reduced < 3, name
    assert fits["N = 95"].points < fits["all"].points
    single = points[(points["n"] == 190) & (points["g"] == 0.01)].reset_index(drop=True)
    fits = clog.collapse_fits(single, clog.effective_width(single, 0.8))
    assert not {"scaled", "N = 190", "widths at one g", "other g"} & set(fits), "the same fit is not made again"


def test_tables_are_checked(tmp_path):
    table = made_table(seeds=2, phi=(1e-4,), widths=(3.0,))
    table.loc[len(table)] = {**table.loc[0], "status": "failed", "avalanche_size": np.nan}
    table.to_csv(tmp_path / "a.csv", index=False)
    read, left_out = clog.load_clogs([tmp_path / "a.csv"])
    assert len(read) == 2 and left_out == 1
    table.drop(columns="capillary_length").to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(RunError, match="'capillary_length' is missing"):
        clog.load_clogs([tmp_path / "b.csv"])
    table[table["status"] == "failed"].to_csv(tmp_path / "c.csv", index=False)
    with pytest.raises(RunError, match="no run has ended"):
        clog.load_clogs([tmp_path / "c.csv"])


def test_laws_in_figures_are_those_of_the_commonest_number_of_droplets():
    """Both panels, where a few points have more of them."""
    table = pd.concat([made_table(seeds=20, phi=(0, 1e-4), n=n, widths=widths)
                       for n, widths in ((190, np.arange(2, 12.1, 1.0)), (380, np.array([4.0, 6.0])))])
    points = clog.clog_points(table)
    x = clog.effective_width(points, 0.8)
    fit = clog.fit_avalanches(x, points["s"], points["s_error"], points["n"])
    figure, (left, middle, right) = plt.subplots(1, 3)
    draw_avalanches(left, middle, points, x, fit)
    draw_probabilities(right, points, x, fit)
    grid = np.linspace(0, x.max() * 1.05, 400)
    law = right.lines[-1]
    assert_allclose(law.get_ydata(), clog.clog_law(grid, fit.A, fit.B, 190))
    assert max(left.lines[-1].get_ydata()) == 190
    plt.close(figure)


def test_curves_are_named_by_what_differs():
    def labels(table):
        figure, axes = plt.subplots()
        draw_curves(axes, clog.fit_sigmoids(clog.clog_points(table), "hopper_width"), "hopper_width")
        texts = [text.get_text() for text in axes.get_legend().get_texts()]
        plt.close(figure)
        return texts

    small, large = (made_table(seeds=20, phi=(1e-4,), n=n) for n in (95, 190))
    assert labels(pd.concat([small, large])) == ["$N$ = 95", "$N$ = 190"]
    assert labels(small) == [r"$\phi_c$ = 0.0001"]
    assert labels(pd.concat([small, made_table(seeds=20, phi=(2e-4,))])) == [r"$\phi_c$ = 0.0001, $N$ = 95",
                                                                            r"$\phi_c$ = 0.0002, $N$ = 190"]


def two_angles():
    """Clogs of two hoppers, whose transitions are at 4.4 and 8.8 diameters."""
    steep = made_table(seeds=40, phi=(1e-4,))
    table = pd.concat([steep.assign(hopper_angle=25), steep.assign(hopper_angle=60, hopper_width=2 * steep["hopper_width"])])
    return table.assign(scenario="clog", seed=range(len(table))).reset_index(drop=True)


def test_other_options_are_other_series():
    table = two_angles()
    points = clog.clog_points(table)
    assert set(points["series"]) == {r"$\theta_w = 25$", r"$\theta_w = 60$"} and (points["runs"] == 40).all()
    apart = clog.fit_sigmoids(points, "hopper_width")
    alone = [clog.fit_sigmoids(clog.clog_points(own), "hopper_width").iloc[0] for _, own in table.groupby("hopper_angle")]
    assert_allclose(apart["x0"], [fit["x0"] for fit in alone])
    assert alone[0]["series"] == ""
    figure, axes = plt.subplots()
    draw_curves(axes, apart, "hopper_width")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        rf"$\phi_c$ = 0.0001, $\theta_w = {angle}$" for angle in (25, 60)]
    plt.close(figure)


def test_a_run_in_two_tables_counts_once(tmp_path):
    table = two_angles()
    table.to_csv(tmp_path / "a.csv", index=False)
    table[:50].to_csv(tmp_path / "b.csv", index=False)
    read, _ = clog.load_clogs([tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "a.csv"])
    assert len(read) == len(table)
