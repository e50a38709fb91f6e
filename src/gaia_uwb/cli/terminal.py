"""What people see on a terminal: progress, a summary, a table; the command line calls it."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from gaia_uwb._shared import written_out

if TYPE_CHECKING:
    from rich.progress import Progress as Bars, TaskID

    from gaia_uwb.estimate import AnchorFix
    from gaia_uwb.evaluate import Metric
    from gaia_uwb.reconstruction import Reconstruction

_Item = TypeVar("_Item")

EVERY_S = 60.0
"""Without a terminal, long work says this often how far it is."""
_LOOK_EVERY_S = 0.5


class Progress:
    """Says how far long work is: a bar on a terminal, elsewhere a line on stderr every minute.

    The lines come whether or not a step ends in the meantime, so that nobody takes long work for
    one that hangs; what is done in less than a minute says nothing.

    Parameters
    ----------
    clock
        Tells the time, in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start_s = self._told_s = clock()
        self._state: tuple[str, int, int | None] = ("working", 0, None)
        self._bars = _bars() if sys.stderr.isatty() else None
        self._tasks: dict[str, TaskID] = {}
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._tell_every_minute, daemon=True)

    @property
    def on_terminal(self) -> bool:
        """Whether somebody sees a bar."""
        return self._bars is not None

    def __enter__(self) -> Progress:
        if self._bars is None:
            self._thread.start()
        else:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bars is None:
            self._over.set()
            self._thread.join()
        else:
            self._bars.stop()

    def update(self, what: str, done: int = 0, total: int | None = None) -> None:
        """Note how much of something is done.

        Parameters
        ----------
        what
            Names it.
        done, total
            Steps; the total may be unknown.
        """
        self._state = (what, done, total)
        if self._bars is not None:
            if what not in self._tasks:
                self._tasks[what] = self._bars.add_task(what, total=total)
            self._bars.update(self._tasks[what], completed=done, total=total)

    def track(self, items: Sequence[_Item], what: str) -> Iterator[_Item]:
        """Go through items, and note how many are done.

        Parameters
        ----------
        items
            Any.
        what
            Is done with them.
        """
        self.update(what, 0, len(items))
        for done, item in enumerate(items, start=1):
            yield item
            self.update(what, done, len(items))

    def tell_if_due(self) -> None:
        """Write a line if a minute has passed since the last one."""
        now_s = self._clock()
        if now_s - self._told_s < EVERY_S:
            return
        self._told_s = now_s
        what, done, total = self._state
        how_far = "" if total is None else f"{done} of {total}, "
        line = f"{what}: {how_far}{(now_s - self._start_s) / 60.0:.0f} min so far"
        sys.stderr.write(f"{written_out(line)}\n")
        sys.stderr.flush()

    def _tell_every_minute(self) -> None:
        while not self._over.wait(_LOOK_EVERY_S):
            self.tell_if_due()


def _bars() -> Bars:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress as Bars,
        TextColumn,
        TimeRemainingColumn,
    )

    return Bars(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def print_summary(
    result: Reconstruction,
    metrics: Mapping[str, Metric] | None,
    paths: Sequence[Path],
) -> None:
    """Say what was found, how certain it is, and where the files are."""
    from gaia_uwb._shared import SIGMAS_90
    from gaia_uwb.outputs import hull_leads

    lines = [f"{result.name}: {result.status.value}", *_zones(result)]
    for episode, _ in result.passes:
        if result.more_passes:
            lines.append(f"  pass {episode.name}: {int(episode.n_readings.sum())} ranges")
        if (counts := episode.all_readings) is not None:
            lines.append(f"  {counts}")
        if (clock := episode.clock) is not None:
            lines.append(
                f"  clock offset {clock.applied_s:+.3f} s ± {SIGMAS_90 * clock.sigma_s:.3f} s "
                f"(90 %): {clock.reason}"
            )
    lines += [f"  {_cone(anchor)}" for anchor in result.anchors]
    hull = "boundary" if hull_leads(result.road_boundary) else "hull (the paper's boundary)"
    lines.append(f"  {hull}: {result.boundary_words}")
    if metrics is not None:
        shown = ("anchor_mae", "polygon_iou", "polygon_hausdorff")
        found = [
            f"{n} {metrics[n].value:.3f} {metrics[n].unit}".rstrip() for n in shown if n in metrics
        ]
        lines.append(f"  against the survey: {', '.join(found)}")
    lines += [f"  note: {note}" for note in result.notes]
    lines += [f"  reason: {reason.text}" for reason in result.reasons]
    lines += [f"  wrote {path}" for path in paths]
    sys.stderr.flush()
    typer.echo("\n".join(map(written_out, lines)))


def _zones(result: Reconstruction) -> Iterator[str]:
    """Describe the edges of each zone, and what is closed behind them."""
    from gaia_uwb.outputs import edge_words

    for zone in () if result.road_boundary is None else result.road_boundary.zones:
        for edge in zone.edges:
            which = f"{edge.side.value} edge" if len(zone.edges) > 1 else "edge"
            yield f"  {which}: {edge_words(edge)}"
        closed = zone.closed
        area = "unknown, an open strip" if closed is None else f"{closed.region.area_m2:.1f} m²"
        yield f"  closed area: {area}; {zone.form.message}"


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
    """Print the paper's six metrics, and those of edges where there are any, method by method."""
    paper = (
        "distance_mse_overall",
        "anchor_mae",
        "polygon_iou",
        "polygon_hausdorff",
        "wrong_side_share",
        "ellipse_coverage_90_aligned",
    )
    road = (
        "edge_error_mean",
        "edge_error_95",
        "edge_band_coverage_90",
        "zone_start_error",
        "zone_end_error",
        "zone_form_right",
    )
    protocol = results["protocol"]
    typer.echo(
        f"{protocol['data']}, length {protocol['length']}, solver {protocol['solver']}: "
        f"{protocol['episodes']} episodes of {protocol['runs']} runs, "
        f"{protocol['windows_without_ranges']} windows without ranges skipped"
    )
    for names in (paper, road):
        if names is paper or any(
            name in row["metrics"] for row in results["rows"] for name in names
        ):
            _print_table(names, results["rows"])
    typer.echo(f"wrote {path}")


def _print_table(names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    typer.echo("  ".join(["method".ljust(12), *(name.ljust(22)[:27] for name in names)]))
    for row in rows:
        cells = []
        for name in names:
            m = row["metrics"].get(name)
            text = "-" if m is None else f"{m['value']:.4f}"
            if m is not None and m["ci95"] is not None:
                text += f" [{m['ci95'][0]:.3f}, {m['ci95'][1]:.3f}]"
            cells.append(text.ljust(max(22, len(name))))
        typer.echo("  ".join([row["method"].ljust(12), *cells]))
