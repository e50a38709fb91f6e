"""What people see on a terminal: progress, a summary, a table; the command line calls it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from gaia_uwb._shared import written_out

if TYPE_CHECKING:
    from rich.progress import Progress

    from gaia_uwb.estimate import AnchorFix
    from gaia_uwb.evaluate import Metric
    from gaia_uwb.reconstruction import Reconstruction

_Item = TypeVar("_Item")


def progress_bar() -> Progress:
    """Return a progress bar on a terminal, nothing elsewhere: results follow as plain lines."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress as Bar,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    return Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def track(progress: Progress, items: Sequence[_Item], what: str) -> Iterable[_Item]:
    """Go through items; on a terminal with a bar, in a log with a line for every tenth of them."""
    task = progress.add_task(what, total=len(items))
    for k, item in enumerate(items):
        yield item
        progress.advance(task)
        step = max(1, len(items) // 10)
        if progress.disable and len(items) > 1 and ((k + 1) % step == 0 or k + 1 == len(items)):
            sys.stderr.write(f"{what}: {k + 1} of {len(items)}\n")


def print_summary(
    progress: Progress,
    result: Reconstruction,
    metrics: Mapping[str, Metric] | None,
    paths: Sequence[Path],
) -> None:
    """Say what was found, how certain it is, and where the files are."""
    from gaia_uwb._shared import SIGMAS_90

    lines = [f"{result.name}: {result.status.value}"]
    for episode, ranges in result.passes:
        if result.more_passes:
            lines.append(f"  pass {episode.name}: {int(ranges.valid.sum())} ranges")
        if (clock := episode.clock) is not None:
            lines.append(
                f"  clock offset {clock.applied_s:+.3f} s ± {SIGMAS_90 * clock.sigma_s:.3f} s "
                f"(90 %): {clock.reason}"
            )
    lines += [f"  {_cone(anchor)}" for anchor in result.anchors]
    lines.append(f"  boundary: {result.boundary.status.value}, {result.boundary.area_m2:.1f} m²")
    if metrics is not None:
        shown = ("anchor_mae", "polygon_iou", "polygon_hausdorff")
        found = [
            f"{n} {metrics[n].value:.3f} {metrics[n].unit}".rstrip() for n in shown if n in metrics
        ]
        lines.append(f"  against the survey: {', '.join(found)}")
    lines += [f"  note: {note}" for note in result.notes]
    lines += [f"  reason: {reason.text}" for reason in result.reasons]
    lines += [f"  wrote {path}" for path in paths]
    progress.console.file.flush()
    typer.echo("\n".join(map(written_out, lines)))


def _cone(anchor: AnchorFix) -> str:
    """Describe one cone; its uncertainty is the longer semi-axis of the 90 % ellipse."""
    end = f"{anchor.status.value}, {anchor.n_ranges} ranges"
    if not anchor.status.has_position:
        return f"{anchor.anchor_id}: not located, {end}"
    (east_m, north_m), (longer_m, _) = anchor.position_m, anchor.semi_axes_90_m
    return (
        f"{anchor.anchor_id}: east {east_m:.2f} m, north {north_m:.2f} m, "
        f"± {longer_m:.2f} m (90 %), {end}"
    )


def print_results(results: Mapping[str, Any], path: Path) -> None:
    """Print the paper's six metrics, one line per method."""
    names = (
        "distance_mse_overall",
        "anchor_mae",
        "polygon_iou",
        "polygon_hausdorff",
        "wrong_side_share",
        "ellipse_coverage_90_aligned",
    )
    protocol = results["protocol"]
    typer.echo(
        f"{protocol['data']}, length {protocol['length']}, solver {protocol['solver']}: "
        f"{protocol['episodes']} episodes of {protocol['runs']} runs, "
        f"{protocol['windows_without_ranges']} windows without ranges skipped"
    )
    typer.echo("  ".join(["method".ljust(12), *(name.ljust(22)[:27] for name in names)]))
    for row in results["rows"]:
        cells = []
        for name in names:
            m = row["metrics"].get(name)
            text = "-" if m is None else f"{m['value']:.4f}"
            if m is not None and m["ci95"] is not None:
                text += f" [{m['ci95'][0]:.3f}, {m['ci95'][1]:.3f}]"
            cells.append(text.ljust(max(22, len(name))))
        typer.echo("  ".join([row["method"].ljust(12), *cells]))
    typer.echo(f"wrote {path}")
