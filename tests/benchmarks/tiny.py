"""A scenario of a few ticks, for tests of the machinery around it."""

from dataclasses import replace

from kinqp.benchmarks import Scenario, get_scenario


def tiny() -> Scenario:
    return replace(get_scenario("semicircle"), name="tiny", duration=0.02)
