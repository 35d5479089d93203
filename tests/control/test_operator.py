import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinqp.control import CHARACTERS, EXPERT, NOVICE, Operator, SemicirclePath, make_guiding, simulate_guiding
from kinqp.control.reference import normal_of
from kinqp.control.steering import Doing
from kinqp.robots import load_robot
from tests.control.tools import DT, free, freezing, frozen, guide, sliding

# The middle of the path is 0.30 m up.
PATH = SemicirclePath(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.30)
# Low enough that the path leads 3 cm through it.
LIMIT = 0.27
# Down is where it yields.
DOWN = (0.0, 0.0, -1.0)
BOTH = pytest.mark.parametrize("character", list(CHARACTERS.values()), ids=list(CHARACTERS))


class Line:
    """A straight path along x."""

    length = 0.5

    def point(self, s):
        return np.array([s, 0.0, 0.0])

    def tangent(self, s):  # noqa: ARG002  # straight
        return np.array([1.0, 0.0, 0.0])


def forces(run):
    return np.linalg.norm(run["wrench"][:, :3], axis=1)


@BOTH
def test_a_free_tool_is_led_to_the_end_of_the_path(character):
    run = guide(Operator(PATH, character, seed=1), PATH.start, free, 15.0)
    assert np.linalg.norm(run["position"][-1] - PATH.point(PATH.length)) < 0.02
    # About as fast as he likes to, start and end included, and close to the path.
    assert 1.0 < run["t"][-1] / (PATH.length / character.speed) < 1.3
    off = np.hypot(np.linalg.norm(run["position"] - np.array([0.0, 0.3, 0.0]), axis=1) - 0.30, run["position"][:, 0])
    assert off.max() < 0.02
    assert set(run["doing"]) == {Doing.FOLLOWING}


@BOTH
def test_a_frozen_tool_is_pushed_up_to_the_ceiling_and_no_more(character):
    run = guide(Operator(PATH, character, seed=1), PATH.start, frozen, 6.0)
    assert forces(run).max() == pytest.approx(character.ceiling, rel=1e-9)
    assert forces(run).max() <= character.ceiling * (1.0 + 1e-12)


@BOTH
def test_the_hand_waits_for_a_frozen_tool(character):
    """Until he loses patience the aim stays as far ahead as the lead, and what is added in a reaction time."""
    run = guide(Operator(PATH, character, seed=1), PATH.start, frozen, 6.0)
    before = run["doing"] != Doing.BACKING_OFF
    ahead = np.linalg.norm(run["aim"] - run["position"], axis=1)
    assert ahead[before].max() < character.lead + character.speed * character.reaction_time
    assert run["progress"].max() == 0.0


@BOTH
def test_the_hand_waits_for_a_slow_tool(character):
    """In oil four times as thick the aim does not run away, and the tool arrives all the same."""
    operator = Operator(PATH, character, seed=1)
    run = guide(operator, PATH.start, lambda _x, v: 0.25 * v, 60.0)
    assert operator.finished(run["t"][-1])
    ahead = np.linalg.norm(run["aim"] - run["position"], axis=1)
    assert ahead.max() < character.lead + character.speed * character.reaction_time
    assert run["t"][-1] > 1.5 * PATH.length / character.speed


@BOTH
def test_along_a_limit_the_hand_slides_to_the_end(character):
    operator = Operator(PATH, character, seed=1, stance=DOWN)
    run = guide(operator, PATH.start, sliding(LIMIT), 20.0)
    assert operator.finished(run["t"][-1])
    assert operator.stops == 0
    assert (run["position"][:, 2] > LIMIT - 1e-9).sum() * DT > 0.5
    assert run["t"][-1] < 1.3 * PATH.length / character.speed


@BOTH
def test_kept_from_the_path_the_hand_presses_as_much_as_it_means_to(character):
    """Five centimetres below a straight path the spring alone would pull with 12.5 N and 20 N."""
    run = guide(Operator(Line(), character, seed=1, tremor=False), [0.0, 0.0, -0.05], sliding(-0.05), 2.2)
    assert run["wrench"][:200, 2].max() == pytest.approx(0.05 * character.stiffness, rel=0.05)
    assert run["wrench"][-1, 2] == pytest.approx(character.press, rel=0.02)


@BOTH
def test_where_all_stops_the_hand_pushes_backs_off_and_goes_around(character):
    operator = Operator(PATH, character, seed=1, stance=DOWN)
    run = guide(operator, PATH.start, freezing(LIMIT), 60.0)
    assert operator.finished(run["t"][-1])
    doing = [run["doing"][0]]
    for now in run["doing"][1:]:
        if now is not doing[-1]:
            doing.append(now)
    assert operator.stops >= 1
    assert doing[:4] == [Doing.FOLLOWING, Doing.PUSHING, Doing.BACKING_OFF, Doing.FOLLOWING]
    pushing = (run["doing"] == Doing.PUSHING).sum() * DT
    assert pushing >= 0.9 * character.patience


def test_a_novice_loses_more_time_at_stops():
    """As the thesis has it of algorithm B (5.3.2): experts wave around the limit, novices force it."""
    standing = {}
    for name, character in CHARACTERS.items():
        run = guide(Operator(PATH, character, seed=1, stance=DOWN), PATH.start, freezing(LIMIT), 60.0)
        still = np.linalg.norm(run["velocity"], axis=1) < 1e-3
        standing[name] = (still & (forces(run) > 3.0)).sum() * DT
    assert standing["novice"] > 2.0 * standing["expert"] > 0.0


def test_who_does_not_know_the_side_tries_others():
    """Without a stance the order of sides is drawn; whatever it is, the tool gets around in the end."""
    firsts = set()
    for seed in range(4):
        operator = Operator(PATH, EXPERT, seed=seed)
        run = guide(operator, PATH.start, freezing(LIMIT), 60.0)
        assert operator.finished(run["t"][-1])
        back = np.flatnonzero(run["doing"] == Doing.BACKING_OFF)
        went = run["aim"][back[np.flatnonzero(np.diff(back, append=-1) != 1)[0]]] - run["position"][back[0]]
        firsts.add(tuple(np.round(went, 2)))
    assert len(firsts) > 1


@BOTH
def test_the_same_seed_is_the_same_person(character):
    persons = [Operator(PATH, character, seed=seed, stance=DOWN) for seed in (1, 1, 2)]
    runs = [guide(person, PATH.start, freezing(LIMIT), 3.5) for person in persons]
    np.testing.assert_array_equal(runs[0]["wrench"], runs[1]["wrench"])
    assert np.abs(runs[0]["wrench"][:1000] - runs[2]["wrench"][:1000]).max() > 0.01


def test_reset_begins_again():
    operator = Operator(PATH, NOVICE, seed=3, stance=DOWN)
    first = guide(operator, PATH.start, freezing(LIMIT), 4.0)
    again = guide(operator, PATH.start, freezing(LIMIT), 4.0)
    np.testing.assert_array_equal(first["wrench"], again["wrench"])


def test_without_tremor_the_seed_does_not_matter_until_a_side_is_drawn():
    runs = [guide(Operator(PATH, EXPERT, seed=s, tremor=False), PATH.start, free, 2.0) for s in (1, 2)]
    np.testing.assert_array_equal(runs[0]["wrench"], runs[1]["wrench"])


def test_half_the_control_period_is_nearly_the_same_motion():
    operator = Operator(PATH, EXPERT, seed=1, tremor=False)
    coarse = guide(operator, PATH.start, free, 3.0)
    fine = guide(operator, PATH.start, free, 3.0, dt=0.5 * DT)
    np.testing.assert_allclose(fine["position"][::2][:2999], coarse["position"][:2999], atol=2e-3)


def test_a_straight_path_is_followed_too():
    operator = Operator(Line(), EXPERT, seed=1)
    run = guide(operator, [0.0, 0.0, 0.0], free, 10.0)
    assert operator.finished(run["t"][-1])
    # Sideways there is nothing but tremor.
    assert np.abs(run["wrench"][:, 1:3]).max() < 2.0


def test_the_sides_of_a_path_are_perpendicular_to_it():
    for path in (PATH, Line()):
        for s in np.linspace(0.0, path.length, 7):
            normal = normal_of(path, s)
            assert np.linalg.norm(normal) == pytest.approx(1.0)
            assert normal @ path.tangent(s) == pytest.approx(0.0, abs=1e-9)
    # Towards the inside of the curve: the centre is at y = 0.30.
    np.testing.assert_allclose(normal_of(PATH, 0.5 * PATH.length), [0.0, 0.0, -1.0], atol=1e-6)


def test_the_hand_holds_the_orientation_it_began_with():
    operator = Operator(PATH, EXPERT, tremor=False)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.3, 0.0, 0.0]).as_matrix()
    np.testing.assert_allclose(operator.wrench(0.0, pose, np.zeros(6))[3:], 0.0, atol=1e-12)
    turned = pose.copy()
    turned[:3, :3] = Rotation.from_rotvec([0.0, 0.2, 0.0]).as_matrix() @ pose[:3, :3]
    torque = operator.wrench(0.001, turned, np.array([0.0, 0.0, 0.0, 0.0, 0.5, 0.0]))[3:]
    np.testing.assert_allclose(torque, [0.0, -EXPERT.rotational_stiffness * 0.2 - 0.2 * 0.5, 0.0], atol=1e-9)


def test_it_guides_a_robot():
    robot = load_robot("lbr_med14")
    q0 = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
    start = robot.pose(q0)[:3, 3]
    path = SemicirclePath(start, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.30)
    controller = make_guiding(robot, "cartesian-error", ["fix-orientation"])
    run = simulate_guiding(controller, Operator(path, EXPERT, seed=1), q0, 1.0)
    moved = run.position[-1] - start
    assert 0.10 < np.linalg.norm(moved) < 0.20
    assert np.linalg.norm(run.wrench[:, :3], axis=1).max() < EXPERT.ceiling
    assert (run.power()[200:] > 0.0).all()


@pytest.mark.parametrize(
    ("arguments", "match"),
    [({"stance": [0.0, 0.0, 0.0]}, "stance"), ({"stance": [1.0]}, "stance"), ({"tolerance": 0.0}, "tolerance")],
)
def test_an_impossible_operator_is_refused(arguments, match):
    with pytest.raises(ValueError, match=match):
        Operator(PATH, **arguments)


def test_time_does_not_go_back():
    operator = Operator(PATH)
    operator.wrench(1.0, np.eye(4), np.zeros(6))
    with pytest.raises(ValueError, match="reset"):
        operator.wrench(0.5, np.eye(4), np.zeros(6))
    operator.reset()
    operator.wrench(0.5, np.eye(4), np.zeros(6))
