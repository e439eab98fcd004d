"""The fixtures of the conformance suite."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from conformance.examples import Example
from conformance.kit import Ran, Sandbox, folder_for_all, make_kit


@pytest.fixture(scope="session")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kit")
    make_kit(folder)
    return folder


@pytest.fixture
def sandbox(
    kit: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes],
    request: pytest.FixtureRequest,
) -> Iterator[Sandbox]:  # fmt: skip
    """A folder of its own, which is the current one, with the kit in it; of a test of one example,
    only what that reads."""
    with folder_for_all() as root:
        made = Sandbox(root, capfdbinary)
        parameters = request.node.callspec.params if hasattr(request.node, "callspec") else {}
        for file in kit.iterdir():
            if "example" not in parameters or file.name in parameters["example"].reads:
                shutil.copy(file, made.folder)
        monkeypatch.chdir(made.folder)
        monkeypatch.setattr(tempfile, "tempdir", str(made.temporary))
        yield made


_usual: dict[str, Ran] = {}


@pytest.fixture
def usual(sandbox: Sandbox) -> object:
    """What an example does when nothing is odd; each runs once."""

    def of(example: Example) -> Ran:
        if example.name not in _usual:
            ran = sandbox.run(*example.arguments())
            ran.is_fine()
            for name in ran.files:
                Path(name).unlink()
            for folder in {Path(name).parent for name in ran.files} - {Path()}:
                folder.rmdir()
            _usual[example.name] = ran
        return _usual[example.name]

    return of
