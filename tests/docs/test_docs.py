"""What the documents say is what the code does."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from kinqp.benchmarks import ConfigError, load_config, make_config
from kinqp.formulations import DEFAULT_JOINT_WEIGHT
from kinqp.formulations.joint_space_robust import ROBUST_JOINT_WEIGHT

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_readme_example_runs_and_prints_what_it_says() -> None:
    example = blocks("python")[0]
    assert sum(bool(line.strip()) for line in example.splitlines()) <= 15
    done = run(example)
    promised = re.search(r"# (solved .*)", example)
    assert promised is not None
    assert done.stdout.splitlines()[0] == promised[1]


def test_other_python_in_the_readme_runs() -> None:
    for example in blocks("python")[1:]:
        assert run(example).stdout.startswith("solved ")


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda page: page.name)
def test_python_in_the_docs_runs(page: Path, tmp_path: Path) -> None:
    for example in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        run(example, tmp_path)


def run(example: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", example],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_readme_sweep_is_a_valid_configuration(tmp_path: Path) -> None:
    (text,) = blocks("toml")
    path = tmp_path / "my_sweep.toml"
    path.write_text(text)
    assert load_config(path).starts == ("cold", "active-set")
    page = (ROOT / "docs" / "sweep.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    path.write_text(text)
    assert load_config(path).samples == 200
    with pytest.raises(ConfigError):
        make_config({"formulation": []})


def test_readme_commands_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^make ([\w-]+)", "\n".join(blocks("sh")), flags=re.MULTILINE)
    assert {"bench", "test"} <= set(targets)
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_readme_table_has_the_shipped_cells() -> None:
    (table,) = blocks("text")
    config = load_config()
    for name in (*config.formulations, *config.solvers, *config.scenarios):
        assert name in table, name


def test_modes_are_drawn_as_they_are() -> None:
    document = runpy.run_path(str(ROOT / "docs" / "make_modes.py"))["document"]
    assert (ROOT / "docs" / "modes.md").read_text(encoding="utf-8") == document(), "run: python docs/make_modes.py"


def test_joint_weight_page_argues_for_the_default() -> None:
    page = (ROOT / "docs" / "joint-weight.md").read_text(encoding="utf-8")
    assert f"The default is {DEFAULT_JOINT_WEIGHT:.0e}".replace("e-04", "e-4") in page


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md"])
def test_links_lead_somewhere(page: Path) -> None:
    targets = [
        target for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")) if "://" not in target
    ]
    for target in targets:
        assert "://" in target or (page.parent / target).exists(), target


def test_singularities_page_argues_for_the_defaults() -> None:
    page = (ROOT / "docs" / "singularities.md").read_text(encoding="utf-8")
    assert f"The joint weight** is {ROBUST_JOINT_WEIGHT:.0e}".replace("e-03", "e-3") in page
    paths = page.partition("## Random paths")[0]
    calm = [line.split("|") for line in paths.splitlines() if "| as it is | joint-space-robust |" in line]
    assert len(calm) == 13
    for row in calm:
        assert float(row[6]) <= 1.0, row
        assert float(row[7]) == 0.0, row
        assert float(row[9]) <= 1e-9, row
