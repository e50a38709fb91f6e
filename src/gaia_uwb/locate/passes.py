"""Several drives past one zone, made comparable: one frame, one list of anchors, nothing twice.

Passes are put into the order of their names, so that a result does not depend on the order in
which they are given. They share a frame if they have the same one or are all tied to WGS84, and are
brought into that of the first. The same drive must not count twice: two logs that hold the same
readings are refused, and windows of one run are joined into one pass that has each step once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode, EpisodeTruth, RangeReadings
from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame, Scene, tag_scenes

_FARTHEST_M = 50_000.0  # between a pass and the origin of the frame that it is brought into
_SAME_SHARE = 0.5  # of a log's readings: chance makes rounded ones agree, but never half of them


def in_one_frame(scenes: Sequence[Scene]) -> list[Scene]:
    """Sort passes of one zone by name and bring them into one frame.

    Parameters
    ----------
    scenes
        Logs of drives past the same zone, at least one. If none is tied to WGS84, they are taken
        to share their local frame. Of a vehicle with several tags, each tag is a pass of its own.

    Returns
    -------
    list of Scene
        In the frame of the first by name; names that are there twice get numbers.

    Raises
    ------
    InputError
        If there is no scene, only some are tied to WGS84, two are too far apart for one zone, or
        two logs hold the same drive.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> scene = simulate_pass(PRESETS["straight"], seed=0)
    >>> in_one_frame([scene, scene])
    Traceback (most recent call last):
    gaia_uwb.InputError: sim-0-0: the same drive as sim-0-0, so its readings would count twice
    """
    if not scenes:
        raise InputError("expected at least one pass, got none")
    ordered = sorted(scenes, key=_order)
    for k, scene in enumerate(ordered):
        for earlier in ordered[:k]:
            if same_drive(earlier, scene):
                problem = f"the same drive as {earlier.name}, so its readings would count twice"
                raise InputError(problem, source=scene.name)
    first = ordered[0].frame
    if first is None:
        tied = next((scene for scene in ordered if scene.frame is not None), None)
        if tied is not None:
            raise _no_common_frame(ordered[0], tied)
    else:
        loose = next((scene for scene in ordered if scene.frame is None), None)
        if loose is not None:
            raise _no_common_frame(loose, ordered[0])
        ordered = [in_frame(scene, first) for scene in ordered]
    names = [scene.name for scene in ordered]
    named = [
        replace(scene, name=f"{scene.name} ({names[: k + 1].count(scene.name)})")
        if names.count(scene.name) > 1
        else scene
        for k, scene in enumerate(ordered)
    ]
    by_tag = [one for scene in named for one in tag_scenes(scene)]
    return sorted(by_tag, key=lambda scene: scene.name)


def _order(scene: Scene) -> tuple[str, float, int, float]:
    log = scene.ranges
    return scene.name, float(log.t_s[0]), len(log), float(log.range_m.sum())


def _no_common_frame(loose: Scene, tied: Scene) -> InputError:
    return InputError(
        f"not tied to WGS84, but {tied.name} is, so the two have no common frame",
        source=loose.name,
    )


def same_drive(one: Scene, other: Scene) -> bool:
    """Tell whether two logs hold the same readings, in whole or in part.

    Parameters
    ----------
    one, other
        Two logs.

    Returns
    -------
    bool
        Whether the log with fewer readings in the time that both span shares more than half of
        these with the other: same time, same anchor, same range.
    """
    start_s = max(one.ranges.t_s[0], other.ranges.t_s[0])
    stop_s = min(one.ranges.t_s[-1], other.ranges.t_s[-1])
    if start_s > stop_s:
        return False
    readings = []
    for scene in (one, other):
        log = scene.ranges
        rows = np.flatnonzero((log.t_s >= start_s) & (log.t_s <= stop_s))
        names = [scene.anchor_ids[n] for n in log.anchor[rows]]
        readings.append(
            set(zip(log.t_s[rows].tolist(), names, log.range_m[rows].tolist(), strict=True))
        )
    fewer = min(len(rows) for rows in readings)
    return fewer > 0 and len(readings[0] & readings[1]) > _SAME_SHARE * fewer


def in_frame(scene: Scene, frame: LocalFrame) -> Scene:
    """Return a scene in another local frame; both are tied to WGS84.

    Parameters
    ----------
    scene
        Any log.
    frame
        The other frame.

    Raises
    ------
    InputError
        If they are too far apart for one zone.
    """
    if scene.frame is None or scene.frame == frame:
        return scene
    path = scene.trajectory
    position_m, up_m = _carried(scene.frame, frame, path.position_m, path.up_m)
    if np.abs(position_m).max() > _FARTHEST_M + np.abs(path.position_m).max():
        raise InputError(
            f"too far from the other passes to be of the same zone: "
            f"{np.abs(position_m).max():.0f} m from the origin of their frame",
            source=scene.name,
        )
    anchor_up_m = scene.anchor_up_m
    if anchor_up_m is not None:
        # Where the anchors stand is unknown, but near enough to the path for its change of height.
        middle_m = path.position_m.mean(axis=0, keepdims=True)
        _, raised_m = _carried(scene.frame, frame, middle_m, np.zeros(1))
        anchor_up_m = anchor_up_m + raised_m
    truth = scene.truth
    if truth is not None:
        anchor_m, _ = _carried(scene.frame, frame, truth.anchor_m, None)
        truth = replace(truth, anchor_m=anchor_m)
    return replace(
        scene,
        trajectory=replace(path, position_m=position_m, up_m=None if path.up_m is None else up_m),
        anchor_up_m=anchor_up_m,
        frame=frame,
        truth=truth,
    )


def _carried(
    old: LocalFrame,
    new: LocalFrame,
    position_m: Float64[Array, "R 2"],
    up_m: Float64[Array, "R"] | None,
) -> tuple[Float64[Array, "R 2"], Float64[Array, "R"]]:
    return to_local(new, *to_geodetic(old, position_m, up_m))


def join_windows(episodes: Sequence[Episode]) -> list[Episode]:
    """Join the windows that were cut from one run, so that each of its steps is there once.

    Parameters
    ----------
    episodes
        Prepared passes, or windows of them; windows of one run are known by the clock and the
        calibration that they have in common.

    Returns
    -------
    list of Episode
        One per run, in the order in which the runs first appear; a run with one window is that
        window. Without clock and calibration each episode is a run of its own.
    """
    runs: dict[object, list[Episode]] = {}
    for episode in episodes:
        alone = episode.clock is None and episode.calibration is None
        key = id(episode) if alone else (id(episode.clock), id(episode.calibration))
        runs.setdefault(key, []).append(episode)
    return [windows[0] if len(windows) == 1 else _joined(windows) for windows in runs.values()]


def _joined(windows: Sequence[Episode]) -> Episode:
    """Return the union of a run's windows; where they overlap they hold the same."""
    first = windows[0]
    if any(window.anchor_ids != first.anchor_ids for window in windows):
        raise InputError("windows of one run have different anchors", source=first.name)
    t_s, rows = np.unique(np.concatenate([w.t_s for w in windows]), return_index=True)
    return replace(
        first,
        name=first.name.partition("[")[0],
        t_s=t_s,
        position_m=np.concatenate([w.position_m for w in windows])[rows],
        range_m=np.concatenate([w.range_m for w in windows])[rows],
        valid=np.concatenate([w.valid for w in windows])[rows],
        tag_up_m=(
            None
            if first.tag_up_m is None
            else np.concatenate([w.tag_up_m for w in windows if w.tag_up_m is not None])[rows]
        ),
        truth=None,
        own_times=_joined_readings(windows),
        errors=first.run_errors,
        run_errors=None,
    )


def _joined_readings(windows: Sequence[Episode]) -> RangeReadings | None:
    """Return the readings of all windows of a run, each once."""
    known = [window.own_times for window in windows if window.own_times is not None]
    if len(known) < len(windows):
        return None

    def together(parts: Sequence[Array | None]) -> Array | None:
        there = [part for part in parts if part is not None]
        return np.concatenate(there) if len(there) == len(parts) else None

    joined = replace(
        known[0],
        t_s=np.concatenate([each.t_s for each in known]),
        anchor=np.concatenate([each.anchor for each in known]),
        range_m=np.concatenate([each.range_m for each in known]),
        azimuth_rad=together([each.azimuth_rad for each in known]),
        azimuth_sigma_rad=together([each.azimuth_sigma_rad for each in known]),
    )
    key = np.stack([joined.t_s, joined.anchor.astype(np.float64), joined.range_m])
    _, rows = np.unique(key, axis=1, return_index=True)
    return joined.rows(rows)


def all_anchors(episodes: Sequence[Episode]) -> tuple[str, ...]:
    """Return the anchors of all passes, each once, in the order in which they first appear.

    Parameters
    ----------
    episodes
        The passes.
    """
    return tuple(dict.fromkeys(name for e in episodes for name in e.anchor_ids))


def with_anchors(episode: Episode, anchor_ids: Sequence[str]) -> Episode:
    """Return an episode with all anchors of its zone; one that it never heard has no ranges.

    Parameters
    ----------
    episode
        One pass; its truth is dropped if it lacks an anchor.
    anchor_ids
        All anchors of the zone, those of the episode among them.
    """
    if episode.anchor_ids == tuple(anchor_ids):
        return episode
    column = _columns(episode, anchor_ids)
    up_m = episode.anchor_up_m
    return replace(
        episode,
        anchor_ids=tuple(anchor_ids),
        range_m=_spread(episode.range_m, column, np.nan),
        valid=_spread(episode.valid, column, False),
        anchor_up_m=None if up_m is None else _spread(up_m[None], column, np.nan)[0],
        truth=None,
    )


def with_anchor_ranges(
    ranges: DenoisedRanges, episode: Episode, anchor_ids: Sequence[str]
) -> DenoisedRanges:
    """Return denoised ranges with the columns of :func:`with_anchors`.

    Parameters
    ----------
    ranges
        What a denoiser made of the episode.
    episode
        The pass, with its own anchors.
    anchor_ids
        All anchors of the zone.
    """
    if episode.anchor_ids == tuple(anchor_ids):
        return ranges
    column = _columns(episode, anchor_ids)
    return DenoisedRanges(
        range_m=_spread(ranges.range_m, column, np.nan),
        sigma_m=_spread(ranges.sigma_m, column, np.nan),
        valid=_spread(ranges.valid, column, False),
    )


def _columns(episode: Episode, anchor_ids: Sequence[str]) -> list[int | None]:
    """Return where each of the zone's anchors stands among the episode's."""
    own = {name: n for n, name in enumerate(episode.anchor_ids)}
    return [own.get(name) for name in anchor_ids]


def _spread(values: Array, column: Sequence[int | None], missing: float | bool) -> Array:
    out = np.full((len(values), len(column)), missing, dtype=values.dtype)
    for n, own in enumerate(column):
        if own is not None:
            out[:, n] = values[:, own]
    return out


def starts_s(episodes: Sequence[Episode]) -> Float64[Array, "K"]:
    """Return when each pass starts if they are laid one after another, a second apart.

    Parameters
    ----------
    episodes
        The passes.
    """
    return np.cumsum([0.0] + [1.0 + float(np.ptp(e.t_s)) for e in episodes[:-1]])


def end_to_end(
    episodes: Sequence[Episode], denoised: Sequence[DenoisedRanges]
) -> tuple[Episode, DenoisedRanges]:
    """Lay passes one after another on one timeline, to count and to score them as one.

    Parameters
    ----------
    episodes, denoised
        Passes with the same anchors, and what a denoiser made of them.

    Returns
    -------
    (Episode, DenoisedRanges)
        A single pass as it is. Several without clock and calibration, which are each pass's own,
        and with truth where every pass has it; where two surveys of an anchor differ, their mean.
    """
    if len(episodes) == 1:
        return episodes[0], denoised[0]
    truths = [episode.truth for episode in episodes]
    known = [truth for truth in truths if truth is not None]
    truth = None
    if len(known) == len(truths):
        truth = EpisodeTruth(
            anchor_m=np.mean([t.anchor_m for t in known], axis=0),
            range_m=np.concatenate([t.range_m for t in known]),
            nlos=np.concatenate([t.nlos for t in known]),
        )
    joined = Episode(
        name=" + ".join(episode.name for episode in episodes),
        anchor_ids=episodes[0].anchor_ids,
        t_s=np.concatenate(
            [
                e.t_s - e.t_s[0] + start
                for e, start in zip(episodes, starts_s(episodes), strict=True)
            ]
        ),
        position_m=np.concatenate([e.position_m for e in episodes]),
        range_m=np.concatenate([e.range_m for e in episodes]),
        valid=np.concatenate([e.valid for e in episodes]),
        frame=episodes[0].frame,
        truth=truth,
    )
    return joined, DenoisedRanges(
        range_m=np.concatenate([r.range_m for r in denoised]),
        sigma_m=np.concatenate([r.sigma_m for r in denoised]),
        valid=np.concatenate([r.valid for r in denoised]),
    )
