"""The fits find the parameters that made the data, with honest errors."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from pliant import RunError
from pliant.beverloo import beverloo, fit_beverloo, fit_groups, local_slopes, published_exponent

W = np.array([3.0, 4.0, 5.0, 6.5, 8.0, 10.0])
LAWS = {"friction": (0.15, 1.6, 1.5), "drag": (0.42, 2.4, 0.5)}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_exact_data(law):
    Q = beverloo(W, *law)
    fit = fit_beverloo(W, Q, 0.01 * Q)
    assert_allclose([fit.C, fit.k, fit.beta], law, rtol=1e-4)
    assert fit.chi2_reduced < 1e-6 and fit.points == 6 and fit.note == ""
    assert_allclose(fit(W), Q, rtol=1e-5)
    fixed = fit_beverloo(W, Q, 0.01 * Q, beta=law[2])
    assert_allclose([fixed.C, fixed.k], law[:2], rtol=1e-5)
    assert fixed.beta == law[2] and fixed.beta_error == 0 and 0 < fixed.k_error < fit.k_error


def _pulls(law, w, beta, trials=100):
    rng = np.random.default_rng(7)
    Q = beverloo(w, *law)
    error = 0.02 * Q
    pulls = []
    for seed in range(trials):
        fit = fit_beverloo(w, rng.normal(Q, error), error, beta=beta, resamples=50, seed=seed)
        pulls.append([(fit.C - law[0]) / fit.C_error, (fit.k - law[1]) / fit.k_error,
                      (fit.beta - law[2]) / (fit.beta_error or np.nan)])
    return np.array(pulls)


@pytest.mark.parametrize("name, w, free", [("friction", W, True), ("drag", W, True), ("friction", W, False),
                                           ("friction", np.array([3.0, 5.0, 8.0]), True)],
                         ids=["friction", "drag", "fixed", "three-points"])
def test_coverage(name, w, free):
    """68 % of the true parameters lie within one standard error; also where three points determine the fit exactly."""
    law = LAWS[name]
    pulls = _pulls(law, w, None if free else law[2])
    covered = (np.abs(pulls[:, :3 if free else 2]) < 1).mean(axis=0)
    assert ((covered > 0.55) & (covered < 0.80)).all(), covered


def test_weights_decide():
    Q = beverloo(W, *LAWS["friction"])
    Q[2] *= 3  # an outlier with a large error
    error = 0.01 * Q
    error[2] = 100
    assert_allclose(fit_beverloo(W, Q, error).beta, 1.5, rtol=1e-2)
    assert abs(fit_beverloo(W, Q, 0.01 * Q).beta - 1.5) > 0.05


def test_same_seed_same_errors():
    Q = beverloo(W, *LAWS["drag"])
    assert fit_beverloo(W, Q, 0.02 * Q) == fit_beverloo(W, Q, 0.02 * Q)
    assert fit_beverloo(W, Q, 0.02 * Q) != fit_beverloo(W, Q, 0.02 * Q, seed=2)


def test_clogged_runs_are_left_out():
    w = np.r_[2.0, 2.2, W]
    Q = beverloo(w, *LAWS["drag"])
    fit = fit_beverloo(w, Q, np.where(Q > 0, 0.02 * Q, np.nan))
    assert_allclose([fit.C, fit.k, fit.beta], LAWS["drag"], rtol=1e-4)
    assert fit.points == 6 and fit.note == "2 clogged left out (w = 2, 2.2)"


def test_k_stays_below_the_narrowest_flowing_orifice():
    fit = fit_beverloo(W, np.array([1.0, 1.01, 1.02, 1.03, 1.04, 1.05]), np.full(6, 0.02))
    assert fit.k < W[0] and "at its bound" in fit.note


def test_without_errors():
    rng = np.random.default_rng(3)
    Q = beverloo(W, *LAWS["friction"]) + rng.normal(0, 0.02, 6)
    fit = fit_beverloo(W, Q)
    assert np.isnan(fit.chi2_reduced) and 0 < fit.beta_error < 0.5
    assert "scatter" in fit.note
    exact = fit_beverloo(W[::2], Q[::2])
    assert np.isnan([exact.C_error, exact.k_error, exact.beta_error]).all()
    some = fit_beverloo(W, Q, np.r_[np.nan, 0.02 * Q[1:]])
    assert np.isfinite(some.beta_error) and "1 without error" in some.note


def test_too_few_points():
    with pytest.raises(RunError, match="2 orifice widths with flow are too few for 3"):
        fit_beverloo([3, 4, 5], [0, 1, 2], [0, 0.1, 0.1])
    with pytest.raises(RunError, match="too few"):  # repeats of one width do not determine a curve
        fit_beverloo([4, 4, 5], [1, 1.1, 2], [0.1, 0.1, 0.1])
    assert fit_beverloo([3, 4, 5], [0, 1, 2], [0, 0.1, 0.1], beta=1.5).points == 2


def test_groups():
    tables = [pd.DataFrame({"mu": mu, "zeta": zeta, "hopper_width": W, "Q": beverloo(W, *law),
                            "Q_error": 0.01 * beverloo(W, *law)})
              for mu, zeta, law in ((0.0, 0.3, LAWS["drag"]), (30.0, 0.0, LAWS["friction"]))]
    lonely = pd.DataFrame({"mu": [50.0], "zeta": [0.0], "hopper_width": [3.0], "Q": [1.0], "Q_error": [0.1]})
    fits = fit_groups(pd.concat([*tables, lonely]), ["mu", "zeta"])
    assert list(fits["mu"]) == [0, 30, 50]
    assert_allclose(fits["beta"][:2], [0.5, 1.5], rtol=1e-3)
    assert fits["fit"][2] is None and "too few" in fits["note"][2]


def test_published_exponents():
    assert [published_exponent(d, *c) for d in (2, 3) for c in ((1, 0), (0, 1), (1, 1), (0, 0))] == \
        [1.5, 0.5, None, None, 2.5, 1.5, None, None]


def test_an_offset_at_its_bound_leaves_the_exponent_free():
    """Data that want k < 0 (docs/validation/hopper-limits.md: soft particles with friction only): the best fit has k =
    0, and the best exponent for this k, not an exponent of the initial grid."""
    w = np.arange(2.0, 11)
    Q = [0.233, 0.555, 1.117, 1.745, 2.722, 3.827, 5.264, 6.892, 8.749]
    error = [0.017, 0.025, 0.027, 0.031, 0.040, 0.045, 0.047, 0.048, 0.052]
    free, held = fit_beverloo(w, Q, error), fit_beverloo(w, Q, error, k=0.0)
    assert "k at its bound" in free.note
    assert_allclose([free.C, free.beta], [held.C, held.beta], rtol=1e-4)
    assert free.k < 1e-6 and held.beta_error < free.beta_error < 5 * held.beta_error


@pytest.mark.parametrize("k, beta", [(0.3, 1.22), (0.62, 1.22), (0.57, 1.33), (0.2, 1.9)])
def test_a_small_offset_is_found(k, beta):
    """The start on the coarse grid may have k at the bound: the fit must leave it."""
    Q = beverloo(W, 2.0, k, beta)
    for draw in np.random.default_rng(3).normal(Q, 0.01 * Q, (3, len(W))):
        fit = fit_beverloo(W, draw, 0.01 * Q, resamples=50)
        assert abs(fit.k - k) < 4 * max(fit.k_error, 0.05) and abs(fit.beta - beta) < 4 * max(fit.beta_error, 0.02)
        best = min((fit_beverloo(W, draw, 0.01 * Q, k=x, resamples=2) for x in np.linspace(0, 1, 41)),
                   key=lambda one: one.chi2_reduced)
        assert fit.chi2_reduced * 3 < best.chi2_reduced * 4 * 1.0001 + 1e-6  # 3 and 4 degrees of freedom



def test_a_fit_with_k_at_its_bound_decides_nothing_and_its_unbounded_form_has_the_exponent():
    w = np.array([3.0, 4.0, 6.0, 8.0, 10.0])
    Q = 0.2 * (w + 1.5) ** 1.9
    bounded = fit_beverloo(w, Q, 0.002 * Q, resamples=50)
    assert bounded.at_bound == ("k",) and not bounded.decides and abs(bounded.beta - 1.9) > 0.2
    free = fit_beverloo(w, Q, 0.002 * Q, resamples=50, k_bounded=False)
    assert free.decides and free.beta == pytest.approx(1.9, abs=1e-3) and free.k == pytest.approx(-1.5, abs=1e-2)


def test_as_many_widths_as_parameters_decide_nothing():
    w = np.array([3.0, 6.0, 10.0])
    few = fit_beverloo(w, 0.2 * (w - 1) ** 1.5, 0.01 * w, resamples=50)
    more = fit_beverloo(np.append(w, 8), 0.2 * (np.append(w, 8) - 1) ** 1.5, 0.01 * np.append(w, 8), resamples=50)
    assert not few.decides and more.decides


def test_local_slopes_are_those_of_a_power_law():
    w = np.array([2.0, 4.0, 8.0])
    slopes = local_slopes(w, 3 * w**1.5, 0.03 * w**1.5)
    assert [(a, b) for a, b, *_ in slopes] == [(2, 4), (4, 8)]
    assert [s for _, _, s, _ in slopes] == pytest.approx([1.5, 1.5])
    assert slopes[0][3] == pytest.approx(np.hypot(0.01, 0.01) / np.log(2))


def test_the_fit_is_the_least_sum_of_squares():
    """lmfit stopped at k = -33, beta = 4.4 with these data, in the long valley of k and beta, with a sum that was 1 % larger."""
    w, Q = np.array([5.47, 6.261, 7.259, 10.569]), np.array([0.4208, 0.44, 0.5076, 0.7074])
    fit = fit_beverloo(w, Q, 0.03 * Q, resamples=2, k_bounded=False)
    grid = [fit_beverloo(w, Q, 0.03 * Q, k=k, resamples=2).chi2_reduced for k in (-80, -60, -40, -30, -20)]
    free = (len(w) - 2) / (len(w) - 3)
    assert fit.chi2_reduced <= min(grid) * free * (1 + 1e-9)
    assert fit.at_bound == ("beta",) and not fit.decides
