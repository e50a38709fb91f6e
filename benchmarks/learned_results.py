"""Write docs/learned-denoisers.md from the results.json of the commands that it names.

    gaia reproduce table2 --out out/learned/table2
    cp -r out/learned/table2/models out/learned/ablation/models  # or train them again
    gaia reproduce ablation --seeds 1 --out out/learned/ablation
    gaia reproduce table1 --split window --preparation published --out out/learned/window-published
    gaia reproduce table1 --split window --preparation aligned --out out/learned/window-aligned
    gaia reproduce table1 --split layout --preparation aligned --out out/learned/layout-aligned
    python benchmarks/learned_results.py out/learned

A table whose results are not there is named as missing.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gaia_uwb.files import OutputFolder
from gaia_uwb.method_tables import results_table

PAGE = Path(__file__).parents[1] / "docs" / "learned-denoisers.md"

# What the paper prints: MSE, MSE LOS, MSE NLOS, anchor error, IoU, Hausdorff.
TABLE_1 = {
    "Kalman": (0.1939, 0.2385, 0.1777, 3.3650, 0.0846, 4.6569),
    "MLP": (0.5812, 1.0111, 0.4248, 2.8809, 0.0457, 3.3946),
    "PoseKalman": (0.4733, 0.1902, 0.5762, 12.9340, 0.0159, 15.8975),
    "PoseMLP": (0.1733, 0.1102, 0.1962, 2.1703, 0.2069, 3.2905),
    "GAIA": (0.1414, 0.1098, 0.1529, 2.2493, 0.2390, 3.7241),
}
TABLE_2 = {
    "Kalman": (3.9913, 1.4998, 4.6750, 32.3894, 0.2404, 62.5128),
    "MLP": (1.6514, 1.2088, 1.7728, 30.7023, 0.2668, 54.4222),
    "PoseKalman": (1.7323, 0.4998, 2.0706, 32.5667, 0.2519, 56.9666),
    "PoseMLP": (0.7773, 0.6494, 0.8124, 25.6580, 0.3531, 37.8489),
    "GAIA": (0.3821, 0.3567, 0.3890, 19.7536, 0.4286, 30.9233),
}
ABLATION = {
    "w/o Layout Head": (0.6520, 0.5817, 0.6713, 26.1689, 0.3475, 39.6997),
    "w/o GeoDist": (0.5520, 0.4866, 0.5699, 24.9683, 0.3654, 36.1815),
    "Unfreeze PoseMLP Base": (0.7720, 0.8036, 0.7633, 23.1187, 0.3799, 36.3602),
    "GAIA": (0.3821, 0.3567, 0.3890, 19.7536, 0.4286, 30.9233),
}

SECTIONS = (
    ("table2", "The stress test (the paper's table 2)", TABLE_2),
    ("ablation", "Ablations on the stress test", ABLATION),
    ("window-published", "Real windows, data as the paper seems to have used them", TABLE_1),
    ("window-aligned", "Real windows, data as a reconstruction prepares them", TABLE_1),
    ("layout-aligned", "Real windows past layouts that no model has seen", TABLE_1),
)

HEAD = """\
# The learned denoisers: results

Written by `python benchmarks/learned_results.py` from the `results.json` of the commands that it
names; not edited by hand. What the tables say, and how the models were made:
[training.md](training.md). Means over episodes with 95 % bootstrap intervals; on real data the
bootstrap draws whole runs, eight of them, so that the intervals are rather too short. Windows have
64 steps. Rows "paper" are what the paper prints, on its own data: 216 simulated episodes, and 15
windows of the outdoor data set.
"""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="holds one folder of results per table")
    folder = parser.parse_args().folder
    parts = [HEAD]
    for name, title, paper in SECTIONS:
        parts.append(f"## {title}\n")
        path = folder / name / "results.json"
        if not path.is_file():
            parts.append(f"Missing: `{name}/results.json` was not there when this was written.\n")
            continue
        content = json.loads(path.read_text(encoding="utf-8"))
        for table in content.get("tables", [content]):
            parts.append(section(table, paper))
    OutputFolder(PAGE.parent).write_text(PAGE.name, "\n".join(parts))


def section(table: dict[str, Any], paper: Mapping[str, tuple[float, ...]]) -> str:
    """Return one table with what was done, ours and the paper's rows."""
    protocol = table["protocol"]
    trained = protocol["trained_on"]
    labels = "with the true NLOS labels" if protocol["true_nlos_labels"] else "without labels"
    lines = [
        f"{protocol['episodes']} episodes of {protocol['runs']} runs of {protocol['data']}; split: "
        f"{protocol['split']}; solver: {protocol['solver']}, {labels}; models with seeds "
        f"{', '.join(map(str, protocol['training_seeds']))}, trained on {trained['training']} "
        f"({trained['source']}); gaia {protocol['version']}.",
        "",
        results_table(table).rstrip(),
    ]
    for name, values in paper.items():
        lines.append(f"| paper: {name} | " + " | ".join(f"{value:.4g}" for value in values) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
