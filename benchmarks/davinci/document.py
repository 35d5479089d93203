"""What the report prints: N. Adaloglou, "Project Medical Robotics", MSc Biomedical Engineering 2017/2018."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...control import SpiralPath

#: Table 2, A_8^12 with lengths in millimetres, row by row, in the report's letters.
TABLE_2: Final = (
    (
        "-cos(th12)*(sin(th8)*sin(th11) - cos(th8)*cos(th10)*cos(th11)) - cos(th8)*sin(th10)*sin(th12)",
        "sin(th12)*(sin(th8)*sin(th11) - cos(th8)*cos(th10)*cos(th11)) - cos(th8)*cos(th12)*sin(th10)",
        "-cos(th11)*sin(th8) - cos(th8)*cos(th10)*sin(th11)",
        "300*cos(th8) - 18*cos(th11)*sin(th8) - d9*sin(th8) - 18*cos(th8)*cos(th10)*sin(th11)",
    ),
    (
        "cos(th12)*(cos(th8)*sin(th11) + cos(th10)*cos(th11)*sin(th8)) - sin(th8)*sin(th10)*sin(th12)",
        "sin(th12)*(cos(th8)*sin(th11) + cos(th10)*cos(th11)*sin(th8)) - cos(th12)*sin(th8)*sin(th10)",
        "cos(th8)*cos(th11) - cos(th10)*sin(th8)*sin(th11)",
        "300*sin(th8) + 18*cos(th8)*cos(th11) + d9*cos(th8) - 18*cos(th10)*sin(th8)*sin(th11)",
    ),
    (
        "-cos(th10)*sin(th12) - cos(th11)*cos(th12)*sin(th10)",
        "cos(th11)*sin(th10)*sin(th12) - cos(th10)*cos(th12)",
        "sin(th10)*sin(th11)",
        "18*sin(th10)*sin(th11)",
    ),
    ("0", "0", "0", "1"),
)
#: The joints' letters there.
LETTERS: Final = ("th8", "d9", "th10", "th11", "th12")
#: Table 1 and table 2 name the same things differently: (table 1, general matrix and table 2, what it is).
LETTERS_APART: Final = (
    ("a (°)", "\u03b1_i", "twist about the new x axis"),
    ("r (mm)", "a_i", "offset along the new x axis; table 1 calls the twist a"),
    ("a5 = 300", "300", "the upper arm"),
    ("a6 = 200*", "d9", "the insertion, which is variable: 200 is its largest value, not a start value"),
    ("a7 = 18", "18", "the tool; a d in table 1's own column, called a"),
    ("Theta8 8-9 ... Theta12 12-13", "A_8^9 ... A_11^12", "five rows, frames 8 to 13; the product has four factors"),
)

#: Figure 5: start and target of the inverse kinematics, and what it printed (rad, mm).
START: Final = (1.0, 180.0, -0.2, 2.1, 0.0)
TARGET: Final = (33.354, 335.1, -16.579)
PRINTED_INITIAL: Final = (10.045, 331.97, -3.0869)
PRINTED_FINAL: Final = (34.629, 336.56, -14.312)
PRINTED_PARAMETERS: Final = (553.86, 177.78, -25712.0, -51344.0, 1692.0)
#: Half of the last digit printed of each.
PRINTED_ROUNDING: Final = (0.005, 0.005, 0.5, 0.5, 0.5)
PRINTED_ITERATIONS: Final = 9946
PRINTED_ERROR: Final = 4.9979  # mm, sum of absolute differences

#: Question 4: the spiral; t from -0.8 to 1.3 with T = 1.
SPIRAL: Final = SpiralPath(
    centre=(0.230, 0.200, -0.0145), radius=0.020, rise=0.75e-3, begin=-1.6 * np.pi, end=2.6 * np.pi
)
COUNTS: Final = (148, 72)
PRINTED_SPIRAL_MEAN: Final = 4.06  # mm
PRINTED_SPIRAL_MAX: Final = 9.8  # mm

#: Figure 13: the example of a cubic (s, and whatever unit).
CUBIC_EXAMPLE: Final = (0.0, 10.0, 30.0, 60.0)

#: Check_Param's verdicts on the printed parameters (figure 6).
CHECK_PARAM: Final = ("in range", "in range", "in range", "in range", "NOT in range")

#: What is wrong with the text itself.
SLIPS: Final = (
    "Table 2's entry (2, 2) has lost a minus sign: as printed, the matrix is no rotation.",
    "Table 1's five rows reach frame 13; the product that is called A_8^12 prints four factors, and holds all five.",
    "The ring to prune to is written (x - x_c)² + (y - y_c)² < (r + 2): both radii want squaring.",
    "Figure 4 is announced as the xz plot and captioned X, Y; figures 11 and 12 are both captioned xz, the text says "
    "that figure 12 is xy; the table of ranges is table 3, the text says 2.",
    "J is called orthonormal to justify the pseudo-inverse; it is 3 x 5.",
)
