"""The da Vinci study: every figure that it claims, and a page that loads nothing."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import polars as pl
import pytest
import sympy as sp

from kinqp.benchmarks.arm_study import REACHED, study_path
from kinqp.benchmarks.davinci import document, run_davinci
from kinqp.benchmarks.davinci.checks import check_document
from kinqp.benchmarks.davinci.matrix import compare_matrix, matrix_latex
from kinqp.benchmarks.second_opinion import nearest_distances
from kinqp.control import InverseKinematics, SpiralPath, solve_points
from kinqp.robots import load_robot, sample_workspace

ROBOT = load_robot("davinci5")
MIDDLE = 0.5 * (ROBOT.q_min + ROBOT.q_max)


@pytest.fixture(scope="module")
def ik() -> InverseKinematics:
    return InverseKinematics(ROBOT, starts=2)


@pytest.fixture(scope="module")
def long_spiral(ik):
    return solve_points(ik, document.SPIRAL.points(148), MIDDLE)


def test_all_entries_of_the_matrix_but_one_are_printed_right() -> None:
    entries = compare_matrix()
    assert len(entries) == 16
    wrong = [entry for entry in entries if not entry.same]
    assert [(entry.row, entry.column) for entry in wrong] == [(2, 2)]
    # The first of its two terms has lost its sign: with it, the difference is none.
    first, second = sp.Add.make_args(wrong[0].printed)
    candidates = [-first + second, first - second]
    assert any(sp.simplify(candidate - wrong[0].ours) == 0 for candidate in candidates)
    latex = matrix_latex()
    assert latex.startswith(r"A_8^{12} = \left[\begin{matrix}")
    assert r"300 \cos{\left(\theta_{8} \right)}" in latex
    assert latex.count("&") == 12


def test_the_reports_own_figures() -> None:
    checks = check_document(ROBOT)
    np.testing.assert_allclose(checks.initial, document.PRINTED_INITIAL, rtol=0.0, atol=5e-3)
    assert checks.outside == ("theta10",)
    # As printed, its final parameters are 4.2 mm off its final position, read as radians; far off as degrees. The
    # digits that it rounded off would explain that.
    assert checks.final_distance == pytest.approx(4.247, abs=1e-3)
    np.testing.assert_allclose(checks.final_radians, [38.827, 336.719, -13.689], rtol=0.0, atol=1e-3)
    assert np.linalg.norm(checks.final_degrees - document.PRINTED_FINAL) > 600.0
    assert checks.final_rounded < 1e-3
    assert checks.error == pytest.approx(document.PRINTED_ERROR, abs=5e-3)
    assert checks.ranges == (True, True, True, True, False)
    assert checks.ranges_known == (True, True, False, False, False)


def check_spiral(solution) -> None:
    assert 0.775 < np.mean(solution.error <= REACHED) < 0.785
    assert 1e3 * solution.error.mean() == pytest.approx(0.406, abs=1e-3)
    assert 1e3 * solution.error.max() == pytest.approx(4.304, abs=1e-3)
    assert (solution.q >= ROBOT.q_min).all()
    assert (solution.q <= ROBOT.q_max).all()
    position = [ROBOT.pose(q)[:3, 3] for q in solution.q]
    np.testing.assert_allclose(np.linalg.norm(position - solution.targets, axis=1), solution.error, rtol=0.0, atol=1e-9)


def test_spiral_of_148(long_spiral) -> None:
    check_spiral(long_spiral)
    assert np.count_nonzero(long_spiral.error <= REACHED) == 116
    # One of them, at z = -18.0006 mm, is 0.6 um below what any joint position reaches.
    assert np.count_nonzero(long_spiral.reached) == 115
    assert 1e3 * long_spiral.error[4] == pytest.approx(-18.0 - 1e3 * long_spiral.targets[4, 2], abs=1e-6)


def test_spiral_of_72_is_certified(ik) -> None:
    study = study_path(ik, document.SPIRAL.points(72), MIDDLE, starts=4)
    check_spiral(study.solution)
    assert np.count_nonzero(study.reachable) == 56
    assert np.isfinite(study.second_opinion[~study.reachable]).all()
    assert study.disagreement < 1e-6
    for motion in study.motions:
        assert np.all(np.abs(motion.joints.qd) <= ROBOT.qd_max * (1.0 + 1e-9))
        assert np.all(np.abs(motion.joints.qdd) <= ROBOT.qdd_max * (1.0 + 1e-9))
        assert np.all(motion.joints.q >= ROBOT.q_min - 1e-12)
        assert np.all(motion.joints.q <= ROBOT.q_max + 1e-12)
    times = [motion.joints.t[-1] for motion in study.motions]
    assert times == sorted(times, reverse=True)


@pytest.mark.long
def test_spiral_of_148_is_certified_from_many_starts(long_spiral) -> None:
    far = long_spiral.error > REACHED
    np.testing.assert_allclose(
        nearest_distances(ROBOT, long_spiral.targets[far], starts=24), long_spiral.error[far], rtol=0.0, atol=1e-6
    )


def test_no_sampled_point_is_nearer(long_spiral) -> None:
    """A third opinion: half a million joint positions come near the best error, and never below it."""
    cloud = sample_workspace(ROBOT, 2**19, spacing=1e-3).points
    for target, error in zip(long_spiral.targets[::3], long_spiral.error[::3], strict=True):
        assert np.min(np.linalg.norm(cloud - target, axis=1)) >= error - 1e-9


def test_neighbours_are_continuous(ik, long_spiral) -> None:
    """No jump: between the neighbours that are farthest apart, steps shrink as the path is refined.

    Next to the inner boundary of the reachable set joints change with the square root of the distance, so that a step
    16 times as fine need be a quarter only.
    """
    steps = np.linalg.norm(np.diff(long_spiral.q, axis=0) / (ROBOT.q_max - ROBOT.q_min), axis=1)
    phi = np.linspace(document.SPIRAL.begin, document.SPIRAL.end, 148)
    centre, radius, rise = document.SPIRAL.centre, document.SPIRAL.radius, document.SPIRAL.rise
    for worst in np.argsort(-steps)[:6]:
        between = SpiralPath(centre, radius, rise, phi[worst], phi[worst + 1]).points(17)
        fine = solve_points(ik, between, long_spiral.q[worst])
        finer = np.linalg.norm(np.diff(fine.q, axis=0) / (ROBOT.q_max - ROBOT.q_min), axis=1)
        assert finer.max() < 0.4 * steps[worst]
        np.testing.assert_allclose(fine.q[-1], long_spiral.q[worst + 1], rtol=0.0, atol=5e-3)


def test_any_robot_any_path() -> None:
    robot = load_robot("ur5e")
    q = np.deg2rad([10.0, -70.0, 80.0, -100.0, -80.0, 0.0])
    around = robot.pose(q)[:3, 3]
    spiral = SpiralPath(tuple(around - [0.03, 0.0, 0.0]), 0.03, 0.002, 0.0, 7.0)
    study = study_path(InverseKinematics(robot, starts=2), spiral.points(20), q)
    assert study.reachable.all()
    assert study.disagreement == 0.0
    assert np.abs(np.diff(study.solution.q, axis=0)).max() < 0.2


class Loads(HTMLParser):
    """Collects what a page would load, its ids, and whether its tags are balanced."""

    VOID = frozenset({"meta", "link", "br", "img", "hr", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.external: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        given = dict(attrs)
        self.ids.extend([given["id"]] if "id" in given else [])
        address = given.get("src") or (given.get("href") if tag == "link" else None)
        if address and not address.startswith("data:"):
            self.external.append(address)
        if tag == "a":
            self.links.append(given["href"])
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag


def check_page(out) -> None:
    text = (out / "index.html").read_text(encoding="utf-8")
    page = Loads()
    page.feed(text)
    assert page.external == []
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)
    pictures = {path.stem for path in (out / "figures").glob("*.png")}
    assert {name.removeprefix("chart-") for name in page.ids if name.startswith("chart-")} == pictures
    assert text.count("<math>") >= 16
    assert "@import" not in re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    for said in ("one sign wrong", "theta10", "38.827", "Where the report is wrong", "both radii want squaring"):
        assert said in text


def test_a_small_run_writes_everything(tmp_path) -> None:
    found = run_davinci(tmp_path, counts=(12,), samples=2**14, spacing=6e-3)
    check_page(tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary == json.loads(json.dumps(found.summary()))
    assert summary["example"]["error_mm"] < 1e-6
    assert summary["example"]["steps"] <= 30
    assert pl.read_parquet(tmp_path / "data" / "spiral-12.parquet").height == 12
    assert pl.read_parquet(tmp_path / "data" / "workspace.parquet").height == len(found.workspace.points)
    assert (tmp_path / "A_8_12.tex").read_text().startswith("A_8^{12}")


@pytest.mark.long
def test_the_whole_run_shows_every_figure_of_the_report(tmp_path) -> None:
    run_davinci(tmp_path)
    check_page(tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    shown = " ".join(re.findall(r"<figcaption><b>(.*?)</b>", text))
    numbers = {int(number) for number in re.findall(r"\d+", shown)}
    assert numbers == set(range(2, 19))
