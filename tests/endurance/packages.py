"""Build the sdist and the wheel, install each in an environment of its own, and run the tutorial.

Usage: nice python tests/endurance/packages.py [--only wheel] [--weight]

``python -m build`` makes both from a copy of the tracked files. The wheel must hold the models, the
map page, the stubs and the licence, and no path of the building machine; it is installed with
nothing on the PATH, so no compiler, in a new environment with the pinned dependencies and no
extras. The sdist needs a C compiler. In both environments ``tools/page_blocks.py`` then runs the
tutorial's commands and compares every number with the page. Needs the extra dev, and pip's index.

``--weight`` prints what each package of that environment weighs, bytecode included, and how long
its import and some commands take: the table of ``docs/weight.md``.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NEEDED = (
    r"gaia_uwb/py\.typed",
    r"gaia_uwb/__init__\.pyi",
    r"gaia_uwb/locate/_covariances\..*(so|pyd)",
    r"gaia_uwb/locate/_readings\..*(so|pyd)",
    r"gaia_uwb/solver/_solver\..*(so|pyd)",
    r"gaia_uwb/zone/_tour\..*(so|pyd)",
    r"gaia_uwb/outputs/assets/map_page\.html",
    r"gaia_uwb/models/shipped/.+/model\.onnx",
    r"gaia_uwb/models/shipped/.+/MODEL_CARD\.md",
    r"gaia_uwb/logs/outdoor-uwb\.json",
    r"gaia_uwb/simulate/.+\.yaml",
    r".+\.dist-info/licenses/LICENSE",
)
WEIGH = """
import importlib.metadata as metadata, json, pathlib
print(json.dumps({
    each.metadata["Name"].lower(): sum(
        path.locate().stat().st_size for path in each.files or () if path.locate().is_file())
    for each in metadata.distributions()}))
"""
IMPORTS = ("numpy", "polars", "onnxruntime", "matplotlib.figure", "pyproj", "shapely", "pydantic")


def run(arguments: list[object], folder: Path, path: str | None = None) -> str:
    """Run a command in a folder, on another PATH if given; stop with what it said if it fails."""
    done = subprocess.run(
        [str(word) for word in arguments],
        cwd=folder, env=os.environ if path is None else os.environ | {"PATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, arguments))}\n{done.stdout}{done.stderr}")
    return done.stdout


def build(folder: Path) -> tuple[Path, Path]:
    """Build both packages from the tracked files and return the wheel and the sdist."""
    source, out = folder / "source", folder / "dist"
    for name in run(["git", "ls-files"], ROOT).splitlines():
        target = source / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)
    run([sys.executable, "-m", "build", "--outdir", out, source], folder)
    return next(out.glob("*.whl")), next(out.glob("*.tar.gz"))


def faults(wheel: Path, folder: Path) -> Iterator[str]:
    """Yield what is wrong with the content of a wheel."""
    places = {str(folder), str(ROOT), str(Path.home()), sys.base_prefix}
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        for pattern in NEEDED:
            if not any(re.fullmatch(pattern, name) for name in names):
                yield f"the wheel lacks {pattern}"
        for name in names:
            content = archive.read(name)
            found = [place for place in places if place.encode() in content]
            if found:
                yield f"{name} names {', '.join(found)}"
        if any(name.startswith("tests/") for name in names):
            yield "the wheel holds tests"


def install(package: Path, folder: Path, *, with_compiler: bool) -> Path:
    """Install a package in a new environment and return that environment's Python."""
    run([sys.executable, "-m", "venv", folder], folder.parent)
    python = folder / "bin" / "python"
    path = None if with_compiler else str(python.parent)
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run([*pip, "--constraint", ROOT / "constraints.txt", package], folder.parent, path)
    return python


def run_tutorial(python: Path, folder: Path) -> str:
    """Run the tutorial in an environment; say whether every output is as the page shows it."""
    page = folder / "tutorial.md"
    shutil.copy(ROOT / "docs" / "tutorial.md", page)
    said = run([python, "-I", ROOT / "tools" / "page_blocks.py", "--update", page], folder)
    return said.rsplit(": ", maxsplit=1)[-1].strip()


def weigh(python: Path) -> None:
    """Print a table of the environment's packages, the heaviest first, and of times."""
    sizes: dict[str, int] = json.loads(run([python, "-c", WEIGH], ROOT))
    print("| package | MB |\n|---|---:|")
    for name, size in sorted(sizes.items(), key=lambda item: -item[1])[:15]:
        print(f"| {name} | {size / 1e6:.1f} |")
    print(f"| all {len(sizes)} | {sum(sizes.values()) / 1e6:.0f} |")
    print("\n| | s | peak MB |\n|---|---:|---:|")
    gaia = python.with_name("gaia")
    commands: dict[str, list[object]] = {"python": [python, "-c", "pass"]}
    commands |= {f"import {name}": [python, "-c", f"import {name}"] for name in IMPORTS}
    commands |= {
        "gaia --help": [gaia, "--help"],
        "import gaia_uwb": [python, "-c", "import gaia_uwb"],
    }
    for name, command in commands.items():
        best_s, peak_kb = min(_timed(python, command) for _ in range(5))
        print(f"| {name} | {best_s:.2f} | {peak_kb / 1000:.0f} |")


def _timed(python: Path, command: list[object]) -> tuple[float, int]:
    """Return processor time, which a busy machine changes least, and peak memory of a command."""
    code = (
        "import resource, subprocess, sys;"
        "subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True);"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN);"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss)"
    )
    seconds, kilobytes = run([python, "-c", code, *command], ROOT).split()
    return float(seconds), int(kilobytes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=["wheel", "sdist"])
    parser.add_argument("--weight", action="store_true", help="print what the installation weighs")
    options = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel, sdist = build(folder)
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB, {sdist.name}: "
              f"{sdist.stat().st_size / 1e6:.1f} MB")  # fmt: skip
        wrong = list(faults(wheel, folder))
        print("\n".join(wrong) or "the wheel holds all that it needs, and no path of this machine")
        for kind, package in (("wheel", wheel), ("sdist", sdist)):
            if options.only in (None, kind):
                place = folder / kind
                python = install(package, place, with_compiler=kind == "sdist")
                outcome = run_tutorial(python, place)
                failed |= outcome != "unchanged"
                print(f"{kind}: installed, the tutorial's numbers: {outcome}")
                if options.weight and kind == "wheel":
                    weigh(python)
    if wrong or failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
