"""Building C at run time: the cache, processes that build at once, and everything that can go wrong."""

import ctypes
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest

from kinqp.solvers.native import DEFAULT_FLAGS, CompilerError, build_library, cache_directory, compiler, declarations

SOURCES = {
    "answer.h": "int answer(void);\n",
    "answer.c": '#include "answer.h"\nint helper(void);\nint answer(void) { return helper() + 2; }\n',
    "helper.c": "int helper(void);\nint helper(void) { return 40; }\n",
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    cache = tmp_path / "cache"
    monkeypatch.setenv("KINQP_CACHE", str(cache))
    return cache


def answer(library: Path) -> int:
    return int(ctypes.CDLL(str(library)).answer())


def entries(cache: Path) -> list[str]:
    return sorted(path.name for path in cache.iterdir())


def test_compiles_all_sources_into_one_library(own_cache: Path) -> None:
    library = build_library("answer", SOURCES)
    assert library.is_absolute()
    assert library.is_relative_to(own_cache)
    assert answer(library) == 42
    assert entries(own_cache) == [library.name], "no scratch is left"


def test_the_second_time_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    library = build_library("answer", SOURCES)
    before = library.stat().st_mtime_ns
    monkeypatch.setattr("kinqp.solvers.native._compile", lambda *_: pytest.fail("compiled again"))
    assert build_library("answer", dict(reversed(SOURCES.items()))) == library
    assert library.stat().st_mtime_ns == before


def test_key_holds_everything_that_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    one = build_library("answer", SOURCES)
    others = [
        build_library("answer", SOURCES | {"helper.c": SOURCES["helper.c"].replace("40", "5")}),
        build_library("answer", SOURCES | {"answer.h": SOURCES["answer.h"] + "/* */"}),
        build_library("answer", SOURCES, flags=("-O0", *DEFAULT_FLAGS)),
    ]
    monkeypatch.setenv("KINQP_CC", f"{compiler()[0]} -DSOMETHING")
    others.append(build_library("answer", SOURCES))
    assert len({one, *others}) == 5
    assert [answer(library) for library in (one, *others)] == [42, 7, 42, 42, 42]


@pytest.mark.parametrize("damage", ["truncated", "empty", "gone", "changed", "short of a checksum"])
def test_a_broken_entry_is_built_again(own_cache: Path, damage: str) -> None:
    library = build_library("answer", SOURCES)
    good = library.read_bytes()
    if damage == "gone":
        library.unlink()
    else:
        changed = bytearray(good)
        changed[len(good) // 2] ^= 1
        library.write_bytes(
            {"truncated": good[:100], "empty": b"", "changed": changed, "short of a checksum": good[:-32]}[damage]
        )
    assert build_library("answer", SOURCES) == library
    assert library.read_bytes() == good
    assert answer(library) == 42
    assert entries(own_cache) == [library.name]


def _build_often(start: str, pipe: object) -> None:
    while not Path(start).exists():
        pass
    # Sources that no one has built yet, and every one of them by all processes at once.
    for number in range(4):
        library = build_library(
            "answer", SOURCES | {"helper.c": f"int helper(void);int helper(void){{return {number};}}"}
        )
        assert answer(library) == number + 2
    pipe.send("done")  # type: ignore[attr-defined]


def test_processes_may_build_at_once(own_cache: Path, tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    start = tmp_path / "start"
    pipes, children = [], []
    # One entry is broken from the beginning: to mend it is a race as well.
    broken = build_library("answer", SOURCES | {"helper.c": "int helper(void);int helper(void){return 0;}"})
    broken.write_bytes(b"")
    for _ in range(6):
        pipe, other = context.Pipe(duplex=False)
        child = context.Process(target=_build_often, args=(str(start), other))
        child.start()
        other.close()
        pipes.append(pipe)
        children.append(child)
    start.touch()
    for pipe, child in zip(pipes, children, strict=True):
        assert pipe.recv() == "done"
        child.join()
        assert child.exitcode == 0
    assert len(entries(own_cache)) == 4


def test_missing_compiler_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KINQP_CC", "/nonexistent/cc")
    with pytest.raises(CompilerError, match=r"'/nonexistent/cc'.*not found.*apt-get install gcc.*KINQP_CC"):
        build_library("answer", SOURCES)
    monkeypatch.delenv("KINQP_CC")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CompilerError, match=r"cc, gcc, clang.*not found.*apt-get install gcc.*KINQP_CC"):
        build_library("answer", SOURCES)


def test_solver_without_a_compiler_is_a_clear_error(tmp_path: Path) -> None:
    """In a process of its own, because a library that is loaded stays loaded."""
    code = (
        "from kinqp.solvers import available_solvers, get_solver\n"
        "assert 'active-set' in available_solvers()\n"
        "get_solver('active-set')"
    )
    environment = os.environ | {"KINQP_CC": "/nonexistent/cc", "KINQP_CACHE": str(tmp_path / "empty")}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "CompilerError" in run.stderr.splitlines()[-1]
    assert "apt-get install gcc" in run.stderr.splitlines()[-1]


def test_failing_source_shows_what_the_compiler_says(own_cache: Path) -> None:
    with pytest.raises(CompilerError, match=r"(?s)failed with code 1.*broken\.c:1.*error"):
        build_library("answer", SOURCES | {"broken.c": "int broken(void) { return nothing; }\n"})
    assert entries(own_cache) == [], "a failed build leaves nothing"


def test_what_is_no_compiler_is_found_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    idle = tmp_path / "idle"
    idle.write_text("#!/bin/sh\nexit 0\n")
    idle.chmod(0o755)
    monkeypatch.setenv("KINQP_CC", str(idle))
    with pytest.raises(CompilerError, match="failed with code 0"):
        build_library("answer", SOURCES)
    idle.write_text("not a program")
    monkeypatch.setenv("KINQP_CC", f"{idle} --again")
    with pytest.raises(CompilerError, match=r"cannot be run.*KINQP_CC"):
        build_library("answer", SOURCES)


def test_cache_that_cannot_be_written_names_the_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("KINQP_CACHE", str(tmp_path / "file" / "below"))
    with pytest.raises(CompilerError, match="set KINQP_CACHE to a writable directory"):
        build_library("answer", SOURCES)


def planted(library: Path) -> None:
    """Put another library where this one would be, with a checksum, as who can write there can."""
    other = build_library("other", {"other.c": "int answer(void); int answer(void) { return 666; }"})
    library.unlink()
    other.rename(library)


def test_a_cache_that_others_may_write_to_is_refused(own_cache: Path) -> None:
    planted(build_library("answer", SOURCES))
    for mode in (0o777, 0o1777, 0o770, 0o707):
        own_cache.chmod(mode)
        with pytest.raises(
            CompilerError, match=r"expected a folder of this user that no one else may write to, got .*KINQP_CACHE"
        ):
            build_library("answer", SOURCES)


def test_a_cache_in_a_folder_that_anyone_may_rename_is_refused(own_cache: Path) -> None:
    build_library("answer", SOURCES)
    own_cache.parent.chmod(0o777)
    with pytest.raises(
        CompilerError, match="expected to be where no one else can replace it, but everyone may write to"
    ):
        build_library("answer", SOURCES)
    own_cache.parent.chmod(0o1777)  # as /tmp: only the owner may rename what is in it
    assert answer(build_library("answer", SOURCES)) == 42


def test_a_cache_of_another_user_is_refused(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build_library("answer", SOURCES)
    if os.geteuid() == 0:
        os.chown(own_cache, 12345, -1)
    else:
        monkeypatch.setattr("os.geteuid", lambda: 12345)
    with pytest.raises(CompilerError, match=r"expected a folder of this user .* of user \d+ with mode 700"):
        build_library("answer", SOURCES)


def test_a_library_that_others_may_write_or_that_is_a_link_is_built_again(tmp_path: Path) -> None:
    library = build_library("answer", SOURCES)
    planted(library)
    assert answer(library) == 666
    library.chmod(0o775)
    assert build_library("answer", SOURCES) == library
    code = "import ctypes, sys; print(ctypes.CDLL(sys.argv[1]).answer())"
    line = [sys.executable, "-c", code, str(library)]  # this process has the other one loaded
    assert subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip() == "42"
    library.rename(tmp_path / "elsewhere.so")
    library.symlink_to(tmp_path / "elsewhere.so")
    assert not build_library("answer", SOURCES).is_symlink()


def test_a_new_cache_is_ours_alone_whatever_the_umask(own_cache: Path) -> None:
    before = os.umask(0)
    try:
        library = build_library("answer", SOURCES)
    finally:
        os.umask(before)
    assert not (own_cache.stat().st_mode | library.stat().st_mode) & 0o022
    assert build_library("answer", SOURCES) == library


def test_what_killed_builds_left_is_removed(own_cache: Path) -> None:
    build_library("other", {"other.c": "int other;"})
    old, new, foreign = (own_cache / name for name in (".kinqp-build-a", ".kinqp-build-b", ".another"))
    for folder in (old, new, foreign):
        folder.mkdir()
        (folder / "step.c").touch()
    for folder in (old, foreign):
        os.utime(folder, (0.0, 0.0))
    build_library("answer", SOURCES)
    assert (old.exists(), new.exists(), foreign.exists()) == (False, True, True)


def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("KINQP_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_directory() == tmp_path / "kinqp"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for ignored in ("", "relative"):
        monkeypatch.setenv("XDG_CACHE_HOME", ignored)
        assert cache_directory() == tmp_path / "home" / ".cache" / "kinqp"


@pytest.mark.parametrize("file", ["../answer.c", "/answer.c", "a/b.c", "", "a b.c", "-o.c"])
def test_only_plain_file_names(file: str) -> None:
    with pytest.raises(ValueError, match="plain file names"):
        build_library("answer", {file: ""})
    with pytest.raises(ValueError, match="plain file names"):
        build_library(file, SOURCES)


def test_nothing_to_compile_is_refused() -> None:
    with pytest.raises(ValueError, match=r"at least one \.c"):
        build_library("answer", {"answer.h": ""})


def test_declarations_are_what_cffi_reads() -> None:
    header = (
        "#ifndef A\n#define A\n/* a\n   b */\n"
        '#ifdef __cplusplus\nextern "C" {\n#endif\n'
        "int f(int x); /* [m] */\n#endif\n"
    )
    assert declarations(header).split() == ["int", "f(int", "x);"]
