"""The result in plain words, for the people who put the cones there: ``report.md``.

What was found, how certain that is, what limited it and how to improve it. Every sentence follows
from the reconstruction; ids and names are shown as text, whatever characters they contain.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import SIGMAS_90, Array, Float64, in_markdown, metres, percent
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus, BoundaryStatus, SideSource
from gaia_uwb.evaluate import (
    Advice,
    Improvement,
    Limit,
    find_limits,
    limits_of_reasons,
    range_residual_m,
)
from gaia_uwb.outputs.road_words import (
    closed_regions,
    hull_leads,
    square_metres,
    summary_words,
    zone_words,
)
from gaia_uwb.projection import to_geodetic
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import LocalFrame

_STATES = {
    AnchorStatus.OK: "located",
    AnchorStatus.AMBIGUOUS: "side uncertain",
    AnchorStatus.ILL_CONDITIONED: "poorly determined",
    AnchorStatus.NOT_CONVERGED: "no stable position",
    AnchorStatus.DOES_NOT_FIT: "ranges do not fit",
    AnchorStatus.MOVED: "probably moved",
    AnchorStatus.TOO_FEW_RANGES: "not located",
}
_OPTION = re.compile(r"--[a-z-]+")
_SMALL_S, _SMALL_M = 0.0005, 0.005  # less than this is not worth a sentence


def people_report(reconstruction: Reconstruction, proposed: Sequence[Improvement] = ()) -> str:
    """Return a report in Markdown.

    Parameters
    ----------
    reconstruction
        What to report.
    proposed
        What could be done would give, from :func:`gaia_uwb.evaluate.improvements`.

    Examples
    --------
    >>> from gaia_uwb.pipeline import reconstruct
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> report = people_report(reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0)))
    >>> print(report.splitlines()[2].partition(" The edge")[0])
    **Reliable.** All 8 cones were located.
    """
    limits = _all_limits(reconstruction)
    blocks = [
        f"# Work zone: {in_markdown(reconstruction.name)}",
        *_summary(reconstruction),
        "## What was found",
        _bullets(_found(reconstruction)),
        "## Confidence",
        _bullets(_sureness(reconstruction)),
        "## Limitations",
        *_limits(limits),
        "## How to improve the result",
        *_advice(limits),
        *_proposed(proposed, len(_located(reconstruction))),
        *_notes(reconstruction),
        "## The cones",
        "\n".join(_table(reconstruction)),
        "The map (`map.html`) shows all of this, and the ranges along the drive. `report.json` "
        "contains the same result for programs.",
    ]
    return "\n\n".join(blocks) + "\n"


def _bullets(lines: Iterator[str] | Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _located(reconstruction: Reconstruction) -> list[AnchorFix]:
    return [anchor for anchor in reconstruction.anchors if anchor.status.has_position]


def _summary(reconstruction: Reconstruction) -> Iterator[str]:
    n_cones = len(reconstruction.anchors)
    located = _of_all(len(_located(reconstruction)), n_cones)
    good = reconstruction.status is ReconstructionStatus.OK
    verdict = "Reliable." if good else "Needs review."
    verb = "was" if n_cones == 1 else "were"
    zone = _OPTION.sub(r"`\g<0>`", summary_words(reconstruction))
    yield f"**{verdict}** {located[:1].upper()}{located[1:]} {verb} located. {zone}"
    # Problems of single cones are stated here in plainer words, and below with numbers.
    others = [reason.text for reason in reconstruction.reasons if not reason.kind.is_anchor_status]
    if reconstruction.reasons:
        yield "Reasons:"
        yield _bullets([*map(in_markdown, others), *_doubtful_cones(reconstruction.anchors)])


def _doubtful_cones(anchors: Sequence[AnchorFix]) -> Iterator[str]:
    """Count the cones that are not simply located."""
    undecided = sum(anchor.side_is_open for anchor in anchors)
    if undecided:
        yield f"the side of the path is uncertain for {_of_all(undecided, len(anchors))}"
    for status, state in _STATES.items():
        count = sum(anchor.status is status for anchor in anchors)
        if count and status not in (AnchorStatus.OK, AnchorStatus.AMBIGUOUS):
            yield f"{_of_all(count, len(anchors))}: {state}"


def _of_all(count: int, n_cones: int) -> str:
    if n_cones == 1:
        return "the only cone" if count else "0 of 1 cone"
    if count == n_cones:
        return "both cones" if n_cones == 2 else f"all {n_cones} cones"
    return f"{count} of {n_cones} cones"


def _all_limits(reconstruction: Reconstruction) -> list[Limit]:
    """Return what limited the result; a limit of only one of several passes names that pass."""
    anchors, config = reconstruction.anchors, reconstruction.config
    episodes = [episode for episode, _ in reconstruction.passes]
    found = [
        (in_markdown(episode.name), limit)
        for episode in episodes
        for limit in find_limits(episode, anchors, config, name=in_markdown, passes=episodes)
    ]
    said = [limit for _, limit in found]
    of_logs = [
        limit if said.count(limit) == len(reconstruction.passes)
        else replace(limit, text=f"In {name}: {limit.text}")
        for k, (name, limit) in enumerate(found)
        if limit not in said[:k]
    ]  # fmt: skip
    return [*limits_of_reasons(reconstruction.reasons, name=in_markdown), *of_logs]


def _residual_m(reconstruction: Reconstruction) -> Float64[Array, "T N"]:
    """Return how far the ranges of all passes are off, without their signs."""
    residuals = [
        range_residual_m(episode, reconstruction.anchors) for episode, _ in reconstruction.passes
    ]
    return np.asarray(np.abs(np.concatenate(residuals)))


def _found(reconstruction: Reconstruction) -> Iterator[str]:
    road = reconstruction.road_boundary
    is_hull = hull_leads(road)
    if is_hull:
        yield from _hull(reconstruction, "The work zone")
    yield from zone_words(reconstruction, in_markdown)
    lost = [a for a in reconstruction.anchors if not a.status.has_position]
    if lost:
        names = ", ".join(in_markdown(anchor.anchor_id) for anchor in lost)
        yield f"Not located: {names}."
    used = (
        f"{sum(anchor.n_ranges for anchor in reconstruction.anchors)} ranges (measured distances) "
        f"to {len(reconstruction.anchors)} cones"
    )
    drives = []
    for episode, _ in reconstruction.passes:
        length_m = float(np.hypot(*np.diff(episode.position_m, axis=0).T).sum())
        drives.append(f"{metres(length_m)} in {episode.t_s[-1] - episode.t_s[0]:.1f} s")
    if reconstruction.more_passes:
        named = zip(reconstruction.passes, drives, strict=True)
        each = "; ".join(f"{in_markdown(e.name)} ({drive})" for (e, _), drive in named)
        yield f"{len(drives)} passes were combined: {each}. In total, they used {used}."
    else:
        yield f"The drive covered {drives[0]} and used {used}."
    if reconstruction.episode.frame is None:
        yield (
            "The log has no geographic reference: positions are in metres east and north of its "
            "own origin."
        )
    if not is_hull:
        yield from _hull(reconstruction, "The convex hull of the cones, the paper's boundary,")


def _hull(reconstruction: Reconstruction, subject: str) -> Iterator[str]:
    boundary = reconstruction.boundary
    if boundary.status is BoundaryStatus.OK:
        apart_m = np.hypot(*(boundary.hull_m[:, None] - boundary.hull_m).transpose(2, 0, 1))
        yield (
            f"{subject} has {len(boundary.hull_m)} corners and is {metres(apart_m.max())} long "
            f"at its longest; it covers {square_metres(boundary.area_m2)}."
        )


def _sureness(reconstruction: Reconstruction) -> Iterator[str]:
    located = _located(reconstruction)
    known = [anchor for anchor in located if np.isfinite(anchor.semi_axes_90_m[0])]
    if known:
        reach_m = [anchor.semi_axes_90_m[0] for anchor in known]
        worst = known[int(np.argmax(reach_m))]
        yield (
            f"The 90 % error radius is {metres(float(np.median(reach_m)))} for the median cone and "
            f"{metres(max(reach_m))} for the worst ({in_markdown(worst.anchor_id)})."
        )
    yield from _regions(reconstruction)
    if located:
        doubt = max(located, key=lambda anchor: anchor.mirror_probability)
        yield (
            "This assumes that each cone is on the side of the path shown. The other side has "
            f"{'' if doubt.mirror_probability < 0.01 else 'at most '}"
            f"{percent(doubt.mirror_probability)} probability ({in_markdown(doubt.anchor_id)})."
        )
    yield from _sources(located)
    if reconstruction.stated:
        yield (
            f"What was stated about the zone was used: "
            f"{'; '.join(map(in_markdown, reconstruction.stated))}. Sides and positions depend on "
            "it as well as on the ranges. If it is wrong, they may be wrong too."
        )
    residual_m = _residual_m(reconstruction)
    misfit_m = residual_m[np.isfinite(residual_m)]
    if misfit_m.size:
        half_m, most_m = np.quantile(misfit_m, [0.5, 0.95])
        yield (
            f"Half of the ranges fit these positions within {metres(half_m)}, and 95 % within "
            f"{metres(most_m)}."
        )
    for episode, _ in reconstruction.passes:
        where = f"In {in_markdown(episode.name)}: " if reconstruction.more_passes else ""
        yield from (where + line for line in _corrections(episode))
    yield (
        "All this is relative to the positions of the drive. An error in those positions (base "
        "station, datum) shifts all cones together and is not included above. It does not affect "
        "the size or shape of the zone."
    )


def _sources(located: Sequence[AnchorFix]) -> Iterator[str]:
    """Say how many sides the ranges decide by themselves, and what decides the others."""
    source = Counter(anchor.side_source for anchor in located if anchor.side_source is not None)
    if not source:
        return
    parts = [
        f"{source[SideSource.RANGES]} by the cones' own ranges alone",
        f"{source[SideSource.LAYOUT]} only with what is known of work zones",
        f"{source[SideSource.STATEMENT]} only with what was stated",
        f"{source[SideSource.OPEN]} not at all",
    ]
    asked = (True, True, source[SideSource.STATEMENT] > 0, source[SideSource.OPEN] > 0)
    told = [part for part, wanted in zip(parts, asked, strict=True) if wanted]
    yield f"Sides are decided: {', '.join(told[:-1])} and {told[-1]}."


def _regions(reconstruction: Reconstruction) -> Iterator[str]:
    road = reconstruction.road_boundary
    if road is not None and not hull_leads(road):
        yield from (closed_regions(zone.closed) for zone in road.zones if zone.closed is not None)
        return
    found = reconstruction.boundary_uncertainty
    if found is None:
        return
    sure, outer = percent(found.probability), square_metres(found.outer.area_m2)
    if found.inner.area_m2 > 0.0:
        inner = (
            f"A region of {square_metres(found.inner.area_m2)} lies inside the work zone with "
            f"{sure} confidence"
        )
    else:
        inner = f"No area can be called work zone with {sure} confidence"
    yield f"{inner}; the whole zone lies within a region of {outer} with {sure} confidence."


def _corrections(episode: Episode) -> Iterator[str]:
    clock, found = episode.clock, episode.calibration
    if clock is not None and clock.applied:
        way = "ahead of" if clock.offset_s > 0 else "behind"
        yield (
            f"The time stamps of the ranges were {abs(clock.offset_s):.3f} s {way} those of the "
            "positions. This was corrected, to "
            f"± {max(SIGMAS_90 * clock.sigma_s, 0.001):.3f} s (90 %)."
        )
    elif clock is not None and clock.sigma_s > _SMALL_S:
        yield (
            "The time stamps of ranges and positions were used as they are. They may differ by "
            f"± {max(SIGMAS_90 * clock.sigma_s, 0.001):.3f} s (90 %): {in_markdown(clock.reason)}."
        )
    bias_m = 0.0 if found is None else float(found.bias[0])
    if abs(bias_m) > _SMALL_M:
        way = "long" if bias_m > 0 else "short"
        yield (
            f"The ranges were {metres(abs(bias_m))} too {way} at 10 m, estimated from the log "
            "itself. This was corrected."
        )


def _limits(limits: Sequence[Limit]) -> Iterator[str]:
    if limits:
        yield _bullets([limit.text for limit in limits])
        return
    yield (
        "No check found one. Checked were clocks, path length, sides, geometry, number of ranges, "
        "gaps, line of sight, range bias and heights."
    )


def _advice(limits: Sequence[Limit]) -> Iterator[str]:
    wanted = {advice for limit in limits for advice in limit.advice}
    steps = [advice.value for advice in Advice if advice in wanted]
    if steps:
        yield "\n".join(f"{k}. {step}" for k, step in enumerate(steps, start=1))
    elif limits:
        yield "What could be advised about these limitations was done already."
    else:
        yield "Nothing in this log calls for another drive."


def _proposed(proposed: Sequence[Improvement], n_located: int) -> Iterator[str]:
    """Say in numbers what could be done would give."""
    if not proposed:
        return
    n_cones = proposed[0].n_cones
    some = "" if n_cones == n_located else f" (for {n_cones} of {n_located} cones)"
    yield (
        f"In numbers, computed{some} for this zone and this drive with errors as large as its log "
        "shows them, the cheapest first:"
    )
    rows = [["", "Sides left open", "Located without doubt", "90 % radius (m)"]]
    rows += [["---", "---:", "---:", "---:"]]
    rows += [
        [
            in_markdown(each.name[:1].upper() + each.name[1:]),
            f"{each.n_open} of {each.n_cones}",
            f"{each.n_ok} of {each.n_cones}",
            f"{each.radius_90_m:.2f}",
        ]
        for each in proposed
    ]
    yield "\n".join(map(_row, rows))
    enough = [each for each in proposed[1:] if each.n_ok == n_cones]
    if enough:
        yield f"The cheapest that locates all of them: **{in_markdown(enough[0].name)}**."


def _notes(reconstruction: Reconstruction) -> Iterator[str]:
    """Say what the readers of the logs took and left out."""
    if reconstruction.notes:
        yield "## How the log was read"
        yield _bullets([in_markdown(note) for note in reconstruction.notes])


def _table(reconstruction: Reconstruction) -> Iterator[str]:
    frame = reconstruction.episode.frame
    residual_m = _residual_m(reconstruction)
    names = ["Cone", "Status", "East (m)", "North (m)"]
    names += [] if frame is None else ["Latitude (°)", "Longitude (°)"]
    names += ["90 % radius (m)", "This side", "Ranges", "Median residual (m)"]
    yield _row(names)
    yield _row(["---", "---", *["---:"] * (len(names) - 2)])
    for anchor, column_m in zip(reconstruction.anchors, residual_m.T, strict=True):
        own_m = column_m[np.isfinite(column_m)]
        located = anchor.status.has_position
        yield _row([
            in_markdown(anchor.anchor_id),
            _STATES[anchor.status],
            *_place(frame, anchor.position_m),
            _number(anchor.semi_axes_90_m[0]),
            percent(1.0 - anchor.mirror_probability) if located else "",
            str(anchor.n_ranges),
            _number(float(np.median(own_m)) if own_m.size else np.nan),
        ])  # fmt: skip
        if anchor.side_is_open:
            place = _place(frame, anchor.mirror_position_m)
            yield _row([in_markdown(anchor.anchor_id), "other position", *place, "",
                        percent(anchor.mirror_probability), "", ""])  # fmt: skip


def _place(frame: LocalFrame | None, place_m: Float64[Array, "2"]) -> list[str]:
    """Return east and north and, with a frame, latitude and longitude; empty where unknown."""
    cells = [_number(float(value_m)) for value_m in place_m]
    if frame is None:
        return cells
    if not np.isfinite(place_m).all():
        return [*cells, "", ""]
    lat_deg, lon_deg, _ = to_geodetic(frame, place_m[None])
    return [*cells, f"{lat_deg[0]:.7f}", f"{lon_deg[0]:.7f}"]


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else ""
