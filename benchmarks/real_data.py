"""Write docs/results.md: every denoiser on the outdoor UWB data set, from results.json files.

Each table is made by one `gaia evaluate` command, which is printed above it; run it to get the same
numbers. Usage: python benchmarks/real_data.py [--data-dir FOLDER]   (or GAIA_DATA_DIR)
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

METHODS = "raw,median,kalman,pose-kalman"
AS_PUBLISHED = """\
alignment: {clock_offset: "off", gate: false, resample: nearest}
calibration: {range_bias: "off"}
"""
NO_BIAS = 'calibration: {range_bias: "off"}\n'
APART = "sides: {joint: false}\n"

# title, extra arguments, settings file
TABLES: list[tuple[str, list[str], str]] = [
    ("Whole runs", ["--length", "whole"], ""),
    ("Windows of 64 steps", ["--length", "64"], ""),
    ("Windows of 64 steps, ranges not freed of the radios' bias", ["--length", "64"], NO_BIAS),
    ("Windows of 64 steps, each anchor's side decided alone", ["--length", "64"], APART),
    (
        "Windows of 64 steps, data as published: nearest sample, no clock offset, no gate, no bias",
        ["--length", "64"],
        AS_PUBLISHED,
    ),
    (
        "Windows of 64 steps, data as published, the paper's solver with true NLOS labels",
        ["--length", "64", "--solver", "wls", "--true-nlos-labels"],
        AS_PUBLISHED,
    ),
]
COLUMNS = {
    "distance_mse_overall": "range MSE (m²)",
    "anchor_mae": "anchor error (m)",
    "polygon_iou": "IoU",
    "polygon_hausdorff": "Hausdorff (m)",
    "anchor_mae_aligned": "error after rigid alignment (m)",
    "anchor_mae_right_side": "error given the right side (m)",
    "wrong_side_share": "wrong sides",
    "ellipse_coverage_90_aligned": "90 % ellipse, aligned",
}
HEAD = """# Results on the outdoor UWB data set

Written by `python benchmarks/real_data.py` from the `results.json` of the commands below; not
edited by hand. Means over episodes with 95 % bootstrap intervals that draw whole runs; with eight
runs such an interval is too short (about 88 % in simulation). Clock offset, spike gate and range
bias are found from each whole run without truth; a window is then denoised and located from its own
64 steps alone. No truth and no NLOS label is used unless a title says so. The true range is the
slant distance between the surveyed anchor and the antenna. What each column counts is in
`gaia_uwb/metrics.py`. The paper prints for its learned model on 15 windows: range MSE 0.1414 m²,
anchor error 2.249 m, IoU 0.239, Hausdorff 3.724 m.
"""


def evaluate(arguments: list[str], settings: str, data_dir: Path, out: Path) -> dict[str, Any]:
    """Run one evaluation and return its results."""
    gaia = str(Path(sys.executable).with_name("gaia"))
    command = [
        gaia,
        "evaluate",
        "outdoor-uwb",
        "--methods",
        METHODS,
        *arguments,
        "--data-dir",
        str(data_dir),
        "--out",
        str(out),
    ]
    if settings:
        (out / "settings.yaml").write_text(settings, encoding="utf-8")
        command += ["--config", str(out / "settings.yaml")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    content: dict[str, Any] = json.loads((out / "results.json").read_text(encoding="utf-8"))
    return content


def table(results: dict[str, Any]) -> str:
    """Return one Markdown table."""
    lines = ["| method | " + " | ".join(COLUMNS.values()) + " |", "|---" * (len(COLUMNS) + 1) + "|"]
    for row in results["rows"]:
        cells = []
        for name in COLUMNS:
            m = row["metrics"].get(name)
            text = "nothing to count" if m is None else f"{m['value']:.4g}"
            if m is not None and m["ci95"] is not None:
                text += f" [{m['ci95'][0]:.3g}, {m['ci95'][1]:.3g}]"
            cells.append(text)
        lines.append(f"| {row['method']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run all evaluations and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data-dir", type=Path, default=os.environ.get("GAIA_DATA_DIR"))
    data_dir = parser.parse_args().data_dir
    if data_dir is None:
        raise SystemExit("set GAIA_DATA_DIR to the folder that holds outdoor-uwb/")
    page = [HEAD]
    for title, arguments, settings in TABLES:
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as out:
            results = evaluate(arguments, settings, data_dir, Path(out))
        took_s = time.perf_counter() - start
        protocol = results["protocol"]
        shown = f"gaia evaluate outdoor-uwb --methods {METHODS} {' '.join(arguments)}"
        config = f" --config settings.yaml\n# settings.yaml\n{settings}" if settings else "\n"
        page.append(
            f"## {title}\n\n```\n{shown}{config}```\n\n"
            f"{protocol['episodes']} episodes of {protocol['runs']} runs"
            f" ({protocol['windows_without_ranges']} windows without ranges left out),"
            f" solver {protocol['solver']}, bootstrap seed {protocol['seed']},"
            f" GAIA {protocol['version']}, {took_s:.0f} s on two cores.\n\n{table(results)}\n"
        )
        print(f"{title}: {took_s:.0f} s")
    target = Path(__file__).parents[1] / "docs" / "results.md"
    target.write_text("\n".join(page), encoding="utf-8")
    print(f"wrote {target}")


if __name__ == "__main__":
    main()
