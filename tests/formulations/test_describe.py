"""A declaration as Markdown, and its KKT matrix as a picture."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from matplotlib import image

from kinqp.formulations import Formulation, Mode, PlotError, get_formulation, lower
from kinqp.formulations.spy import CHANGING, CONSTANT, kkt_pattern
from tests.formulations.inputs import varied
from tests.formulations.reference import MODES, ONE_QP, evaluator
from tests.formulations.test_to_cvxpy import Odd
from tests.robots.arms import arm

if TYPE_CHECKING:
    from pathlib import Path

    from kinqp.formulations import QuadraticProgram, Tick
    from kinqp.solvers import QP
    from tests.formulations.reference import Array

ROBOT = arm("lbr_med14")


def math(text: str) -> list[str]:
    (block,) = re.findall(r"```math\n(.*?)\n```", text, flags=re.DOTALL)
    return [line.strip().removesuffix(r"\\").strip() for line in block.splitlines()]


def table(text: str, heading: str) -> list[list[str]]:
    lines = text.partition(f"## {heading}\n\n")[2].partition("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines[2:]]


def test_joint_space_reads_as_in_the_thesis() -> None:
    text = get_formulation("joint-space").describe(ROBOT, "fix-orientation")
    assert text.startswith(
        "# `joint-space` on `lbr_med14`, mode `fix-orientation`\n\nCartesian error against joint speed"
    )
    assert math(text) == [
        r"\begin{aligned}",
        r"\min_{\varepsilon,\,\dot q}\quad & \tfrac12 \lVert \varepsilon \rVert^2_{\mathrm{task\_weight}}"
        r" + \tfrac12 \lVert \dot q \rVert^2_{\mathrm{joint\_weight}}",
        r"\text{s.t.}\quad & J_{\mathrm{free}} \dot q - \varepsilon = v && \text{task}",
        r"& J_{\mathrm{fixed}} \dot q = v_{\mathrm{fixed}} && \text{mode}",
        r"& \dot q_{\mathrm{lo}} \le \dot q \le \dot q_{\mathrm{hi}} && \text{joint limits}",
        r"& \text{command} = \dot q",
        r"\end{aligned}",
    ]
    assert table(text, "Dimensions")[:4] == [
        ["variables", "10 (eps 3, qd 7)"],
        ["equalities", "6"],
        ["two-sided rows", "0"],
        ["bounded variables", "7"],
    ]
    assert table(text, "Rows") == [
        ["task", "equality", "3", "A[0-2]"],
        ["mode", "equality", "3", "A[3-5]"],
        ["joint limits", "bound", "7", "x[3-9]"],
    ]
    inputs = table(text, "Run-time inputs")
    assert ["`v`", "3", "m/s, rad/s", "to be given at every tick"] in inputs
    assert ["`joint_weight`", "7", "-", "0.0001"] in inputs


def test_what_has_no_name_gets_a_letter_and_a_legend() -> None:
    text = Odd().describe(ROBOT, "position")
    assert math(text)[1:-1] == [
        r"\min_{\dot q,\,\mathrm{slack}}\quad & \tfrac12 \lVert J_{\mathrm{free}} \dot q - v \rVert^2_{3}"
        r" + \tfrac12 \lVert A_{1} \dot q + A_{2} \mathrm{slack} + r_{1} \rVert^2_{W_{1}}"
        r" + \tfrac12 \lVert r_{2} \rVert^2 + c_{1}^\top \dot q + 0.1\, \mathrm{slack}",
        r"\text{s.t.}\quad & b_{1} \le A_{3} \dot q + A_{4} \mathrm{slack} && \text{partly}",
        r"& A_{5} \dot q + A_{6} \mathrm{slack} \le b_{2} && \text{above}",
        r"& -\mathrm{limit} \le \dot q \le \mathrm{limit} && \text{may be off}",
        r"& A_{7} \dot q - a \mathrm{slack} = 0.5 && \text{tie}",
        r"& \text{command} = \dot q + A_{8} \mathrm{slack}",
    ]
    assert "| $A_{1}$ | rest, factor of qd | 8 x 7 | constant |" in text
    assert "| $r_{1}$ | offset of rest | 8 | change every tick |" in text
    assert table(text, "Rows")[:2] == [["partly", "bound", "3", "x[0-1, 7]"], ["above", "two-sided", "2", "C[0-1]"]]


@dataclass(frozen=True)
class Twice(Formulation):
    """The same matrix in two places, once turned round; a variable of two words."""

    name: ClassVar[str] = "twice"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State it."""
        qd, share = qp.variable("qd", tick.nv), qp.variable("free share", 1)
        b = tick.parameter("b", 1.0, size=2)
        qp.between(0.0, b * qd[:2] + share, 1.0, name="one")
        qp.between(-1.0, -b * qd[:2], 0.0, name="other")
        qp.command(qd)


def test_the_same_matrix_has_the_same_letter() -> None:
    text = Twice().describe(ROBOT, "position")
    assert math(text)[1:-2] == [
        r"\min_{\dot q,\,\text{free share}}\quad & 0",
        r"\text{s.t.}\quad & 0 \le A_{1} \dot q + A_{2} \text{free share} \le 1 && \text{one}",
        r"& -1 \le -A_{1} \dot q \le 0 && \text{other}",
    ]
    assert "| $A_{1}$ | one, factor of qd; -other, factor of qd | 2 x 7 | change every tick |" in text


@pytest.mark.parametrize("mode", [*MODES[:2], *(pytest.param(mode, marks=pytest.mark.long) for mode in MODES[2:])])
@pytest.mark.parametrize("formulation", ONE_QP)
def test_every_row_is_listed_once(formulation: str, mode: str) -> None:
    text = get_formulation(formulation).describe(arm("ur5e"), mode)
    lowered = evaluator("ur5e", formulation, mode).lowered
    counted = sum(int(count) for _, _, count, _ in table(text, "Rows"))
    rows = lowered.rows
    assert counted == len(rows.equalities) + len(rows.inequalities) + sum(bool(name) for name in rows.box)
    assert [row[0].strip("`") for row in table(text, "Run-time inputs")] == [given.name for given in lowered.inputs]
    opened, closed = text.count("{"), text.count("}")
    assert opened == closed


def kkt(qp: QP, bounded: list[int]) -> Array:
    rows = np.vstack((qp.A, qp.C, np.eye(qp.n)[bounded]))
    return np.block([[qp.H, rows.T], [rows, np.zeros((len(rows), len(rows)))]])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("formulation", ONE_QP)
def test_pattern_is_that_of_the_numbers(formulation: str, mode: str) -> None:
    numbers, rng = evaluator("lbr_med14", formulation, mode), np.random.default_rng(0)
    lowered = numbers.lowered
    pattern, groups = kkt_pattern(lowered)
    bounded = [j for j, name in enumerate(lowered.rows.box) if name]
    drawn = [numbers(**varied(lowered, ROBOT.random_configuration(rng), rng)).qp for _ in range(4)]
    matrices = np.array([kkt(qp, bounded) for qp in drawn])
    assert not matrices[:, pattern == 0].any()
    assert (matrices[0] == matrices)[:, pattern == CONSTANT].all()
    assert matrices[0][pattern == CONSTANT].all()
    assert np.array_equal(pattern, pattern.T)
    moved = (matrices[0] != matrices).any(axis=0)
    assert (pattern[moved] == CHANGING).all()
    assert moved.sum() > 0.5 * (pattern == CHANGING).sum()
    assert sum(count for _, count in groups) == len(pattern)


def test_picture_is_written_where_it_was_asked_for(tmp_path: Path) -> None:
    made = get_formulation("joint-space")
    png = made.spy(ROBOT, "fix-orientation", tmp_path / "kkt.png")
    pixels = image.imread(png)
    assert len(np.unique(pixels.reshape(-1, pixels.shape[2]), axis=0)) > 3
    svgs = [made.spy(ROBOT, Mode.fix_orientation(), str(tmp_path / f"{i}.svg")).read_bytes() for i in range(2)]
    assert svgs[0] == svgs[1]
    assert svgs[0].startswith(b"<?xml")
    with pytest.raises(PlotError, match=r"^path: expected a file name that ends in \.png or \.svg, got .*kkt\.bmp"):
        made.spy(ROBOT, "fix-orientation", tmp_path / "kkt.bmp")
    groups = kkt_pattern(lower(made, ROBOT, Mode.fix_orientation()))[1]
    assert groups == [("eps", 3), ("qd", 7), ("task", 3), ("mode", 3), ("joint limits", 7)]
