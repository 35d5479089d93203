"""A sweep's configuration: every mistake is one sentence that names the line, the key and the choices."""

from pathlib import Path

import pytest

from kinqp.baselines import available_baselines
from kinqp.benchmarks import Cell, ConfigError, SweepConfig, available_scenarios, cells_of, load_config, make_config
from kinqp.formulations import available_formulations
from kinqp.solvers import available_solvers


def test_default_is_the_thesis_experiment() -> None:
    config = load_config()
    assert config.scenarios == ("semicircle",)
    assert config.formulations == ("cartesian-error", "joint-space")
    assert config.solvers == ("active-set", "thesis-active-set", "clarabel", "piqp")
    assert config.repeats >= 20
    assert len(cells_of(config)) == 8


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text('solvers = ["piqp"]\nrepeats = 2\n')
    assert load_config(path) == SweepConfig(solvers=("piqp",), repeats=2)


def test_all_means_all_there_are() -> None:
    config = make_config({"scenarios": ["all"], "formulations": ["all"], "solvers": ["all", "piqp(tolerance=1e-8)"]})
    assert config.scenarios == available_scenarios()
    assert config.formulations == available_formulations()
    assert config.solvers == (*available_solvers(bridges=True), "piqp(tolerance=1e-8)")


def test_a_baseline_is_a_cell_without_solver_and_start() -> None:
    config = make_config({"baselines": ["all", "task-priority(limits=none)"], "formulations": [], "starts": ["cold"]})
    assert config.baselines == (*available_baselines(), "task-priority(limits=none)")
    assert cells_of(config) == tuple(Cell("semicircle", name, "-", "-") for name in config.baselines)
    assert all(cell.is_baseline and cell.block.baseline for cell in cells_of(config))
    both = cells_of(make_config({"baselines": ["task-priority"], "formulations": ["damped"], "solvers": ["piqp"]}))
    assert [cell.is_baseline for cell in both] == [False, True]
    assert str(both[-1]) == "semicircle / task-priority"
    # A formulation of somebody's may have the same name.
    named_alike = Cell("a", "task-priority", "piqp")
    assert Cell.of_baseline("a", "task-priority").block.file_stem != named_alike.block.file_stem


def test_starts_are_those_that_a_solver_has() -> None:
    config = make_config(
        {"formulations": ["damped"], "solvers": ["active-set", "piqp"], "starts": ["cold", "active-set", "solution"]}
    )
    assert cells_of(config) == (
        Cell("semicircle", "damped", "active-set"),
        Cell("semicircle", "damped", "active-set", "active-set"),
        Cell("semicircle", "damped", "piqp"),
    )
    assert config.skipped()["piqp from last solution"] == "piqp starts cold only"


def test_further_products_add_cells_to_their_blocks_once() -> None:
    more = [{"formulations": ["damped", "joint-space"], "solvers": ["piqp", "clarabel"]}]
    cells = cells_of(make_config({"formulations": ["damped"], "solvers": ["piqp"], "more": more}))
    assert [(cell.formulation, cell.solver) for cell in cells] == [
        ("damped", "piqp"), ("damped", "clarabel"), ("joint-space", "piqp"), ("joint-space", "clarabel"),
    ]  # fmt: skip


def test_what_is_not_installed_is_left_out_if_so_wanted() -> None:
    names = {"solvers": ["piqp", "qpsolvers:gurobi"]}
    with pytest.raises(ConfigError, match=r"solvers: .*no solver 'gurobi' installed"):
        make_config(names)
    config = make_config(names | {"skip_missing": True})
    assert {cell.solver for cell in cells_of(config)} == {"piqp"}
    assert "no solver 'gurobi' installed" in config.skipped()["qpsolvers:gurobi"]
    with pytest.raises(ConfigError, match="'tolerence' does not exist"):
        make_config({"solvers": ["piqp(tolerence=1)"], "skip_missing": True})


def test_the_shipped_sweep_is_found_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    config = load_config(Path("configs/full.toml"))
    assert config.formulations == available_formulations()
    assert config.repeats >= 20
    assert set(available_solvers()) <= set(config.solvers)
    with pytest.raises(ConfigError, match="expected a readable TOML file"):
        load_config(Path("configs/fuller.toml"))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"solver": ["piqp"]}, r"expected keys among .*scenarios, baselines, formulations, solvers, .*got 'solver'"),
        ({"solvers": ["clarable"]}, "solvers: solver 'clarable' does not exist.*did you mean 'clarabel'"),
        ({"solvers": ["clarabel(tolerence=1)"]}, "'tolerence' does not exist.*did you mean 'tolerance'"),
        ({"formulations": ["joint_space"]}, "formulation 'joint_space' does not exist.*did you mean 'joint-space'"),
        ({"formulations": ["cartesian-error(bounds=loose)"]}, "bounds: expected one of thesis, viable, got 'loose'"),
        ({"baselines": ["task_priority"]}, "baselines: baseline 'task_priority' does not exist.*did you mean 'task-p"),
        ({"baselines": ["task-priority(limit=none)"]}, "baselines: .*'limit' does not exist.*did you mean 'limits'"),
        ({"formulations": []}, "formulations: expected at least one of .*, or 'all', got an empty list and no basel"),
        ({"scenarios": ["circle"]}, "scenario 'circle' does not exist"),
        ({"solvers": []}, "solvers: expected at least one of active-set, .*, or 'all', got an empty list"),
        ({"starts": []}, "starts: expected at least one of cold, active-set, solution, got an empty list"),
        ({"starts": ["hot"]}, "starts: expected starts among cold, active-set, solution, got 'hot'"),
        ({"solvers": ["piqp"], "starts": ["solution"]}, r"starts: expected starts .*piqp: cold.*not one cell is left"),
        ({"solvers": ["piqp", "piqp"]}, "expected each name once, got twice: piqp"),
        ({"repeats": 0}, "repeats: .*greater than or equal to 1"),
        ({"timing_budget": 0.0}, "timing_budget: .*greater than 0"),
        ({"repeats": "many"}, "repeats: .*integer"),
        ({"more": [{"solvers": ["clarable"]}]}, "more.0.solvers: solver 'clarable' does not exist"),
        ({"more": [{"repeats": 3}]}, "expected keys among skip_missing, scenarios, .*got 'more.0.repeats'"),
    ],
)
def test_mistakes_are_named(given: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_config(given, "sweep.toml")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('# a sweep\nsolvers = [\n  "piqp",\n  "clarable",  # and "piqp"\n]\n', 4),
        ('repeats = 3\n\nsolver = ["piqp"]\n', 3),
        ("seed = 1\nrepeats = 0\n", 2),
        ('solvers = ["piqp"]\nformulations = []\n', 2),
        ('solvers = ["piqp"]\n\nstarts = ["solution"]\n', 3),
        ('solvers = ["piqp"]\n[[more]]\nsolvers = ["clarabel"]\n[[more]]\nseed = 3\nsolvers = ["clarabel"]\n', 5),
        ('solvers = ["piqp"]\n[[more]]\nsolvers = ["clarabel"]\n[[more]]\n\nsolvers = ["x"]\n', 6),
        ('[[more]]\nsolvers = ["piqp"]\nstart = ["cold"]\n', 3),
    ],
)
def test_mistakes_are_found_on_their_line(tmp_path: Path, text: str, line: int) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=rf"sweep\.toml, line {line}: "):
        load_config(path)


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("solvers = [")
    for path in (broken, tmp_path / "missing.toml", tmp_path):
        with pytest.raises(ConfigError, match=r"expected a readable TOML file"):
            load_config(path)
