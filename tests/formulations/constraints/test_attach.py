"""Putting constraints on formulations: by object and by text, names, mistakes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import (
    CartesianError,
    DeclarationError,
    JointSpace,
    Mode,
    QuadraticProgram,
    Tick,
    get_formulation,
    lower,
    with_constraints,
)
from kinqp.formulations.constraints import (
    Constrained,
    Constraint,
    ElbowHold,
    Obstacle,
    Obstacles,
    RemoteCentre,
    SelfCollision,
    SingularityAvoidance,
    TwistLimits,
    available_constraints,
    get_constraint,
)
from kinqp.robots import Capsule, RobotError
from kinqp.solvers import Status
from kinqp.solvers.plugins import PluginError
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable

Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 20.0])


def test_text_and_objects_make_the_same() -> None:
    text = "cartesian-error(bounds=thesis) + twist-limits(frame=tool) + self-collision(approach=damper, retreat=false)"
    wanted = Constrained(
        formulation=CartesianError(bounds="thesis"),
        constraints=(TwistLimits(frame="tool"), SelfCollision(approach="damper", retreat=False)),
    )
    assert get_formulation(text) == wanted
    assert wanted.bounds == "thesis"
    assert with_constraints("cartesian-error(bounds=thesis)", list(wanted.constraints)) == wanted
    assert get_constraint("remote-centre(pivot=0.5 -1e-1 3e+0)") == RemoteCentre(pivot=(0.5, -0.1, 3.0))
    assert get_formulation("joint-space+elbow-hold(correct=1,angle=1e+0)").constraints[0] == ElbowHold(  # type: ignore[attr-defined]  # it is Constrained
        correct=True, angle=1.0
    )


def test_every_registered_constraint_can_be_attached_by_name() -> None:
    assert available_constraints() == (
        "contact-force",
        "elbow-bend",
        "elbow-hold",
        "elbow-range",
        "obstacles",
        "remote-centre",
        "self-collision",
        "singularity",
        "twist-limits",
    )
    step = make_step(arm("lbr_med14"), " + ".join(("joint-space", *available_constraints())), "position")
    assert step(Q, [0.1, 0.0, 0.0], remote_centre_pivot=[0.5, 0.0, 0.3]).status is Status.SOLVED


def test_without_constraints_nothing_changes() -> None:
    robot, mode = arm("lbr_med14"), Mode.fix_orientation()
    bare, none = lower(JointSpace(), robot, mode), lower(with_constraints("joint-space", []), robot, mode)
    assert bare.rows == none.rows
    assert [i.name for i in bare.inputs] == [i.name for i in none.inputs]
    arguments = [Q, np.array([0.1, 0.0, -0.2]), *(i.default for i in bare.inputs[2:])]
    for a, b in zip(bare.function.call(arguments), none.function.call(arguments), strict=True):
        np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


def test_names_reach_rows_variables_and_parameters() -> None:
    fast, slow = TwistLimits(name="approach speed"), TwistLimits(name="tool", frame="tool")
    lowered = lower(with_constraints("joint-space", [fast, slow, SelfCollision()]), arm("lbr_med14"), Mode.free())
    assert [n for n in lowered.rows.inequalities if n.startswith("approach")] == [
        f"approach speed[{i}]" for i in range(6)
    ]
    assert "self-collision[6]" in lowered.rows.inequalities
    assert "self-collision share[0]" in lowered.rows.box
    names = {given.name for given in lowered.inputs}
    assert {"approach_speed_linear", "tool_angular", "self_collision_margin", "self_collision_priority"} <= names


def test_a_constraint_of_ones_own() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Slow(Constraint):
        kind: ClassVar[str] = "slow"

        def add(self, qp: QuadraticProgram, tick: Tick) -> None:
            most = self.parameter(tick, "most", 0.1, unit="rad/s", positive=True)
            qp.between(-most, self.command_of(qp)[0], most, name=self.name)

    step = make_step(arm("lbr_med14"), with_constraints("joint-space", [Slow()]), "position")
    assert abs(step(Q, [0.0, 0.3, 0.0]).qd[0]) == pytest.approx(0.1, abs=1e-8)
    assert abs(step(Q, [0.0, 0.3, 0.0], slow_most=0.2).qd[0]) == pytest.approx(0.2, abs=1e-8)


def test_capsules_of_ones_own() -> None:
    """A tool on the flange joins the ready-made model: every pair of links two apart, or the pairs named."""
    robot = arm("lbr_med14")
    tool = Capsule("drill", 7, (0.0, 0.0, 0.045), (0.0, 0.0, 0.25), 0.03)
    post = Capsule("post", 0, (0.5, 0.0, 0.0), (0.5, 0.0, 0.5), 0.05)
    bent = Capsule("upper arm", 2, (0.0, 0.0, 0.0), (0.0, 0.4, 0.0), 0.1)
    every = SelfCollision(capsules=(tool, post, bent))
    assert [(a.name, b.name) for a, b in every.checked_pairs(robot)] == [
        ("post", "drill"),
        ("upper arm", "drill"),
        ("post", "upper arm"),
    ]
    named = SelfCollision(capsules=(tool, post, bent), pairs=(("drill", "post"),))
    assert [(a.name, b.name) for a, b in named.checked_pairs(robot)] == [("post", "drill")]
    assert make_step(robot, with_constraints("joint-space", [every]), "free")(Q, np.zeros(6)).status is Status.SOLVED


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: get_formulation("joint-space + nothing"), PluginError, "constraint 'nothing' does not exist"),
        (lambda: get_formulation("nothing + twist-limits"), PluginError, "formulation 'nothing' does not exist"),
        (lambda: get_constraint(TwistLimits(), frame="tool"), PluginError, "expected no options with an instance"),
        (
            lambda: with_constraints("joint-space", ["twist-limits"] * 2),
            ValueError,
            "got twist-limits twice",
        ),
        (lambda: TwistLimits(frame="base"), ValueError, "frame: expected one of world, tool, mode, got 'base'"),
        (lambda: TwistLimits(name="[1]"), ValueError, r"expected letters, digits, spaces and hyphens, got '\[1\]'"),
        (
            lambda: SelfCollision(approach="hard"),
            ValueError,
            "expected one of viable, damper, step, got 'hard'",
        ),
        (lambda: SelfCollision(retreat="perhaps"), ValueError, "retreat must be true or false, but is 'perhaps'"),  # type: ignore[arg-type]  # that is the point
        (
            lambda: SingularityAvoidance(rows="some"),
            ValueError,
            "expected one of all, position, guided, got 'some'",
        ),
        (lambda: RemoteCentre(pivot="here"), ValueError, "pivot: expected three numbers as in '0.5 0 0.3', got 'here'"),
        (lambda: RemoteCentre(pivot="1 2"), ValueError, "pivot: expected 3 numbers"),
        (lambda: ElbowHold(angle=1.0), ValueError, "angle: expected a finite number, and correct=true, got 1.0"),
        (lambda: Obstacles(spheres=0), ValueError, "expected one obstacle or more"),
        (lambda: Obstacles(spheres=-1), ValueError, "spheres: expected a number of 0 or more, got -1"),
        (lambda: Obstacle("a ball"), ValueError, "expected a name of letters, digits and underscores, got 'a ball'"),
        (lambda: Obstacle("ball", radius=-1.0), ValueError, "expected a radius of 0 or more, got -1.0"),
        (lambda: Obstacle("ball", (0.0, np.nan, 0.0)), ValueError, "expected start as 3 finite numbers"),
        (
            lambda: SelfCollision(pairs=(("hand", "foot"),)).checked_pairs(arm("lbr_med14")),
            RobotError,
            "pairs: expected capsules among base, .*, got 'foot'",
        ),
        (
            lambda: SelfCollision(pairs=(("hand", "hand"),)).checked_pairs(arm("lbr_med14")),
            RobotError,
            "expected capsules of two links, got 'hand' and 'hand'",
        ),
        (lambda: SelfCollision().checked_pairs(arm("davinci5")), RobotError, "give your own capsules"),
        (
            lambda: SelfCollision(capsules=(Capsule("a", 1, (0, 0, 0), (0, 0, 0), 1),) * 2),
            RobotError,
            "capsules: expected different names, got a, a",
        ),
    ],
)
def test_mistakes_are_named(make: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_a_formulation_without_a_command_is_named() -> None:
    qp = QuadraticProgram()
    qp.variable("qd", 7)
    with pytest.raises(DeclarationError, match="twist-limits: expected a formulation that has declared its command"):
        TwistLimits().add(qp, Tick(arm("lbr_med14"), Mode.free()))


def test_bounds_and_safe_stop_are_those_of_what_is_constrained() -> None:
    made = with_constraints("joint-space-acceleration(bounds=thesis)", [TwistLimits()])
    assert (made.bounds, made.safe_stop) == ("thesis", "braking")
    assert with_constraints("joint-space", [TwistLimits()]).safe_stop == "zero"
    moving = np.full(7, 0.2)
    step = make_step(arm("lbr_med14"), made, "fix-orientation", "piqp", max_iterations=1)
    stopped = step(np.full(7, 0.3), [0.1, 0.0, 0.0], qd_prev=moving)
    assert stopped.status is not Status.SOLVED
    # Braking takes more than one tick: 10 rad/s^2 over 1 ms is 0.01 rad/s.
    np.testing.assert_allclose(stopped.qd, 0.19, atol=1e-9)
