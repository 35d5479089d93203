"""Building C at run time: sources to a shared library, with the system's compiler, once per machine.

Libraries are kept in a cache, ``$KINQP_CACHE`` or else ``$XDG_CACHE_HOME/kinqp`` or ``~/.cache/kinqp``, under a hash of
everything that decides what they contain. A file appears there finished and in one step, with its own checksum at the
end, so any number of processes may build and load at once, and a damaged file is noticed and replaced.

What is loaded runs. The checksum is against accidents only, so the folder and its files must be such that nobody else
can write there, as OpenSSH demands of keys: owned by this user or root, writable by no one else.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

#: ``-ffp-contract=off``: the same bits whether or not the machine can fuse a multiplication with an addition.
#: ``-fno-tree-slp-vectorize``: at three to seven columns, packing scalars into vectors costs more than it saves.
DEFAULT_FLAGS: tuple[str, ...] = (
    "-std=c99",
    "-O3",
    "-fno-tree-slp-vectorize",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-lm",
)

#: Among flags: use all that this machine's processor has. The library then belongs to processors like it.
NATIVE = "-march=native"

_COMPILERS = ("cc", "gcc", "clang")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
#: Lines of the compiler's own words in an error message.
_MESSAGE_LINES = 12
#: Folders in the cache in which something is being built.
_SCRATCH = ".kinqp-build-"
#: A build takes seconds; what is older was killed [s].
_ABANDONED = 3600.0


class CompilerError(RuntimeError):
    """There is no C compiler, it refused the sources, or there is no place to keep what it made."""


def build_library(name: str, sources: Mapping[str, str], *, flags: Sequence[str] = DEFAULT_FLAGS) -> Path:
    """Compile C sources into one shared library, or find the one that was made from them before.

    Parameters
    ----------
    name
        What the library is called, for people who look into the cache.
    sources
        Text by file name; every ``.c`` among them is compiled, the others are there to be included.
    flags
        Passed to the compiler in this order, libraries (``-l...``) behind the sources. `NATIVE` is left out where the
        compiler does not know it.

    Returns
    -------
    Path
        The library's absolute path; its content belongs to these sources, flags and this compiler for ever.

    Raises
    ------
    CompilerError
        When there is no compiler, it fails, or the cache cannot be written or is open to other users.
    ValueError
        When a name is no plain file name, or nothing among the sources is C.
    """
    for file in (name, *sources):
        if not _NAME.fullmatch(file):
            raise ValueError(f"build_library: expected plain file names, got {file!r}")
    units = sorted(file for file in sources if file.endswith(".c"))
    if not units:
        raise ValueError(
            f"build_library: expected at least one .c among the sources, got {', '.join(sources) or 'none'}"
        )
    command = compiler()
    machine = _processor(command) if NATIVE in flags else ""
    if not machine:
        flags = [flag for flag in flags if flag != NATIVE]
    library = cache_directory() / f"{name}-{_key(sources, flags, command, machine)}.so"
    try:
        library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        _require_own(library.parent)
        if _trusted(library.lstat) and _intact(library):
            return library
        _clear_abandoned(library.parent)
        # In the same directory, because only there a file can be moved into place in one step.
        with tempfile.TemporaryDirectory(prefix=_SCRATCH, dir=library.parent, ignore_cleanup_errors=True) as scratch:
            made = _compile(Path(scratch), sources, units, flags, command)
            made.replace(library)
    except OSError as error:
        raise CompilerError(
            f"the C library {name!r} cannot be kept in {library.parent}: {error}; "
            f"set KINQP_CACHE to a writable directory"
        ) from error
    return library


def compiler() -> tuple[str, ...]:
    """Return the command of the C compiler: ``$KINQP_CC`` with its arguments, else the first of cc, gcc, clang.

    Raises
    ------
    CompilerError
        When there is none.
    """
    wanted = shlex.split(os.environ.get("KINQP_CC", ""))
    for candidate in wanted[:1] or _COMPILERS:
        path = shutil.which(candidate)
        if path is not None:
            return (str(Path(path).absolute()), *wanted[1:])
    missing = f"KINQP_CC names {wanted[0]!r}, which" if wanted else f"a C compiler ({', '.join(_COMPILERS)})"
    raise CompilerError(
        f"{missing} was not found: install a C compiler, e.g. apt-get install gcc, or set KINQP_CC to one"
    )


def cache_directory() -> Path:
    """Return the directory in which libraries are kept; it need not exist."""
    chosen = os.environ.get("KINQP_CACHE")
    if chosen:
        return Path(chosen).expanduser().absolute()
    base = os.environ.get("XDG_CACHE_HOME", "")
    # The XDG specification wants relative paths ignored.
    return (Path(base) if Path(base).is_absolute() else Path("~/.cache").expanduser()).absolute() / "kinqp"


def declarations(header: str) -> str:
    """Return what cffi can read of a C header: no comments, no preprocessor, no ``extern "C"``."""
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    text = re.sub(r"#ifdef __cplusplus.*?#endif", "", text, flags=re.DOTALL)
    return "\n".join(line for line in text.splitlines() if line.strip() and not line.startswith("#"))


def _key(sources: Mapping[str, str], flags: Sequence[str], command: tuple[str, ...], machine: str) -> str:
    parts = [*command, _version(command), platform.machine(), machine, sys.platform, *flags]
    for file in sorted(sources):
        parts += [file, sources[file]]
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode()
        # With its length in front, so that no two lists of parts run into the same bytes.
        digest.update(b"%d:" % len(data) + data)
    return digest.hexdigest()[:24]


@cache
def _version(command: tuple[str, ...]) -> str:
    try:
        answer = _run([*command, "--version"])
    except OSError as error:
        raise CompilerError(f"the C compiler {shlex.join(command)} cannot be run: {error}; set KINQP_CC") from error
    return answer.stdout


@cache
def _processor(command: tuple[str, ...]) -> str:
    """What the compiler can use of this machine's processor, as its own macros; empty: it can't tell.

    A cache may be shared by machines that differ, and what was built for one may be an illegal instruction on another.
    """
    answer = _run([*command, NATIVE, "-dM", "-E", "-x", "c", os.devnull])
    return answer.stdout if answer.returncode == 0 else ""


def _compile(
    scratch: Path,
    sources: Mapping[str, str],
    units: Sequence[str],
    flags: Sequence[str],
    command: tuple[str, ...],
) -> Path:
    """Compile in the directory `scratch`; return the library, sealed."""
    for file, text in sources.items():
        (scratch / file).write_text(text, encoding="utf-8")
    libraries = [flag for flag in flags if flag.startswith("-l")]
    others = [flag for flag in flags if not flag.startswith("-l")]
    # File names stay relative, because a compiler may write them into what it makes.
    line = [*command, *others, *units, "-o", "library.so", *libraries]
    answer = _run(line, scratch)
    made = scratch / "library.so"
    if answer.returncode != 0 or not made.is_file():
        words = (answer.stderr or answer.stdout).strip().splitlines()[:_MESSAGE_LINES] or ["(it said nothing)"]
        raise CompilerError(f"{shlex.join(line)} failed with code {answer.returncode}:\n" + "\n".join(words))
    content = made.read_bytes()
    made.write_bytes(content + hashlib.sha256(content).digest())
    made.chmod(0o755)  # whatever the umask: what others may write is not loaded
    return made


def _run(line: Sequence[str], directory: Path | None = None) -> subprocess.CompletedProcess[str]:
    # What runs is the compiler that the user chose, with arguments in a list and without a shell.
    return subprocess.run(line, cwd=directory, capture_output=True, text=True, errors="replace", check=False)


def _require_own(folder: Path) -> None:
    """Refuse a cache in which another user could put a library for us to load.

    Raises
    ------
    CompilerError
        When the folder belongs to another user, others may write there, or they may move a folder above it.
    """
    real = folder.resolve()
    if not _trusted(real.stat):
        found = real.stat()
        raise CompilerError(
            f"the cache of C libraries, {folder}: expected a folder of this user that no one else may write to, got "
            f"one of user {found.st_uid} with mode {stat.S_IMODE(found.st_mode):o}, whose libraries would run "
            f"here; chmod go-w it if it is yours, or set KINQP_CACHE to another"
        )
    for above in real.parents:
        mode = above.stat().st_mode
        if hasattr(os, "getuid") and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise CompilerError(
                f"the cache of C libraries, {folder}: expected to be where no one else can replace it, but everyone "
                f"may write to {above}; set KINQP_CACHE to another"
            )


def _trusted(status: Callable[[], os.stat_result]) -> bool:
    """Whether a file or folder is this user's or root's, and no one else may write to it; not, where there is none."""
    try:
        found = status()
    except FileNotFoundError:
        return False
    if not hasattr(os, "getuid"):
        return True  # where access is not a matter of owner and mode
    known = stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)
    return known and found.st_uid in (os.geteuid(), 0) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _clear_abandoned(folder: Path) -> None:
    """Remove what killed builds have left."""
    for left in folder.glob(f"{_SCRATCH}*"):
        try:
            old = time.time() - left.lstat().st_mtime > _ABANDONED
        except FileNotFoundError:
            continue  # another process was faster
        if old:
            shutil.rmtree(left, ignore_errors=True)


def _intact(library: Path) -> bool:
    """Whether a library ends in the checksum of what comes before, as `_compile` seals it (loaders do not mind)."""
    try:
        content = library.read_bytes()
    except OSError:
        return False
    size = hashlib.sha256().digest_size
    return hashlib.sha256(content[:-size]).digest() == content[-size:]
