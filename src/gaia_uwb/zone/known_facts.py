"""What a user knows about a zone beforehand, and whether the ranges agree with it.

Four things can be stated (:class:`gaia_uwb.config.PriorConfig`): the side that the cones are on,
the type of closure, the spacing of neighbouring cones, and surveyed positions of some cones. Each
becomes a log likelihood ratio of every combination of sides, which ``sides.py`` adds to the ranges'
evidence; a surveyed position is also fused with the cone's own, and a spacing with those of its
neighbours.

Nothing is treated as certain: with the small probability ``statement_error`` a statement says
nothing at all, and where it holds it may be wrong for single cones or pairs. So a wrong statement
costs a bounded amount of evidence, and good ranges outvote it. Whether it holds is judged by the
ranges alone first, then with what is known of layouts (``statement.py``): what is contradicted is
reported and not used, so that it pulls no side that is open.

The side is that of the nearest stretch of path, in the direction of travel. A type of closure only
says that all cones are on one side, left or right; a median crossover says nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, ConfigError, Float64, Int64, some_of
from gaia_uwb.config import KnownAnchor, PriorConfig
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.locate import Hypotheses
from gaia_uwb.projection import to_local
from gaia_uwb.scene import LocalFrame
from gaia_uwb.zone.path_sides import PathSides
from gaia_uwb.zone.statement import Statement, said_words

_ANYWHERE_M2 = np.pi * 100.0**2  # where a cone may be whose surveyed place is wrong
_CONSISTENT = 13.8  # squared distance in standard deviations: 99.9 % of two coordinates are nearer
_NEIGHBOUR_SIGMA = 3.0
_CLEARLY_NOT = 0.05
_RULED_OUT = 1e-3  # probability by a cone's ranges alone that is enough against what was said of it
_ROUNDS = 3


@dataclass(frozen=True)
class KnownFacts:
    """What was stated about one zone, and the path of the drive.

    Parameters
    ----------
    prior
        What was said.
    path_m : (T, 2)
        The path, in the direction of travel, in metres.
    surveyed
        Surveyed places by the anchors' index: place (2,) and standard deviation, in metres.
    anchor_ids
        The anchors' names.
    """

    prior: PriorConfig
    path_m: Float64[Array, "T 2"]
    surveyed: Mapping[int, tuple[Float64[Array, "2"], float]]
    anchor_ids: tuple[str, ...]

    @classmethod
    def of(cls, prior: PriorConfig, episode: Episode) -> KnownFacts | None:
        """Return what is known, or None where nothing was said.

        Parameters
        ----------
        prior
            What was said.
        episode
            Path, anchors and frame.

        Raises
        ------
        ConfigError
            If there is no such anchor, or a place on Earth is given and the log has none.
        """
        if prior.says_nothing:
            return None
        surveyed = {}
        for known in prior.known_anchors:
            if known.anchor_id not in episode.anchor_ids:
                ids = ", ".join(episode.anchor_ids[:8])
                raise ConfigError(
                    f"known anchor {known.anchor_id!r}: not in the log, which has {ids}"
                )
            place_m = _surveyed_place(known, episode.frame)
            surveyed[episode.anchor_ids.index(known.anchor_id)] = (place_m, known.sigma_m)
        return cls(prior, episode.position_m, surveyed, episode.anchor_ids)

    @property
    def _path(self) -> PathSides:
        return PathSides(self.path_m)

    def statements(
        self, hypotheses: Hypotheses, located: Int64[Array, "M"], side: Int64[Array, "K M"]
    ) -> list[Statement]:
        """Return what each statement says of combinations of sides.

        Parameters
        ----------
        hypotheses
            Both places of each anchor, from its ranges alone.
        located : (M,)
            Indices of the anchors.
        side : (K, M)
            Which hypothesis each takes in each combination.
        """
        prior, found = self.prior, []
        if prior.side is not None or prior.closure is not None:
            left = self._path.left_probability(
                hypotheses.position_m[located], hypotheses.covariance_m2[located]
            )
            left = left[np.arange(len(located)), side]
        words = said_words(prior)
        if prior.side is not None:
            said = self._one_side(left if prior.side == "left" else 1.0 - left)
            found.append(self._statement(words["side"], "side", said))
        if "closure" in words:
            both = np.logaddexp(self._one_side(left), self._one_side(1.0 - left)) - np.log(2.0)
            found.append(self._statement(words["closure"], "closure", both))
        if prior.spacing_m is not None:
            spaced = self._spaced(hypotheses, located, side)
            found.append(self._statement(words["spacing_m"], "spacing_m", spaced))
        for index, (survey_m, sigma_m) in self.surveyed.items():
            if index in located:
                column = int(np.flatnonzero(located == index)[0])
                distance2, log_det = _misfit(hypotheses, index, survey_m, sigma_m)
                log_density = -0.5 * (distance2 + log_det) - np.log(2.0 * np.pi)
                ratio = (log_density + np.log(_ANYWHERE_M2))[side[:, column]]
                setting = f"known_anchors.{self.anchor_ids[index]}"
                found.append(self._statement(words[setting], setting, ratio))
        return found

    def borne_out(
        self,
        hypotheses: Hypotheses,
        located: Int64[Array, "M"],
        side: Int64[Array, "K M"],
        weight: Float64[Array, "K"],
        second: Float64[Array, "M"],
    ) -> tuple[KnownFacts | None, tuple[Reason, ...]]:
        """Return the facts that the ranges do not contradict, and reasons against the others.

        Parameters
        ----------
        hypotheses, located, side
            As in :meth:`statements`.
        weight : (K,)
            The combinations' probabilities without the facts.
        second : (M,)
            Probability of each anchor's second place by its ranges alone; NaN where they do not
            determine a place, and so contradict nothing.
        """
        share = np.stack([1.0 - second, second], axis=1)
        said = [
            self._by_ranges(statement, hypotheses, located, side, share)
            for statement in self.statements(hypotheses, located, side)
        ]
        against = [statement.contradiction(weight) for statement in said]
        holds = self.only([reason is None for reason in against], said)
        return holds, tuple(reason for reason in against if reason is not None)

    def only(self, holds: Sequence[bool], said: Sequence[Statement]) -> KnownFacts | None:
        """Return the facts without the statements that do not hold; None if none does.

        Parameters
        ----------
        holds
            Whether each of the statements does.
        said
            The statements.
        """
        dropped = {s.setting for s, right in zip(said, holds, strict=True) if not right}
        if len(dropped) == len(said):
            return None
        changes = {setting: None for setting in dropped if setting in type(self.prior).model_fields}
        surveyed = {
            k: place
            for k, place in self.surveyed.items()
            if f"known_anchors.{self.anchor_ids[k]}" not in dropped
        }
        return replace(self, prior=self.prior.model_copy(update=changes), surveyed=surveyed)

    def exceptions(
        self,
        place_m: Float64[Array, "M 2"],
        covariance_m2: Float64[Array, "M 2 2"],
        located: Int64[Array, "M"],
        reasons: Sequence[Reason],
    ) -> tuple[Reason, ...]:
        """Name the cones that are clearly not on the stated side, if there are any.

        Parameters
        ----------
        place_m, covariance_m2 : (M, 2), (M, 2, 2)
            Where the cones were found, in metres, and how certain that is.
        located : (M,)
            Their indices.
        reasons
            Reasons already found against a statement: one that is not used has no exceptions.
        """
        side = self.prior.side
        is_dropped = any("side" in reason.statements for reason in reasons)
        if side is None or is_dropped or not len(located):
            return ()
        left = self._path.left_probability(place_m[:, None], covariance_m2[:, None])[:, 0]
        holds = left if side == "left" else 1.0 - left
        wrong = self._names(located[holds < _CLEARLY_NOT])
        if not wrong:
            return ()
        other = "right" if side == "left" else "left"
        text = (
            f"the ranges place {some_of(wrong)} on the {other}; all cones were stated to be on the "
            f"{side}"
        )
        return (Reason(ReasonKind.EXCEPTION, text, cones=wrong, statements=("side",)),)

    def _names(self, indices: Int64[Array, "_"]) -> tuple[str, ...]:
        return tuple(self.anchor_ids[n] for n in indices.tolist())

    def _by_ranges(
        self,
        statement: Statement,
        hypotheses: Hypotheses,
        located: Int64[Array, "M"],
        side: Int64[Array, "K M"],
        share: Float64[Array, "M 2"],
    ) -> Statement:
        """Return a statement with what the ranges alone say of it.

        ``share`` is the probability of both places of each cone; sides are independent. NaN where a
        cone says nothing.
        """
        says = np.isfinite(share[:, 0])
        if not says.any():
            return statement
        located, side, share = located[says], side[:, says], share[says]
        if statement.setting in ("side", "closure"):
            left = self._path.left_probability(
                hypotheses.position_m[located], hypotheses.covariance_m2[located]
            )
            ratio = [
                float(np.exp(np.log((share * self._of_cone(holds)).sum(axis=1)).sum()))
                for holds in (left, 1.0 - left)
            ]
            on_left = (share * left).sum(axis=1)
            not_left, not_right = (located[p < _RULED_OUT] for p in (on_left, 1.0 - on_left))
            if statement.setting == "closure":
                few = min(not_left, not_right, key=len)
                return replace(statement, by_ranges=0.5 * sum(ratio), ruled_out=self._names(few))
            k = 0 if self.prior.side == "left" else 1
            return replace(
                statement, by_ranges=ratio[k], ruled_out=self._names((not_left, not_right)[k])
            )
        log_weight = np.log(np.maximum(share, 1e-300))[np.arange(len(located)), side].sum(axis=1)
        weight = np.exp(log_weight - log_weight.max())
        return replace(statement, by_ranges=statement.bayes_factor(weight))

    def _statement(self, words: str, setting: str, log_ratio: Float64[Array, "K"]) -> Statement:
        error = self.prior.statement_error
        return Statement(words, setting, np.logaddexp(np.log(error), np.log1p(-error) + log_ratio))

    def _one_side(self, holds: Float64[Array, "K M"]) -> Float64[Array, "K"]:
        """Return the log ratio of a side that holds of each cone but for single mistakes.

        ``holds`` is the probability that the cone stands there, given its place's error.
        """
        return np.asarray(np.log(self._of_cone(holds)).sum(axis=1))

    def _of_cone(self, holds: Float64[Array, "_ _"]) -> Float64[Array, "_ _"]:
        """Return how much likelier each place is if all cones but for mistakes are on a side."""
        error = self.prior.statement_error
        return np.asarray(2.0 * ((1.0 - error) * holds + error * (1.0 - holds)))

    def _spaced(
        self, hypotheses: Hypotheses, located: Int64[Array, "M"], side: Int64[Array, "K M"]
    ) -> Float64[Array, "K"]:
        """Return the log ratio of the distances between neighbours."""
        spacing_m, error = self.prior.spacing_m, self.prior.statement_error
        if spacing_m is None or side.shape[1] < 2:
            return np.zeros(len(side))
        order = self._path.order(hypotheses.position_m[located], side)
        chosen = np.take_along_axis(side, order, axis=1)
        place_m = hypotheses.position_m[located[order], chosen]
        covariance_m2 = hypotheses.covariance_m2[located[order], chosen]
        distance_m, unit = _distances(place_m)
        both = covariance_m2[:, 1:] + covariance_m2[:, :-1]
        variance_m2 = np.einsum("kpi,kpij,kpj->kp", unit, both, unit)
        variance_m2 = variance_m2 + self.prior.spacing_sigma_m**2
        density = np.exp(-0.5 * (distance_m - spacing_m) ** 2 / variance_m2)
        density /= np.sqrt(2.0 * np.pi * variance_m2)
        elsewhere = 1.0 / (5.0 * spacing_m)
        return np.asarray(np.log((1.0 - error) * density / elsewhere + error).sum(axis=1))

    def with_surveys(self, hypotheses: Hypotheses) -> Hypotheses:
        """Fuse surveyed positions with the hypotheses that they agree with.

        What a survey says of the errors that all anchors share (a clock offset shifts them all
        along the road) moves the others with it.

        Parameters
        ----------
        hypotheses
            Both places of each anchor, from its ranges alone.
        """
        for index, (survey_m, sigma_m) in self.surveyed.items():
            hypotheses = _with_survey(hypotheses, index, survey_m, sigma_m)
        return hypotheses

    def with_spacing(
        self, place_m: Float64[Array, "M 2"], own_m2: Float64[Array, "M 2 2"]
    ) -> tuple[Float64[Array, "M 2"], Float64[Array, "M 2 2"]]:
        """Pull neighbours to their known distance, where they are not clearly off it.

        Parameters
        ----------
        place_m, own_m2 : (M, 2), (M, 2, 2)
            Places, and the part of their covariances that is each anchor's own.
        """
        spacing_m = self.prior.spacing_m
        if spacing_m is None or len(place_m) < 2:
            return place_m, own_m2
        side = np.zeros((1, len(place_m)), dtype=np.int64)
        order = self._path.order(np.repeat(place_m[:, None], 2, axis=1), side)[0]
        first, second = order[:-1], order[1:]
        m = len(place_m)
        prior = np.zeros((2 * m, 2 * m))
        for k in range(m):
            prior[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = own_m2[k]
        mean, now = place_m.ravel(), place_m.ravel()
        covariance = prior
        for _ in range(_ROUNDS):
            places = now.reshape(-1, 2)
            apart = places[second] - places[first]
            distance_m = np.maximum(np.hypot(apart[:, 0], apart[:, 1]), 1e-9)
            unit = apart / distance_m[:, None]
            rows = np.arange(m - 1)
            slope = np.zeros((m - 1, 2 * m))
            for axis in (0, 1):
                slope[rows, 2 * second + axis] = unit[:, axis]
                slope[rows, 2 * first + axis] = -unit[:, axis]
            spread = slope @ prior @ slope.T + self.prior.spacing_sigma_m**2 * np.eye(m - 1)
            off_m = spacing_m - distance_m - slope @ (mean - now)
            near = np.abs(off_m) < _NEIGHBOUR_SIGMA * np.sqrt(np.diag(spread))
            slope, off_m, spread = slope[near], off_m[near], spread[np.ix_(near, near)]
            gain = prior @ slope.T @ np.linalg.inv(spread)
            now = mean + gain @ off_m
            covariance = prior - gain @ slope @ prior
        blocks = covariance.reshape(m, 2, m, 2)[np.arange(m), :, np.arange(m)]
        return now.reshape(-1, 2), np.asarray(0.5 * (blocks + np.swapaxes(blocks, 1, 2)))


def _surveyed_place(known: KnownAnchor, frame: LocalFrame | None) -> Float64[Array, "2"]:
    if known.east_m is not None and known.north_m is not None:
        return np.array([known.east_m, known.north_m])
    if frame is None:
        raise ConfigError(
            f"known anchor {known.anchor_id!r}: the log has no geographic reference, so give "
            "east and north"
        )
    place_m, _ = to_local(frame, np.array([known.lat_deg]), np.array([known.lon_deg]))
    return np.asarray(place_m[0])


def _misfit(
    hypotheses: Hypotheses, index: int, survey_m: Float64[Array, "2"], sigma_m: float
) -> tuple[Float64[Array, "2"], Float64[Array, "2"]]:
    """Return how far a survey is from both places, squared and scaled, and log determinants."""
    covariance_m2 = hypotheses.covariance_m2[index]
    covariance_m2 = np.nan_to_num(covariance_m2, nan=0.0, posinf=1e12) + sigma_m**2 * np.eye(2)
    off_m = survey_m - hypotheses.position_m[index]
    scaled = np.linalg.solve(covariance_m2, off_m[..., None])[..., 0]
    return (off_m * scaled).sum(axis=1), np.linalg.slogdet(covariance_m2)[1]


def _with_survey(
    hypotheses: Hypotheses, index: int, survey_m: Float64[Array, "2"], sigma_m: float
) -> Hypotheses:
    """Return both places of all anchors, given where one of them stands."""
    distance2, _ = _misfit(hypotheses, index, survey_m, sigma_m)
    agreeing = distance2 < _CONSISTENT
    if not agreeing.any():
        return hypotheses
    before_m2, shared_m = hypotheses.covariance_m2, hypotheses.shared_m
    position_m, covariance_m2 = hypotheses.position_m.copy(), before_m2.copy()
    off_m = survey_m - position_m[index]
    gain = before_m2[index] @ np.linalg.inv(before_m2[index] + sigma_m**2 * np.eye(2))
    stays = np.eye(2) - gain
    if shared_m is not None:
        own_m = shared_m[index]
        best = int(np.argmin(distance2))
        told = own_m[best].T @ np.linalg.inv(before_m2[index, best] + sigma_m**2 * np.eye(2))
        left = np.linalg.cholesky(np.eye(own_m.shape[-1]) - told @ own_m[best])
        position_m += shared_m @ (told @ off_m[best])
        moved_m = shared_m @ left
        covariance_m2 += moved_m @ np.swapaxes(moved_m, -1, -2)
        covariance_m2 -= shared_m @ np.swapaxes(shared_m, -1, -2)
        moved_m[index, agreeing] = (stays @ own_m @ np.linalg.inv(left).T)[agreeing]
        shared_m = moved_m
    fused_m = hypotheses.position_m[index] + (gain @ off_m[..., None])[..., 0]
    position_m[index, agreeing] = fused_m[agreeing]
    covariance_m2[index, agreeing] = (stays @ before_m2[index])[agreeing]
    return replace(
        hypotheses, position_m=position_m, covariance_m2=covariance_m2, shared_m=shared_m
    )


def _distances(
    place_m: Float64[Array, "K M 2"],
) -> tuple[Float64[Array, "K P"], Float64[Array, "K P 2"]]:
    """Return distances and directions from each place to the next."""
    apart = np.diff(place_m, axis=1)
    distance_m = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), 1e-9)
    return distance_m, apart / distance_m[..., None]
