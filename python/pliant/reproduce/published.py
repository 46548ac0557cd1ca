"""Values reported by the papers, the only place for them. [H]: Hopper flows of deformable particles; [T]: the thesis; [O]:
C. S. O'Hern et al., Phys. Rev. E 68, 011306 (2003); others by author and year.

`error` is the printed error. For a number with "about", or without an error, it is half a unit of the last digit; for an
exact exponent it is 0.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    value: float
    error: float
    source: str


def exponent(dim, limit):
    """beta of the Beverloo law in the limit "friction" or "drag"."""
    return Published(dim - 0.5 if limit == "friction" else dim - 1.5, 0.0, "H 2, 3, 10")


#: Prefactor and offset of hard particles, N = 1600, in 2D.
C = {"friction": Published(0.15, 0.01, "H 2a, 10a, 13a"), "drag": Published(0.42, 0.01, "H 2c, 10b")}
K = {"friction": Published(1.6, 0.1, "H 7a, 10a"), "drag": Published(3.4, 0.1, "H 7a, 10b")}
#: C of drag over C of friction, independent of the unit of Q: from the two above.
C_RATIO = Published(C["drag"].value / C["friction"].value,
                    C["drag"].value / C["friction"].value * math.hypot(*(c.error / c.value for c in C.values())), "H 10, 13a")
#: Offset of the softest particles.
K_SOFT = {"friction": Published(0.5, 0.5, "H 7: below 1"), "drag": Published(1.0, 0.5, "H 7")}
#: Q of stiff deformable particles over Q of hard soft particles.
HARD_ALIKE = Published(1.0, 0.0, "H App. B: one hard limit")
#: |F_zeta|/|F_mu| of the steepest hopper over the ratio of the next hopper: the curve ends in a plateau.
RATIO_PLATEAU = Published(1.0, 0.0, "H 6b: plateau")
#: Ratio zeta/mu at which beta is in the middle, by dimension with a flat bottom, and by angle in 2D.
LAMBDA_C = {2: Published(0.05, 0.005, "H 4a"), 3: Published(0.07, 0.005, "H 4b")}
LAMBDA_C_ANGLE = {90: Published(0.05, 0.005, "H 6a"), 30: Published(5e-3, 5e-4, "H 6a"), 20: Published(5e-3, 5e-4, "H 6a")}
#: Ratio zeta/mu in true units over the ratio in the numbers of the authors' program, where drag is per mass: the mass
#: there of a particle of diameter sigma_avg = 1.2, density 16.
CODE_LAMBDA = {2: 16 * math.pi / 4 * 1.2**2, 3: 16 * math.pi / 6 * 1.2**3}
#: Exponent p of C ~ N^p.
C_SIZE = {"friction": Published(1.0, 0.2, "H 12b: roughly linear"), "drag": None}  # only: much weaker
#: C of the softest particles of [H 13] over C of the hardest, and their E_sp.
C_FALL_FROM, C_FALL_TO = 50, 1600
C_FALL = {"friction": Published(2.0, 0.5, "H 4, 13a: about 2"), "drag": None}  # only: very weakly dependent
#: Exponent in w of the axis velocity at the orifice.
VELOCITY = {"friction": Published(0.5, 0.0, "H 5a"), "crossover": Published(0.0, 0.0, "H 5b: hardly depends on w"),
            "drag": Published(-0.5, 0.0, "H 5c")}
#: Droplets of oil that leave a wedge.
OIL_BETA = Published(0.49, 0.005, "H 8c")
OIL_K = Published(1.47, 0.005, "H 8c")
#: Rates of the hopper with an upright wall over the rates of the wedge with two walls of 45 degrees.
OIL_HOPPERS = Published(1.0, 0.0, "H 8c: identical")

THREE_SLOPE = Published(3.16, 0.005, "T Fig. 2.3")
THREE_PEAK = Published(0.110, 0.0005, "T Fig. 2.3")
#: Two droplets, and a droplet at a wall, in the model's equations alone: as `raft.contact_constants` names them.
CONTACTS = {"L^2/R^2": Published(31.8, 0.05, "T 2.14"), "d_eq": Published(1.993, 0.0005, "T 2.16"),
            "k1": Published(4.69, 0.005, "T 2.18"), "E1": Published(0.00173, 5e-6, "T 2.23"),
            "k_wall": Published(9.57, 0.005, "T 2.24"), "E_wall": Published(0.00340, 5e-6, "T 2.25")}
K1_SQUARE = Published(7.08, 0.6, "T Fig. 2.7")
K1_FIRST = Published(5.27, 0.005, "T 2.4.1: first reduction of the 7 x 7 raft")
K1_ARRAYS = Published(6.1, 0.05, "T 2.4.2: mean of 20 to 400 droplets")
#: F_max/N over 2 sqrt(k1 E1/(p^3 + p^2)) [T 2.37].
PEAK_RATIO = Published(1.0, 0.0, "T 2.37; most peaks of T Fig. 2.8 are higher")
#: Fraction of competing fractures as N goes to infinity.
COMPETING = Published(1.0, 0.0, "T Fig. 2.14")
NO_COMPETING = 9  #: droplets of the raft that is too small for two fractures [T Sec. 2.4.3]; from there the fraction rises in a line
TILT = Published(0.2, 0.05, "T Fig. 2.16")
#: Polydispersity of the distributions of disks.
DELTA = {name: Published(value, 0.005, "T table 3.1") for name, value in (
    ("bidisperse", 0.20), ("T1", 0.23), ("T2a", 0.27), ("T2b", 0.29), ("T2c", 0.32), ("T2d", 0.35), ("T3", 0.35),
    ("T4", 0.42), ("C1", 0.31), ("C2", 0.40), ("C3", 0.48))}
#: dr_NA of the largest disks over dr_NA of the smallest, where sizes differ by a factor of 5.
LARGEST = Published(0.84, 0.005, "T 3.4, Fig. 3.8")
PEAK_DISTANCE = Published(0.75, 0.05, "T Fig. 3.9: about 0.75 cm")
VALLEY_DISTANCE = Published(1.27, 0.05, "T Fig. 3.9: one smallest disk between")
NON_AFFINE = Published(0.37, 0.005, "T Fig. 3.11a")
NON_AFFINE_SLOPE = Published(0.0, 0.0, "T Fig. 3.11a: no relation")
D2_SLOPE = Published(0.11, 0.005, "T 3.6")
D2_OFFSET = Published(0.09, 0.005, "T 3.6")
D2_SLOPE_CLOCK = Published(0.09, 0.005, "T Fig. 3.14b")
NON_AFFINE_POWER = Published(0.74, 0.005, "T Fig. 3.12a")
D2_POWER = Published(1.47, 0.005, "T Fig. 3.12b")
ROTATION = Published(0.046, 0.0005, "T Fig. A.2")
ROTATION_SLOPE = Published(0.0, 0.0, "T Fig. A.2: no trend")
W_LOW = Published(2.595, 0.0025, "T Fig. 4.4: w* = 5.19 <R>")
W_SLOPE = Published(2.96, 0.0025, "T Fig. 4.4: w* = 5.92 delta")
DELTA_CRIT = Published(0.876, 0.0005, "T 4.13")
A = Published(0.12, 0.03, "T Fig. 4.5")
B = Published(0.029, 0.001, "T Fig. 4.5")
#: B that gives P_clog = 1/2 [T 4.20, N = 190] at the w* of the thesis itself, with its A.
B_OF_W_STAR = Published(math.log(A.value * (190 / math.log(2) + 1)) / (2 * W_SLOPE.value) ** 2,
                        A.error / A.value / (2 * W_SLOPE.value) ** 2, "T 4.20 with A = 0.12 at w* = 5.92 delta [T Fig. 4.4]")

#: Fraction at which quenched random packings jam, and their contacts, by dimension: bidisperse disks, equal spheres.
ONSET = {2: Published(0.842, 0.001, "O, N to infinity"), 3: Published(0.639, 0.001, "O, N to infinity")}
ONSET_Z = {2: Published(3.98, 0.02, "O; isostatic: 4"), 3: Published(5.98, 0.03, "O; isostatic: 6")}
#: Exponents of the number of particles in the width of the distribution of phi_J; nu of the shift of phi_J, N^(-1/(d nu)).
ONSET_WIDTH = Published(-0.55, 0.03, "O")
ONSET_NU = 0.71
#: Packings without pressure are isostatic: d (N' - 1) + 1 contacts of N' particles.
ISOSTATIC = Published(1.0, 0.0, "counting of constraints")
#: Exponents of phi - phi_J of harmonic particles.
JAMMED_POWER = {"p": Published(1.0, 0.0, "O"), "Z - Z_iso": Published(0.5, 0.0, "O"), "G": Published(0.5, 0.0, "O")}
#: Shape parameter at which packings of deformable polygons fill the box.
CONFLUENT_SHAPE = 1.16
CONFLUENCE = Published(1.0, 0.01, "A. Boromand et al. 2018: confluence at 1.16")
#: Modes without stiffness of packings of deformable polygons are as many as the contacts that are missing; exponents of the energy
#: in the displacement along these modes, and along the others; exponents of the pressure in the quadratic part of the former, and in
#: the displacement at which the energy is twice the quadratic part.
QUARTIC_COUNT = Published(1.0, 0.0, "J. D. Treado et al. 2021")
QUARTIC = {"no stiffness": Published(4.0, 0.0, "J. D. Treado et al. 2021"), "stiff": Published(2.0, 0.0, "J. D. Treado et al. 2021")}
QUARTIC_PRESSURE = {"quadratic": Published(1.0, 0.0, "J. D. Treado et al. 2021: proportional to the pre-stress"),
                    "crossover": Published(0.5, 0.0, "J. D. Treado et al. 2021: from the quadratic part")}
#: Exponents of the shear stress in the shear rate, with drag relative to the flow, as the rate goes to 0: below the fraction at
#: which flows jam, and at it.
FLOW_JAMMED = 0.8434
FLOW_POWER = {"below": Published(1.0, 0.0, "Newtonian"), "at": Published(0.28, 0.02, "P. Olsson and S. Teitel 2011")}
