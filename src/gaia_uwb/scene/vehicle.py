"""Where the vehicle was: its Trajectory, and each Tag on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import (
    Array,
    Float64,
    InputError,
    check_finite,
    check_increasing,
    check_shape,
    freeze,
)
from gaia_uwb.scene._unknown import freeze_known

_FURTHEST_M = 50.0  # of a tag from the vehicle's reference point, in each direction


@dataclass(frozen=True)
class Trajectory:
    """The known path of the tag's antenna, or of the vehicle that carries the tags.

    It is the path of the tag's antenna where a scene has no ``tags``, else that of the vehicle's
    reference point, from which the tags' lever arms count.

    Parameters
    ----------
    t_s : (T,)
        Strictly increasing time of the trajectory's clock, in seconds.
    position_m : (T, 2)
        East and north, in metres.
    up_m : (T,), optional
        Height in the local frame, in metres; ``None`` where heights are unknown (then every
        distance is taken as horizontal).
    heading_rad : (T,), optional
        Where the vehicle's front points, counter-clockwise from east; NaN where unknown.
    roll_rad, pitch_rad : (T,), optional
        Its attitude as in REP 103, right-handed about the vehicle's axes x (forward) and y (left):
        the left side is up where roll is positive, and the nose is down where pitch is. First the
        vehicle is rolled, then pitched, then turned to its heading. NaN where unknown.
    lever_m : (T, 2), optional
        East and north of the antenna from the vehicle's reference point, in metres, where the path
        was computed from that of the reference point (:func:`~gaia_uwb.scene.tag_scenes`).

    Raises
    ------
    InputError
        If shapes disagree, a number is not finite (or an angle infinite), time does not increase,
        or there are fewer than 2 samples.
    """

    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]
    up_m: Float64[Array, "T"] | None = None
    heading_rad: Float64[Array, "T"] | None = None
    roll_rad: Float64[Array, "T"] | None = None
    pitch_rad: Float64[Array, "T"] | None = None
    lever_m: Float64[Array, "T 2"] | None = None

    def __post_init__(self) -> None:
        t_s = freeze(self, "t_s", self.t_s, np.float64)
        position = freeze(self, "position_m", self.position_m, np.float64)
        if t_s.ndim != 1 or len(t_s) < 2:
            raise InputError(f"expected at least 2 samples, got {t_s.size}", column="t_s")
        check_shape("position_m", position, (len(t_s), 2))
        check_finite("t_s", t_s)
        check_finite("position_m", position)
        check_increasing("t_s", t_s, strictly=True)
        if self.up_m is not None:
            up = freeze(self, "up_m", self.up_m, np.float64)
            check_shape("up_m", up, t_s.shape)
            check_finite("up_m", up)
        for name in ("heading_rad", "roll_rad", "pitch_rad"):
            freeze_known(self, name, t_s.shape)
        if self.lever_m is not None:
            lever = freeze(self, "lever_m", self.lever_m, np.float64)
            check_shape("lever_m", lever, position.shape)
            check_finite("lever_m", lever)

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def position_noise_m(self) -> float:
        """White noise of the positions along each axis, in metres, by how they bend."""
        bend_m = np.diff(self.position_m, n=2, axis=0)  # of white noise: 6 times its variance
        return 1.4826 * float(np.median(np.abs(bend_m))) / np.sqrt(6.0) if len(bend_m) else 0.0

    @property
    def path_length_m(self) -> float:
        """Length of the path, in metres."""
        return float(np.hypot(*np.diff(self.position_m, axis=0).T).sum())


@dataclass(frozen=True)
class Tag:
    """One of the tags on a vehicle, and where its antenna sits.

    Parameters
    ----------
    tag_id
        Its name.
    forward_m, left_m, up_m
        The antenna from the vehicle's reference point, in metres, in the vehicle's frame as in
        REP 103: x forward, y left, z up.
    own_clock
        Its readings are stamped by a clock of its own, not by one that all tags share.

    Raises
    ------
    InputError
        If the name is empty, or a number is not finite or beyond 50 m.
    """

    tag_id: str
    forward_m: float = 0.0
    left_m: float = 0.0
    up_m: float = 0.0
    own_clock: bool = False

    def __post_init__(self) -> None:
        if not self.tag_id:
            raise InputError("tag ids must be non-empty text", column="tag_id")
        for name in ("forward_m", "left_m", "up_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and abs(value) <= _FURTHEST_M):
                raise InputError(
                    f"expected a number between -{_FURTHEST_M:g} and {_FURTHEST_M:g} for tag "
                    f"{self.tag_id}, got {value}",
                    column=name,
                )
