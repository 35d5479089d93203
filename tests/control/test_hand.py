import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinqp.control import CHARACTERS, EXPERT, NOVICE, Character, Push
from kinqp.control.hand import SpringHand, limited, rotation_vector
from kinqp.control.tremor import BAND, Tremor

RATE = 1000.0
vectors = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)
characters = st.sampled_from(list(CHARACTERS.values()))


def spectrum(signal):
    """Power per bin of a real signal, and frequencies [Hz]; a window keeps leakage below 1e-6."""
    window = np.blackman(len(signal))
    power = np.abs(np.fft.rfft(signal * window)) ** 2
    return np.fft.rfftfreq(len(signal), 1.0 / RATE), power


def share_within(signal, low, high):
    frequency, power = spectrum(signal - signal.mean())
    return power[(frequency >= low) & (frequency <= high)].sum() / power.sum()


def sampled(function, duration):
    return np.array([function(t) for t in np.arange(0.0, duration, 1.0 / RATE)])


def test_tremor_has_its_power_between_8_and_12_hz():
    noise = sampled(Tremor(3), 30.0)
    for axis in noise.T:
        assert share_within(axis, BAND[0] - 0.1, BAND[1] + 0.1) > 0.9999
        # And all over the band, not at one line.
        assert all(0.05 < share_within(axis, low, low + 1.0) < 0.6 for low in (8.0, 9.0, 10.0, 11.0))


def test_tremor_is_of_unit_rms_and_independent_from_axis_to_axis():
    noise = sampled(Tremor(3), 60.0)
    np.testing.assert_allclose(np.sqrt((noise**2).mean(axis=0)), 1.0, rtol=0.05)
    correlation = np.corrcoef(noise.T) - np.eye(6)
    assert np.abs(correlation).max() < 0.15


def test_the_same_seed_is_the_same_tremor():
    np.testing.assert_array_equal(Tremor((1, 2))(0.37), Tremor((1, 2))(0.37))
    assert np.abs(Tremor((1, 2))(0.37) - Tremor((1, 3))(0.37)).max() > 1e-3


@pytest.mark.parametrize("band", [(0.0, 12.0), (12.0, 8.0), (8.0, np.inf)])
def test_what_is_no_band_is_refused(band):
    with pytest.raises(ValueError, match="band"):
        Tremor(0, band=band)


def test_the_force_is_that_of_a_spring_and_a_damper():
    hand = SpringHand(EXPERT, None)
    force = hand.force(0.0, np.array([0.02, 0.0, -0.01]), np.array([0.0, 0.1, 0.0]))
    np.testing.assert_allclose(force, [5.0, 2.0, -2.5])
    stiffer = hand.force(0.0, np.array([0.02, 0.0, -0.01]), np.array([0.0, 0.1, 0.0]), gain=4.0)
    np.testing.assert_allclose(stiffer, [20.0, 4.0, -10.0])


def test_the_ceiling_keeps_the_direction():
    np.testing.assert_allclose(limited(np.array([30.0, 40.0, 0.0]), 5.0), [3.0, 4.0, 0.0])
    np.testing.assert_array_equal(limited(np.array([3.0, 4.0, 0.0]), 5.0), [3.0, 4.0, 0.0])


@given(characters, vectors, vectors, st.floats(0.0, 30.0), st.floats(1.0, 3.0))
def test_no_hand_exceeds_its_ceilings(character, gap, rate, t, gain):
    hand = SpringHand(character, 5)
    assert np.linalg.norm(hand.force(t, gap, rate, gain)) <= character.ceiling * (1.0 + 1e-12)
    assert np.linalg.norm(hand.torque(3.0 * gap, 10.0 * rate)) <= character.torque_ceiling * (1.0 + 1e-12)


@given(characters, vectors, st.floats(0.0, 10.0), st.floats(1.0, 3.0))
def test_tremor_grows_with_the_force(character, gap, t, gain):
    calm, trembling = SpringHand(character, None), SpringHand(character, 5)
    force = calm.force(t, 0.02 * gap, np.zeros(3), gain)
    added = trembling.force(t, 0.02 * gap, np.zeros(3), gain) - force
    rms = character.tremor + character.tremor_share * np.linalg.norm(force)
    # Sixteen equal lines reach at most sqrt(2 x 16) times their RMS.
    assert np.abs(added).max() <= rms * np.sqrt(32.0) + 1e-9


@settings(max_examples=10, deadline=None)
@given(characters, vectors, vectors, st.floats(1.0, 3.0))
def test_a_hand_that_holds_still_takes_energy_out(character, offset, velocity, gain):
    """Kinetic energy of a mass and potential energy of the saturating spring never grow; a mass of 4 kg in no oil."""
    hand, mass, dt = SpringHand(character, None), 4.0, 1e-4
    stiffness, ceiling = gain * character.stiffness, character.ceiling

    def energy(x, v):
        distance, limit = np.linalg.norm(x), ceiling / stiffness
        stored = 0.5 * stiffness * min(distance, limit) ** 2 + ceiling * max(distance - limit, 0.0)
        return stored + 0.5 * mass * v @ v

    x, v = 0.5 * ceiling / stiffness * offset / max(np.linalg.norm(offset), 1e-9), 0.05 * velocity
    before = start = energy(x, v) + 1e-9
    for _ in range(3000):
        force = hand.force(0.0, -x, -v, gain)
        half = v + 0.5 * dt * force / mass
        x = x + dt * half
        v = half + 0.5 * dt * hand.force(0.0, -x, -half, gain) / mass
        after = energy(x, v)
        assert after <= before + 1e-6 * start
        before = after
    assert before < 0.9 * start


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.floats(0.0, np.pi))
def test_the_rotation_vector_is_scipys(axis, angle):
    size = np.linalg.norm(axis)
    vector = angle * np.array(axis) / size if size > 1e-3 else np.array([0.0, 0.0, angle])
    rotation = Rotation.from_rotvec(vector).as_matrix()
    # Back through the exponential: at half a turn either sign is right.
    np.testing.assert_allclose(Rotation.from_rotvec(rotation_vector(rotation)).as_matrix(), rotation, atol=2e-8)


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [-0.6, 0.8, 0.0]])
def test_half_a_turn_has_an_axis(axis):
    turned = rotation_vector(Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix())
    assert np.linalg.norm(turned) == pytest.approx(np.pi)
    assert abs(turned @ axis) == pytest.approx(np.pi)


def test_a_novice_pushes_harder_and_corrects_later():
    assert NOVICE.ceiling > EXPERT.ceiling
    assert NOVICE.push_gain > EXPERT.push_gain
    assert NOVICE.press > EXPERT.press
    assert NOVICE.reaction_time > EXPERT.reaction_time
    assert NOVICE.patience > EXPERT.patience


def test_persons_of_a_character_differ_by_15_percent():
    rng = np.random.default_rng(0)
    persons = [EXPERT.individual(rng) for _ in range(2000)]
    for name in ("stiffness", "ceiling", "reaction_time", "speed", "tremor"):
        logarithms = np.log([getattr(person, name) / getattr(EXPERT, name) for person in persons])
        assert logarithms.mean() == pytest.approx(0.0, abs=0.02)
        assert logarithms.std() == pytest.approx(0.15, rel=0.1)
    assert {person.name for person in persons} == {"expert"}
    assert EXPERT.individual(np.random.default_rng(4)) == EXPERT.individual(np.random.default_rng(4))


@pytest.mark.parametrize(
    ("name", "value"),
    [("stiffness", 0.0), ("ceiling", -1.0), ("push_gain", 0.9), ("knows_side", 1.1), ("damping", np.nan)],
)
def test_an_impossible_character_is_refused(name, value):
    with pytest.raises(ValueError, match=f"odd: {name}"):
        Character(name="odd", **(EXPERT.parameters() | {name: value}))


POSE, TWIST = np.eye(4), np.zeros(6)


def test_a_push_has_its_mean_wanders_slowly_and_trembles():
    push = Push([0.0, 0.0, 15.0, 0.0, 0.0, 0.5], EXPERT, seed=2)
    w = sampled(lambda t: push.wrench(t, POSE, TWIST), 60.0)[1000:]
    np.testing.assert_allclose(w.mean(axis=0), [0.0, 0.0, 15.0, 0.0, 0.0, 0.5], atol=1.0)
    frequency, power = spectrum(w[:, 2] - w[:, 2].mean())
    tremor, slow = (frequency > 7.8) & (frequency < 12.2), frequency < 0.7
    assert power[slow].sum() > 10.0 * power[tremor].sum()
    assert power[slow | tremor].sum() > 0.999 * power.sum()
    # Sideways there is nothing but tremor.
    rms = EXPERT.tremor + EXPERT.tremor_share * 15.0
    assert np.sqrt((w[:, 0] ** 2).mean()) == pytest.approx(rms, rel=0.1)
    assert share_within(w[:, 0], 7.8, 12.2) > 0.999


def test_a_push_along_the_tool_turns_with_it():
    push = Push([0.0, 0.0, 12.0, 0.3, 0.0, 0.0], seed=2, tool_axes=True, tremor=False)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    straight, turned = push.wrench(3.0, POSE, TWIST), push.wrench(3.0, pose, TWIST)
    np.testing.assert_allclose(turned, [straight[2], 0.0, 0.0, 0.0, 0.0, -straight[3]], atol=1e-12)


@given(st.floats(0.0, 60.0), st.integers(0, 50))
def test_a_push_stays_below_the_ceilings(t, seed):
    w = Push([0.0, 0.0, 24.0, 0.0, 1.9, 0.0], EXPERT, seed=seed, wander=0.9).wrench(t, POSE, TWIST)
    assert np.linalg.norm(w[:3]) <= EXPERT.ceiling + 1e-9
    assert np.linalg.norm(w[3:]) <= EXPERT.torque_ceiling + 1e-9
    assert not Push(np.zeros(6)).finished(t)


def test_a_push_begins_with_nothing_but_tremor():
    push = Push([0.0, 0.0, 20.0, 0.0, 0.0, 0.0], tremor=False)
    np.testing.assert_array_equal(push.wrench(0.0, POSE, TWIST), np.zeros(6))
    trembling = Push([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    assert 0.0 < np.abs(trembling.wrench(0.0, POSE, TWIST)).max() < 0.3


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"wrench": [1.0, 2.0]}, "wrench"),
        ({"wrench": [0.0, 0.0, 26.0, 0.0, 0.0, 0.0]}, "25 N"),
        ({"wrench": np.zeros(6), "wander": 1.0}, "wander"),
        ({"wrench": np.zeros(6), "ramp": -1.0}, "ramp"),
    ],
)
def test_an_impossible_push_is_refused(arguments, match):
    with pytest.raises(ValueError, match=match):
        Push(**arguments)
