"""`kinqp describe`."""

from pathlib import Path

import pytest

from kinqp.formulations import get_formulation
from kinqp.robots import load_robot
from tests.cli.test_app import kinqp

WORDS = ("describe", "--robot", "lbr_med14", "--formulation", "joint-space", "--mode")


def test_markdown_comes_out_as_it_is(tmp_path: Path) -> None:
    picture = tmp_path / "kkt.svg"
    done = kinqp(*WORDS, "rcm:0.1", "--spy", picture)
    assert done.returncode == 0, done.stderr
    assert done.stdout == get_formulation("joint-space").describe(load_robot("lbr_med14"), "rcm:0.1")
    assert str(picture) in done.stderr
    assert picture.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*WORDS, "line:z", "--spy", "kkt.txt"), "path: expected a file name that ends in .png or .svg, got kkt.txt"),
        (
            (*WORDS[:4], "tests.formulations.in_cvxpy:joint_space", "--mode", "free"),
            "joint-space-in-cvxpy, parameter J_free: expected shape (6, 7) for lbr_med14 in mode free, got (3, 7)",
        ),
    ],
)
def test_a_mistake_is_one_sentence(words: tuple[str, ...], message: str) -> None:
    done = kinqp(*words)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
