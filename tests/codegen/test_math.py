"""The elementary functions of the generated code against extended precision."""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kinqp.codegen.render import math_header
from tests.codegen.test_emit import load

Array = NDArray[np.float64]
NEEDS_EXTENDED = pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 1e-18, reason="long double is no wider than double here"
)


@functools.cache
def functions() -> tuple[Callable[[Array], tuple[Array, Array]], Callable[[float], float]]:
    text = """
void sincos_of(int n, const double *x, double *sine, double *cosine);
void sincos_of(int n, const double *x, double *sine, double *cosine) { kinqp_sincos(n, x, sine, cosine); }
double floor_of(double x);
double floor_of(double x) { return kinqp_floor(x); }
"""
    prototypes = "void sincos_of(int n, const double *x, double *sine, double *cosine); double floor_of(double x);"
    library, ffi = load("elementary", math_header() + text, prototypes)

    def pointer(values: Array) -> Any:
        return ffi.cast("double *", ffi.from_buffer(values))

    def sincos(x: Array) -> tuple[Array, Array]:
        sine, cosine = np.empty_like(x), np.empty_like(x)
        library.sincos_of(x.size, pointer(x), pointer(sine), pointer(cosine))
        return sine, cosine

    return sincos, library.floor_of


def angles() -> Array:
    rng = np.random.default_rng(0)
    quarters = np.arange(-636, 637) * (math.pi / 2)
    return np.concatenate(
        [
            rng.uniform(-1000.0, 1000.0, 100_000),
            rng.uniform(-7.0, 7.0, 100_000),
            # Where a value is nothing but what reduction leaves, and where the quadrant changes.
            *(np.nextafter(quarters, side) for side in (-np.inf, np.inf)),
            quarters,
            quarters + math.pi / 4,
            quarters + 1e-9,
            [0.0, -0.0, 5e-324, 1e-300, 1e-9, -1e-8, 1000.0, -1000.0],
        ]
    )


@NEEDS_EXTENDED
def test_sines_and_cosines_are_right_to_the_last_place_or_two() -> None:
    x = angles()
    x = x[np.abs(x) <= 1000.0]
    for got, wanted in zip(
        functions()[0](x), (np.sin(x.astype(np.longdouble)), np.cos(x.astype(np.longdouble))), strict=True
    ):
        error = np.abs(got - wanted)
        assert error.max() <= 3e-16
        assert (error / np.spacing(np.abs(got))).max() <= 2.0


def test_one_far_angle_sends_all_to_the_c_library() -> None:
    x = np.array([0.1, 1000.1, -1e6, 1e22, 1e300, -3.0])
    sine, cosine = functions()[0](x)
    np.testing.assert_allclose(sine, [math.sin(angle) for angle in x], rtol=0, atol=3e-16)
    np.testing.assert_allclose(cosine, [math.cos(angle) for angle in x], rtol=0, atol=3e-16)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_angles_that_are_none_give_nan_there_only(bad: float) -> None:
    sine, cosine = functions()[0](np.array([0.5, bad, -2.0]))
    assert np.isnan(sine).tolist() == np.isnan(cosine).tolist() == [False, True, False]
    np.testing.assert_allclose(sine[[0, 2]], np.sin([0.5, -2.0]), rtol=0, atol=3e-16)


def test_how_many_angles_are_taken_at_once_does_not_matter() -> None:
    sincos = functions()[0]
    x = np.random.default_rng(1).uniform(-10.0, 10.0, 64)
    together = sincos(x)
    for i, angle in enumerate(x):
        for one, all_ in zip(sincos(np.array([angle])), together, strict=True):
            assert one[0] == all_[i]


def test_floor() -> None:
    floor = functions()[1]
    rng = np.random.default_rng(2)
    exponents = rng.uniform(-5, 18, 5000)
    values = [*(rng.choice([-1.0, 1.0], 5000) * 10.0**exponents), 0.0, -0.0, 0.5, -0.5, -1.0, 2.0**52, -(2.0**52)]
    values += [2.0**52 - 0.5, -(2.0**52) + 0.5, 1e300, -1e300, 5e-324, -5e-324, *map(float, range(-9, 10))]
    assert all(floor(float(value)) == np.floor(value) for value in values)
    assert floor(math.inf) == math.inf
    assert floor(-math.inf) == -math.inf
    assert math.isnan(floor(math.nan))
