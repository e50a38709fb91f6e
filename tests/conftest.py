"""Shared fixtures; shapes and types in the package's annotations are executed while testing."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

# Two processes share two cores: threads of numpy and PyTorch would only be in their way.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis
import pytest
from jaxtyping import install_import_hook

from browser import Browser, browser, find_chromium

install_import_hook("gaia_uwb", "beartype.beartype")

from gaia_uwb.cli import main  # noqa: E402  # after the hook

# The same examples in every run, however busy the machine; HYPOTHESIS_PROFILE=search looks further.
hypothesis.settings.register_profile("default", deadline=None, derandomize=True)
hypothesis.settings.register_profile("search", deadline=None, max_examples=1000)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))


def _find_data_dir() -> Path | None:
    """Return the folder that holds `outdoor-uwb/`: GAIA_DATA_DIR, else `shared/data` beside us."""
    named = os.environ.get("GAIA_DATA_DIR")
    beside = Path(__file__).parents[2] / "shared" / "data"
    for folder in [Path(named)] if named else [beside]:
        if (folder / "outdoor-uwb" / "Dynamic_measurements").is_dir():
            return folder
    return None


@pytest.fixture(scope="session")
def outdoor_dir() -> Path:
    """Folder that contains `outdoor-uwb/`, or skip."""
    folder = _find_data_dir()
    if folder is None:
        pytest.skip(
            "left out: no outdoor UWB data set (set GAIA_DATA_DIR to a folder that holds it)"
        )
    return folder


@pytest.fixture
def run(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., tuple[int, str, str]]:
    """Run ``gaia`` in this process, quicker than in a new one: exit code, stdout, stderr."""

    def run_here(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gaia", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        out = capsys.readouterr()
        code = stop.value.code
        return (0 if code is None else int(code)), out.out, out.err

    return run_here


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One browser for all tests that need one, without a network, or skip."""
    if find_chromium() is None:
        pytest.skip("left out: no chromium to look at the map with")
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The map's pages that tests look at in a browser."""
    from map_looks import write_pages

    return write_pages(tmp_path_factory.mktemp("pages"))


def pytest_report_header() -> list[str]:
    """Say up front whether the real data and the browser take part."""
    data, chromium = _find_data_dir(), find_chromium()
    return [
        f"outdoor UWB data set: {'present' if data else 'ABSENT, real-data tests are left out'}",
        f"chromium: {'present' if chromium else 'ABSENT, tests in a browser are left out'}",
    ]
