"""Compiled loops are kept where only we can write, made anew when they are not as we wrote them,
and compiled in memory where nothing can be kept."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import FIXTURES

from mapcli import notices
from mapcli.algorithms import compiling, kernel_cache

APARTMENT = FIXTURES / "apartment.mcap"
PACKAGE = FIXTURES.parent
AS_ROOT = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs another user"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    chosen = tmp_path / "kept"
    monkeypatch.setenv("MAPCLI_CACHE_DIR", str(chosen))
    return chosen


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    texts: list[str] = []
    monkeypatch.setattr(kernel_cache, "_said", set())
    notices.listen(note=texts.append, progress=lambda text: texts.append(f"wait: {text}"))
    yield texts
    notices.listen(note=None, progress=None)


def loop(tmp_path: Path, text: str = "x + 1") -> Any:
    """A compiled function of a module of its own, as a fresh process would have it."""
    kernel_cache._folders.cache_clear()
    kernel_cache._digest_of_files.cache_clear()
    source = tmp_path / "source.py"
    source.write_text(f"def loop(x):\n    return {text}\n")
    names: dict[str, Callable[..., Any]] = {}
    exec(compile(source.read_text(), str(source), "exec"), names)
    return compiling.compiled(names["loop"], {}, [source])


def hits(compiled: Any) -> int:
    return int(sum(compiled.stats.cache_hits.values()))


def the_file(folder: Path) -> Path:
    (file,) = folder.glob("*.nbc")
    return file


def test_a_loop_is_compiled_once(folder: Path, tmp_path: Path, heard: list[str]) -> None:
    first = loop(tmp_path)
    assert first(1) == 2
    assert heard == [f"wait: {kernel_cache.COMPILING}"]
    assert folder.stat().st_mode & 0o777 == 0o700
    assert not the_file(folder).stat().st_mode & 0o022
    second = loop(tmp_path)
    assert second(1) == 2
    assert (hits(first), hits(second)) == (0, 1)


def test_other_sources_are_other_code(folder: Path, tmp_path: Path) -> None:
    assert loop(tmp_path)(1) == 2
    changed = loop(tmp_path, "x + 7")
    assert changed(1) == 8
    assert hits(changed) == 0
    the_file(folder)  # in the place of the old one


def test_other_types_are_another_file(folder: Path, tmp_path: Path) -> None:
    compiled = loop(tmp_path)
    assert (compiled(1), compiled(1.5)) == (2, 2.5)
    assert len(list(folder.glob("*.nbc"))) == 2


class Planted:
    """What runs a command when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.mark),)


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "junk", "planted", "folder", "pipe"])
def test_a_file_that_is_not_as_it_was_written(damage: str, folder: Path, tmp_path: Path) -> None:
    loop(tmp_path)(1)
    file, mark = the_file(folder), tmp_path / "mark"
    content = file.read_bytes()
    contents = {
        "empty": b"",
        "cut": content[: len(content) // 2],
        "flipped": content[:-100] + bytes([content[-100] ^ 1]) + content[-99:],
        "junk": b"\x80\x05junk",
        "planted": pickle.dumps(Planted(mark)),
    }
    file.unlink()
    if damage == "folder":
        file.mkdir()
    elif damage == "pipe":
        os.mkfifo(file)
    else:
        file.write_bytes(contents[damage])
    compiled = loop(tmp_path)
    assert compiled(1) == 2
    assert hits(compiled) == 0
    assert not mark.exists()
    if damage != "folder":
        again = loop(tmp_path)
        assert again(1) == 2
        assert hits(again) == 1


def test_a_file_that_others_may_write_is_not_read(folder: Path, tmp_path: Path) -> None:
    loop(tmp_path)(1)
    the_file(folder).chmod(0o664)
    compiled = loop(tmp_path)
    assert compiled(1) == 2
    assert hits(compiled) == 0


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o1777])
def test_a_folder_that_others_may_write_to(
    mode: int, folder: Path, tmp_path: Path, heard: list[str]
) -> None:
    loop(tmp_path)(1)
    folder.chmod(mode)
    heard.clear()
    kernel_cache._said.clear()
    compiled = loop(tmp_path)
    assert compiled(1) == 2
    assert hits(compiled) == 0
    assert heard == [
        f"compiled loops cannot be kept ({folder} may be written to by other users), so they are "
        "compiled in memory, at every run; MAPCLI_CACHE_DIR names another folder for them"
    ]


@AS_ROOT
def test_a_folder_of_another_user(folder: Path, tmp_path: Path, heard: list[str]) -> None:
    folder.mkdir()
    os.chown(folder, 65534, 65534)
    assert loop(tmp_path)(1) == 2
    assert "belongs to another user" in heard[0]
    assert not list(folder.iterdir())


@pytest.mark.parametrize("place", ["/dev/null", "/dev/null/below", "/proc/nothing"])
def test_no_folder(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, heard: list[str]
) -> None:
    monkeypatch.setenv("MAPCLI_CACHE_DIR", place)
    compiled = loop(tmp_path)
    assert (compiled(1), compiled(1.5)) == (2, 2.5)
    assert len(heard) == 1
    assert place in heard[0]


def test_without_a_choice_it_is_beside_the_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in kernel_cache.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    loop(tmp_path)(1)
    the_file(tmp_path / "__pycache__")


def test_or_below_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in kernel_cache.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / ".cache"))
    (tmp_path / "__pycache__").write_text("in the way")
    loop(tmp_path)(1)
    the_file(home / ".cache" / "mapcli")


def test_every_kernel_depends_on_all_kernels_of_its_room() -> None:
    from mapcli.algorithms.slam._kernels import branch_and_bound, window_scores

    kernel = next(
        each
        for each in vars(branch_and_bound).values()
        if isinstance(getattr(each, "_cache", None), kernel_cache.KernelCache)
    )
    assert Path(str(window_scores.__file__)) in kernel._cache._sources
    assert Path(str(compiling.__file__)) in kernel._cache._sources


def replay(out: Path, *more: str, **environment: str) -> subprocess.CompletedProcess[str]:
    arguments = ["slam-replay", str(APARTMENT), "-o", str(out), "--end", "2", *more]
    return subprocess.run(
        [sys.executable, "-m", "mapcli", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
    )


@pytest.mark.slow
def test_a_replay_that_can_keep_nothing_says_so_once(tmp_path: Path) -> None:
    kept, loud = replay(tmp_path / "a"), replay(tmp_path / "b", MAPCLI_CACHE_DIR="/dev/null")
    quiet = replay(tmp_path / "c", "-q", MAPCLI_CACHE_DIR="/dev/null")
    assert (kept.returncode, loud.returncode, quiet.returncode) == (0, 0, 0)
    assert loud.stderr.count("Note: compiled loops cannot be kept (/dev/null is not there)") == 1
    assert (quiet.stderr, quiet.stdout) == ("", "")
    for name in ("map.pgm", "map.yaml", "map.png"):
        whole = (tmp_path / "a" / name).read_bytes()
        assert whole == (tmp_path / "b" / name).read_bytes() == (tmp_path / "c" / name).read_bytes()


@AS_ROOT
@pytest.mark.slow
@pytest.mark.parametrize("place", ["/", "/nonexistent"])
def test_another_user_without_a_home(place: str, tmp_path: Path) -> None:
    # It may read everything, because the interpreter may lie in root's home.
    capability = "+dac_read_search"
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups",
              f"--inh-caps={capability}", f"--ambient-caps={capability}"]  # fmt: skip
    if not shutil.which("setpriv") or subprocess.run([*nobody, "true"]).returncode:
        pytest.skip("setpriv cannot do it here")
    package = tmp_path / "package"
    shutil.copytree(PACKAGE / "mapcli", package / "mapcli", ignore=lambda *_: ["__pycache__"])
    out = tmp_path / "out"
    out.mkdir()
    os.chown(out, 65534, 65534)
    arguments = ["slam-replay", str(APARTMENT), "-o", str(out / "map"), "--end", "2"]
    done = subprocess.run(
        [*nobody, sys.executable, "-m", "mapcli", *arguments],
        cwd=out,
        capture_output=True,
        text=True,
        env={"HOME": place, "PYTHONPATH": str(package)},
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("Note: compiled loops cannot be kept") == 1
    assert (out / "map" / "map.pgm").exists()


@pytest.mark.slow
def test_a_terminal_is_told_what_takes_so_long(tmp_path: Path) -> None:
    if not shutil.which("script"):
        pytest.skip("script makes the terminal")
    line = f"{sys.executable} -m mapcli slam-replay {APARTMENT} -o {tmp_path}/map --end 1"
    environment = {**os.environ, "MAPCLI_CACHE_DIR": str(tmp_path / "kept")}
    said = [
        subprocess.run(
            ["script", "-qec", f"{line}{more}", os.devnull], env=environment, capture_output=True
        ).stdout
        for more in ("", "", " -q")
    ]
    assert [text.count(kernel_cache.COMPILING.encode()) for text in said] == [1, 0, 0]
