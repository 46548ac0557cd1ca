"""Every option of PETSc and SUNDIALS that a page names, with each value that follows it there, ends a tiny run with exit
code 0."""

import re
from pathlib import Path

import pytest
from conftest import PROGRAM, subprocess

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md"), ROOT / "src/ts/sundials/README.md"]
NAMED = re.compile(r"(?<![\w-])-((?:ts|snes|ksp|pc|mat|log|tao|mobility_ksp|mobility_pc)_[a-z0-9_]*[a-z0-9])(?![\w…])"
                   r"(?: ([A-Za-z0-9.:-]+))?")
# Options that the program refuses, with their reasons on the same page (test_energy, test_bad_input).
REFUSED = {("ts_adapt_max_ignore", None), ("ts_type", "sundials")}
# Words of a sentence, and a file.
WORDS = {("ts_type", "solves"), ("ts_dt", "or"), ("log_view", ":FILE")}

COMMON = "-zeta 0.3 -t_end 0.02 -sample_interval 0.01 -frame_interval 0.02"
FEW = f"hopper -n 20 -hopper_wall_distance 6 -hopper_width 3 -pack_fraction 0.6 -integrator ts {COMMON}"
POLYGONS = (f"hopper -model rough -n 4 -n_vertices 8 -hopper_wall_distance 6 -hopper_width 3 -pack_fraction 0.4 -integrator ts "
            f"{COMMON}")
RAFT = "raft -rows 3 -columns 3 -t_end 2 -sample_interval 1 -frame_interval 2"
CLOG = "clog -n 8 -hopper_width 3 -t_end 2"
PACKING = "pack -n 16 -pressure 1e-3 -minimiser newton"
FIXED = "-dt 5e-4 -ts_type"
WATCH = "-ts_monitor -ts_view -ts_converged_reason"
SOLVER = "-snes_monitor -snes_converged_reason -snes_view -ksp_monitor -ksp_converged_reason -ksp_view -pc_type particle"

RUNS = [
    *(f"{FEW} {FIXED} rk -zeta 300 -ts_rk_type {table}" for table in ("1fe", "2b", "3", "4")),
    *(f"{FEW} -ts_type rk -ts_rk_type {table} -ts_rtol 1e-3 -ts_atol 1e-3"
      for table in ("2a", "3bs", "5f", "5dp", "5bs", "6vr", "7vr", "8vr")),
    *(f"{FEW} {FIXED} {method}" for method in ("ssp", "euler -zeta 300", "verlet", "beuler")),
    f"{FEW} -ts_rtol 1e-4 -ts_atol 1e-4 -ts_adapt_type dsp -ts_adapt_dt_min 1e-6 -ts_adapt_dt_max 0.02 -ts_dt 1e-4 {WATCH}",
    f"{FEW} -ts_rtol 1e-5 -ts_atol 1e-5 -ts_adapt_type basic -ts_max_reject 20 -ts_adapt_always_accept -log_view",
    f"{FEW} -ts_type verlet -ts_adapt_type basic -ts_rtol 3e-3 -ts_atol 3e-3 -ts_monitor",
    f"{FEW} -dynamics overdamped -zeta 30 -ts_rtol 1e-6 -ts_atol 1e-6",
    *(f"{FEW} -dt 5e-3 -ts_type {method} -ts_adapt_type {control}" for control in ("basic", "none")
      for method in ("cn", "theta -ts_theta_theta 0.7", "alpha -ts_alpha_radius 0.5", "alpha2 -ts_alpha_radius 0.5")),
    *(f"{FEW} -dt 1e-3 -ts_type bdf -ts_rtol 1e-3 -ts_bdf_order {order}" for order in range(1, 7)),
    f"{FEW} -dt 1e-3 -ts_type rosw -ts_rosw_type ra34pw2 {SOLVER} -mat_view ::ascii_info",
    f"{FEW} -dt 1e-3 -ts_type arkimex -ts_arkimex_type 3 {SOLVER} -ts_view",
    f"{FEW} -dt 1e-3 -ts_type bdf -snes_lag_jacobian 2 -snes_rtol 1e-6 -snes_atol 1e-10 -ksp_rtol 1e-6 -ksp_atol 1e-12",
    *(f"{FEW} -dt 1e-3 -ts_type bdf {how}" for how in ("-snes_mf_operator", "-jacobian matrix_free", "-pc_type lu",
                                                     "-pc_type bjacobi", "-pc_type asm")),
    f"{POLYGONS} -ts_type arkimex -implicit shape",
    f"{FEW} -ts_type cvode -ts_cvode_type adams -ts_cvode_max_order 4 -ts_cvode_anderson 2 {WATCH}",
    f"{FEW} -ts_type cvode -ts_cvode_type bdf -ts_cvode_linear spgmr -ts_cvode_stab_limit",
    f"{FEW} -ts_type cvode -ts_cvode_type bdf -ts_cvode_linear ksp -ksp_rtol 1e-8",
    f"{FEW} -ts_type cvode -ts_cvode_type bdf -ts_cvode_nonlinear snes -snes_mf -pc_type none",
    f"{FEW} -ts_type arkode -ts_arkode_type erk -ts_arkode_order 4 -ts_arkode_adapt pid -ts_arkode_safety 0.9",
    f"{FEW} -ts_type arkode -ts_arkode_type erk -ts_arkode_table dormand_prince",
    f"{FEW} -ts_type arkode -ts_arkode_type erk -ts_arkode_fixed_step -dt 5e-4",
    f"{FEW} -ts_type arkode -ts_arkode_type dirk -ts_arkode_nonlinear newton -ts_arkode_linear ksp "
    "-ts_arkode_max_iterations 5",
    f"{FEW} -ts_type arkode -ts_arkode_type dirk -ts_arkode_nonlinear fixedpoint -ts_arkode_anderson 2",
    f"{POLYGONS} -implicit shape -ts_type arkode -ts_arkode_type imex",
    f"{POLYGONS} -implicit shape -ts_type arkode -ts_arkode_type mri -dt 5e-4 -ts_arkode_fast_table bogacki_shampine",
    f"{RAFT} -ts_type rk -ts_rk_type 4",
    *(f"{RAFT} -mobility_ksp_type cg -mobility_pc_type {pc} -mobility_ksp_monitor -mobility_ksp_converged_reason "
      "-mobility_ksp_view -ts_rk_type 3bs -ts_rtol 1e-5 -ts_atol 1e-8" for pc in ("bjacobi", "icc")),
    f"{CLOG} -ts_monitor -log_view",
    f"{PACKING} -tao_type ntr -tao_monitor -tao_view -tao_converged_reason -tao_ntr_pc_type icc -tao_ntr_ksp_monitor",
    f"{PACKING} -tao_type bntr -tao_bnk_init_type constant -tao_trust0 10",
]

SHOWS = {"-ts_view": "TS Object", "-ts_monitor": " TS dt ", "-ts_converged_reason": "TS converged due to",
         "-snes_view": "SNES Object", "-snes_monitor": "SNES Function norm", "-ksp_view": "KSP Object",
         "-ksp_monitor": "KSP Residual norm", " -ksp_converged_reason": "Linear solve converged due to",
         "-mobility_ksp_converged_reason": "Linear mobility_ solve converged due to", "-mobility_ksp_view": "KSP Object",
         "-mobility_ksp_monitor": "Residual norms for mobility_ solve", "-mat_view": "Mat Object",
         "-log_view": "Summary of Stages", "-tao_monitor": "TAO,  Function value", "-tao_view": "Tao Object",
         "-tao_converged_reason": "TAO  solve converged"}


def named():
    """{(option, value that follows or None): pages}"""
    found = {}
    for page in PAGES:
        for option, value in NAMED.findall(page.read_text(encoding="utf-8")):
            takes_value = re.fullmatch(r"[a-z]*\d.*|[a-z]+\d?[a-z]*|:FILE", value) and not value.startswith("-")
            found.setdefault((option, value.rstrip(".") if value and takes_value else None), []).append(page.name)
    return found


def options_of(run):
    words = run.split()
    for word, value in zip(words, [*words[1:], "-"]):
        if word.startswith("-"):
            yield word[1:], None
            yield word[1:], value


def test_every_option_that_a_page_names_is_run():
    pages = named()
    assert len(pages) > 50
    done = {one for run in RUNS for one in options_of(run)} | REFUSED | WORDS
    assert not {one: where for one, where in pages.items() if one not in done}


@pytest.mark.parametrize("run", RUNS, ids=range(len(RUNS)))
def test_options_of_petsc(run, tmp_path):
    result = subprocess.run([PROGRAM, *run.split(), "-output", tmp_path / "run"], encoding="utf-8", capture_output=True)
    assert result.returncode == 0, result.stderr
    for option, shows in SHOWS.items():
        assert option not in run or shows in result.stdout, option
