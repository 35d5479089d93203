"""A sweep's configuration: every mistake is one sentence that names the key and the choices."""

from pathlib import Path

import pytest

from kinqp.benchmarks import ConfigError, SweepConfig, load_config, make_config


def test_default_is_the_thesis_experiment() -> None:
    config = load_config()
    assert config.scenarios == ("semicircle",)
    assert config.formulations == ("cartesian-error", "joint-space")
    assert config.solvers == ("active-set", "thesis-active-set", "clarabel", "piqp")


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text('solvers = ["piqp"]\nrepeats = 2\n')
    assert load_config(path) == SweepConfig(solvers=("piqp",), repeats=2)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"solver": ["piqp"]}, r"expected keys among scenarios, formulations, solvers, .*got 'solver'"),
        ({"solvers": ["clarable"]}, "solvers: solver 'clarable' does not exist.*did you mean 'clarabel'"),
        ({"solvers": ["clarabel(tolerence=1)"]}, "'tolerence' does not exist.*did you mean 'tolerance'"),
        ({"formulations": ["joint_space"]}, "formulation 'joint_space' does not exist.*did you mean 'joint-space'"),
        ({"formulations": ["cartesian-error(bounds=loose)"]}, "bounds: expected one of thesis, viable, got 'loose'"),
        ({"scenarios": ["circle"]}, "scenario 'circle' does not exist"),
        ({"solvers": []}, "solvers: .*at least 1 item"),
        ({"solvers": ["piqp", "piqp"]}, "expected each name once, got twice: piqp"),
        ({"repeats": 0}, "repeats: .*greater than or equal to 1"),
        ({"warm_up": -1}, "warm_up: .*greater than or equal to 0"),
        ({"repeats": "many"}, "repeats: .*integer"),
    ],
)
def test_mistakes_are_named(given: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_config(given, "sweep.toml")


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("solvers = [")
    for path in (broken, tmp_path / "missing.toml", tmp_path):
        with pytest.raises(ConfigError, match=r"expected a readable TOML file"):
            load_config(path)
