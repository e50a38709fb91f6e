r"""One estimator for everything that the ranges of a zone depend on.

A range to cone n in drive k, stamped t, is modelled as::

    z = d + b0 + b1 g(d) + beta_k + rho_k(bearing - course)
          + delta_n + h_n(bearing) + f_nk(place) + e

with ``d`` the slant distance from the cone to where the tag was at ``t - tau_k``. Unknown are

- the place of every cone, on both sides of the path;
- its own delay ``delta_n``, and the pattern ``h_n`` of its antenna and surroundings, a harmonic of
  the bearing: errors that belong to a direction, so that no number of passes averages them out;
- the range bias of the radios: offset ``b0`` and growth ``b1``, with ``g = log10(d / 10 m)``;
- of every drive its clock offset ``tau_k``, what its tag adds to the bias, ``beta_k``, and the
  pattern ``rho_k`` of its tag on its vehicle, two harmonics of the bearing from the course;
- slow errors ``f_nk``: a Gaussian random field over the places of the tag, of four correlation
  lengths from 1 to 64 m (walls, other vehicles, multipath), independent from cone to cone and drive
  to drive;
- noise ``e``, which is Student-t and alike in neighbouring readings, and stretches of readings
  without line of sight (``range_model.py``).

All but the places have Gaussian priors of centimetres. How large delays, patterns, slow errors and
noise are, and how many readings are outliers, is estimated from the log by restricted maximum
likelihood, and drawn towards what radios have: a short log cannot tell.

Given the places, the delays and what drives share, drives are independent, and so are cones. So the
normal equations form an arrow: a small block for each cone, and one for what is shared, which is
solved by its Schur complement. The work grows linearly with readings and cones.

Many zones are fitted at once (windows of a run); each gets what it would get alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.episode import ErrorSizes
from gaia_uwb.locate.error_sizes import (
    LEAST_NOISE_M,
    KeptSizes,
    SizeSums,
    sizes_of_cones,
    sizes_of_errors,
)
from gaia_uwb.locate.evidence import Evidence
from gaia_uwb.locate.kept_prior import KeptPrior
from gaia_uwb.locate.slow_errors import DRIVE, OWN, RADIOS, SlowErrors, Sums

SIZES = ("noise_m", "alike", "outlier_share", "field_m", "delay_m", "pattern_m")

_ROUGH_M = (1.0, 1.0, 1.0, 0.5, 0.5, 0.25, 0.25)  # noise assumed while places may be far off
_AGAIN_M = (0.5, 0.25, 0.25)  # the same once clocks and bias are roughly known
_FINER_M = (0.15, 0.1, 0.07, 0.05)  # noise assumed at least while slow errors become known
_SETTLED = 4  # steps in which slow errors and outliers become known where nothing else changes
STEPS = 8
"""Steps in which the sizes of the errors are estimated."""
_LONGEST_STEP_M, _LONGEST_STEP_S = 3.0, 0.3
_LONGEST_SHARE, _SHORT_M = 0.3, 0.1  # of the distance; a step that is never too long
_ANYWHERE_M = 1e3  # prior standard deviation of a place
ALIKE = 2.0
"""Errors are alike in ways that no model holds: what adds up over many readings counts half.

``benchmarks/quality/side_odds.py`` shows how often sides are wrong at which odds."""
_BY_CONE = ("own", "covariance", "shared_m", "loss", "step", "outliers", "noise")
_BY_ZONE = ("shared", "shared_covariance")


@dataclass(frozen=True)
class SharedPrior:
    """What is known beforehand of what the cones of a zone have in common.

    Parameters
    ----------
    mean : (Z, S)
        Of each zone: bias, growth, and the unknowns of each of its K drives; S = 2 + 6 K.
    precision : (Z, S, S)
        Inverse covariance.
    """

    mean: Float64[Array, "Z S"]
    precision: Float64[Array, "Z S S"]


@dataclass(frozen=True)
class ZoneFit:
    """What a fit says of N cones and Z zones.

    Parameters
    ----------
    own : (N, 2, 5)
        Cone, side, (east, north, delay, pattern), in metres.
    covariance : (N, 2, 2, 2)
        Covariance of both places of each cone, in square metres.
    shared_m : (N, 2, 2, S)
        How each place moves when the shared estimates fall by the columns of a root of their
        covariance (Cholesky's); part of ``covariance``.
    loss : (N, 2)
        Negative log evidence of each side.
    shared : (Z, S)
        Estimates of what is shared.
    shared_covariance : (Z, S, S)
        Their covariance.
    sizes : list of ErrorSizes
        Of each zone.
    step : (N, 2)
        By how many standard deviations each place moved in the last step.
    outliers : (N, 2)
        Share of each cone's readings that are outliers.
    noise : (N, 2)
        Mean square of each cone's other residuals, as a multiple of what the zone's noise says.
    """

    own: Float64[Array, "N 2 5"]
    covariance: Float64[Array, "N 2 2 2"]
    shared_m: Float64[Array, "N 2 2 S"]
    loss: Float64[Array, "N 2"]
    shared: Float64[Array, "Z S"]
    shared_covariance: Float64[Array, "Z S S"]
    sizes: list[ErrorSizes]
    step: Float64[Array, "N 2"]
    outliers: Float64[Array, "N 2"]
    noise: Float64[Array, "N 2"]

    def of(self, zone: int, cones: slice) -> ZoneFit:
        """Return the fit of one zone, the better-fitting side of each cone first.

        Parameters
        ----------
        zone
            Which zone.
        cones
            Its cones.
        """
        # To a millionth: of two sides that fit alike, the order must not hang on rounding.
        order = np.argsort(self.loss[cones].round(6), axis=1, kind="stable")
        rows = np.arange(len(order))[:, None]
        sorted_ = {name: getattr(self, name)[cones][rows, order] for name in _BY_CONE}
        of_zone = {name: getattr(self, name)[zone : zone + 1] for name in _BY_ZONE}
        return ZoneFit(**sorted_, **of_zone, sizes=self.sizes[zone : zone + 1])

    def where(
        self, zones: Bool[Array, "Z"], cone_zone: Int64[Array, "N"], otherwise: ZoneFit
    ) -> ZoneFit:
        """Return this fit for some zones and another one for the others.

        Parameters
        ----------
        zones : (Z,)
            Which zones.
        cone_zone : (N,)
            Zone of each cone.
        otherwise
            The other fit.
        """
        chosen = {}
        for name in _BY_CONE:
            mine, other = getattr(self, name), getattr(otherwise, name)
            cones = zones[cone_zone].reshape(-1, *[1] * (mine.ndim - 1))
            chosen[name] = np.where(cones, mine, other)
        for name in _BY_ZONE:
            mine, other = getattr(self, name), getattr(otherwise, name)
            chosen[name] = np.where(zones.reshape(-1, *[1] * (mine.ndim - 1)), mine, other)
        sizes = [
            own if new else old
            for new, own, old in zip(zones, self.sizes, otherwise.sizes, strict=True)
        ]
        return ZoneFit(**chosen, sizes=sizes)


@dataclass(frozen=True)
class State:
    """All estimates of an :class:`Estimator` at one moment."""

    own: Float64[Array, "N 2 5"]
    weight: Float64[Array, "N 2"]
    shared: Float64[Array, "Z S"]
    sizes: dict[str, Array]
    fields: list[tuple[Array, ...]]


@dataclass(frozen=True)
class Layout:
    """Which cones and drives belong together.

    Parameters
    ----------
    cone_zone : (N,)
        Zone of each cone.
    drive_zone, drive_slot : (D,)
        Zone of each drive, and its number there.
    speed_noise_mps : (D,)
        Noise of the path's speed, along each axis: of motion that no range shows.
    """

    cone_zone: Int64[Array, "N"]
    drive_zone: Int64[Array, "D"]
    drive_slot: Int64[Array, "D"]
    speed_noise_mps: Float64[Array, "D"]


@dataclass(frozen=True)
class SizesPrior:
    """What is known beforehand of how large the errors of each zone's ranges are.

    Parameters
    ----------
    sizes
        By zone: where estimates start.
    settled : (Z,)
        Whether these are known, so that they are not estimated.
    least_noise_m : (Z,)
        Least white noise, in metres.
    """

    sizes: Sequence[ErrorSizes]
    settled: Bool[Array, "Z"]
    least_noise_m: Float64[Array, "Z"]


class Estimator:
    """A fit in progress.

    Parameters
    ----------
    evidence
        The readings of all zones, by groups of cones.
    layout
        Which cones and drives belong to which zone.
    prior
        Of what is shared.
    errors
        Of the sizes of errors.
    kept
        What is known of the cones of a single zone; None: what is usual.
    """

    def __init__(
        self,
        evidence: Sequence[Evidence],
        layout: Layout,
        prior: SharedPrior,
        errors: SizesPrior,
        kept: KeptPrior | None = None,
    ) -> None:
        self._kept = kept
        self._zone = layout.cone_zone
        self._drive_zone, self._drive_slot = layout.drive_zone, layout.drive_slot
        self._speed_noise_mps = layout.speed_noise_mps
        self._prior, self._settled = prior, errors.settled
        self._sizes = {name: np.array([getattr(s, name) for s in errors.sizes]) for name in SIZES}
        self._least_noise_m = np.maximum(errors.least_noise_m, LEAST_NOISE_M)
        self._own = np.zeros((len(self._zone), 2, OWN))
        self._weight = np.full((len(self._zone), 2), 0.5)
        self._shared = prior.mean.copy()
        self._fields = [SlowErrors(each, self.offset_s) for each in evidence]
        self.own_covariance = np.zeros((*self._own.shape, OWN))
        """Of each cone's own unknowns at the last step, given what is shared; (N, 2, 5, 5)."""

    @property
    def offset_s(self) -> Float64[Array, "D"]:
        """The clock offset of every drive."""
        column = RADIOS + DRIVE * self._drive_slot
        return np.asarray(self._shared[self._drive_zone, column])

    def bias_m(self, cone: Int64[Array, "R"], range_m: Float64[Array, "R"]) -> Float64[Array, "R"]:
        """Return the range bias, by now, of readings of these cones."""
        bias, growth = self._shared[self._zone[cone], :RADIOS].T
        return np.asarray(bias + growth * np.log10(np.maximum(range_m, 0.5) / 10.0))

    def place(self, position_m: Float64[Array, "N 2 2"]) -> None:
        """Put both places of every cone somewhere; without a delay or slow errors.

        Parameters
        ----------
        position_m : (N, 2, 2)
            Cone, side, (east, north).
        """
        self._own[:] = 0.0
        self._own[..., :2] = position_m
        self._weight[:] = 0.5
        for field in self._fields:
            field.forget()

    def rough(self, *, again: bool = False) -> None:
        """Take the first steps, with less and less noise assumed: places may be far off.

        Parameters
        ----------
        again
            Whether clocks and bias are roughly known.
        """
        for noise_m in _AGAIN_M if again else _ROUGH_M:
            self._step(noise_m)

    def finer(self) -> None:
        """Take the steps in between: the noise is estimated, but not believed to be small yet."""
        for least_m in _FINER_M:
            self._step(None, least_m)

    def refine(self, steps: int = STEPS) -> ZoneFit:
        """Take the other steps, in which the sizes of the errors are estimated, too.

        Parameters
        ----------
        steps
            How many.
        """
        for _ in range(steps):
            fit = self._step(None)
        return fit

    def state(self) -> State:
        """Return all estimates as they are by now."""
        fields = [field.state() for field in self._fields]
        sizes = {name: values.copy() for name, values in self._sizes.items()}
        return State(self._own.copy(), self._weight.copy(), self._shared.copy(), sizes, fields)

    def restart(self, state: State, zones: Bool[Array, "Z"]) -> None:
        """Put the estimates of some zones back to what they were.

        Parameters
        ----------
        state
            What they were.
        zones : (Z,)
            Which zones.
        """
        cones = zones[self._zone]
        self._own[cones], self._weight[cones] = state.own[cones], state.weight[cones]
        self._shared[zones] = state.shared[zones]
        for name, values in state.sizes.items():
            self._sizes[name][zones] = values[zones]
        for field, before in zip(self._fields, state.fields, strict=True):
            field.restart(before, cones)

    def _step(self, rough_m: float | None, least_m: float = 0.0) -> ZoneFit:
        """Take one step in all unknowns; with ``rough_m`` as the noise where it is given."""
        sizes, zone = self._sizes, self._zone
        noise_m = sizes["noise_m"] if rough_m is None else np.full(len(self._shared), rough_m)
        noise_m = np.maximum(noise_m, least_m)
        share = sizes["outlier_share"] if rough_m is None else np.zeros(len(self._shared))
        sums = self._summed(noise_m, share)
        matrix, gradient, loss = self._with_own_prior(sums)
        inverse = self.own_covariance = np.linalg.inv(matrix)
        through = inverse @ sums.cross  # (N, 2, 5, S)
        loss += 0.5 * np.linalg.slogdet(matrix)[1]
        back = np.swapaxes(through, -1, -2)
        sums.shared -= back @ sums.cross
        sums.shared_gradient -= (back @ gradient[..., None])[..., 0]
        weight = self._weight[..., None]
        told = (weight[..., None] * sums.shared).sum(axis=1)  # what each cone says, (N, S, S)
        pulls = (weight * sums.shared_gradient).sum(axis=1)
        precise = self._prior.precision
        off = self._shared - self._prior.mean
        data = np.zeros_like(precise)
        np.add.at(data, zone, told)
        towards = -(precise @ off[..., None])[..., 0]
        np.add.at(towards, zone, pulls)
        covariance = np.linalg.inv(data + precise)
        loss += _of_others(sums, (data + precise)[zone] - told, towards[zone] - pulls)
        change = (covariance @ towards[..., None])[..., 0]
        own_change, change = self._step_length(inverse, gradient, through, change)
        self._stay_on_both_sides(own_change)
        for field in self._fields:
            cones = field.evidence.cones
            field.follow(own_change[cones], change[zone[cones]])
        if rough_m is None:
            self._update_sizes(sums, inverse, noise_m)
        self._move(own_change, change)
        self._weight = _softmax(-loss)
        honest = np.linalg.inv(self._without_noise_of_speed(data) / ALIKE + precise)
        root = np.linalg.cholesky(honest)
        shared_m = (through @ root[zone][:, None])[..., :2, :]
        places_m2 = inverse[..., :2, :2] + shared_m @ np.swapaxes(shared_m, -1, -2)
        count = np.maximum(sums.count, 1.0)
        return ZoneFit(
            own=self._own.copy(),
            covariance=places_m2,
            shared_m=shared_m,
            loss=loss,
            shared=self._shared.copy(),
            shared_covariance=honest,
            sizes=[ErrorSizes(**{k: sizes[k][z] for k in SIZES}) for z in range(len(off))],
            step=_standardised(own_change[..., :2], places_m2),
            outliers=sums.outliers / count,
            noise=sums.squares / np.maximum(count - sums.outliers, 1.0),
        )

    def _with_own_prior(self, sums: Sums) -> tuple[Array, Array, Float64[Array, "N 2"]]:
        """Return what readings and priors say of each cone: matrix, gradient and loss."""
        if self._kept is not None:
            off = self._own - self._kept.mean
            back_to = (self._kept.precision @ off[..., None])[..., 0]
            loss = sums.loss + self._kept.loss + 0.5 * (off * back_to).sum(axis=-1)
            return sums.matrix + self._kept.precision, sums.gradient - back_to, loss
        sizes = self._sizes
        precision = np.empty((len(sizes["delay_m"]), OWN))
        precision[:, :2] = _ANYWHERE_M**-2
        precision[:, 2] = sizes["delay_m"] ** -2.0
        precision[:, 3:] = sizes["pattern_m"][:, None] ** -2.0
        prior = precision[self._zone][:, None]  # (N, 1, 5)
        matrix = sums.matrix + prior[..., None] * np.eye(OWN)
        gradient = sums.gradient - prior * self._own
        loss = sums.loss + 0.5 * (prior * self._own**2)[..., 2:].sum(axis=-1)
        return matrix, gradient, loss

    def _summed(self, noise_m: Float64[Array, "Z"], hidden_share: Float64[Array, "Z"]) -> Sums:
        """Return what all readings say near the estimates by now."""
        sizes, zone = self._sizes, self._zone
        sums = Sums.zeros(len(zone), self._shared.shape[1])
        offset_s = self.offset_s
        for field in self._fields:
            cones = field.evidence.cones
            field.linearise(
                self._own[cones],
                self._shared[zone[cones]],
                offset_s,
                self._drive_slot,
                noise_m[zone[cones]],
                sizes["alike"][zone[cones]],
                hidden_share[zone[cones]],
            )
            field.add_to(sums, sizes["field_m"][zone[cones]], self._drive_slot)
        return sums

    def start(self, own: Float64[Array, "N 2 5"], shared: Float64[Array, "Z S"]) -> None:
        """Put all estimates somewhere, without slow errors.

        Parameters
        ----------
        own : (N, 2, 5)
            Of each cone.
        shared : (Z, S)
            Of what is shared.
        """
        self.place(own[..., :2])
        self._own[:], self._shared[:] = own, shared

    def settle(self, weight: Float64[Array, "N 2"]) -> Sums:
        """Return what all readings say at these very estimates: only slow errors are estimated.

        Parameters
        ----------
        weight : (N, 2)
            Probability of each side.
        """
        self._weight = weight.copy()
        nowhere, unchanged = np.zeros_like(self._own), np.zeros_like(self._shared)
        for _ in range(_SETTLED):
            sums = self._summed(self._sizes["noise_m"], self._sizes["outlier_share"])
            for field in self._fields:
                cones = field.evidence.cones
                field.follow(nowhere[cones], unchanged[self._zone[cones]])
        for field in self._fields:
            field.add_freedom(sums)
        return sums

    def size_sums(self, sums: Sums, inverse: Float64[Array, "N 2 5 5"]) -> KeptSizes:
        """Return what the residuals of a single zone say of the sizes of its errors.

        Parameters
        ----------
        sums
            Of :meth:`settle`.
        inverse : (N, 2, 5, 5)
            Covariance of each cone's unknowns, given what is shared.
        """
        explained = np.zeros_like(sums.freedom)
        for field in self._fields:
            explained[field.evidence.cones] += field.explained()
        spent = np.einsum("nsij,nslji->nsl", inverse, sums.spent)
        noise_m2 = self._sizes["noise_m"][0] ** 2

        def total(values: Float64[Array, "N 2 *rest"]) -> Array:
            return np.asarray(np.einsum("ns,ns...->...", self._weight, values))

        told = SizeSums(
            count=total(sums.count),
            inliers=total(sums.count - sums.outliers),
            outliers=total(sums.outliers),
            squares_m2=np.asarray(total(sums.squares) * noise_m2),
            products=total(sums.pairs[..., 0]),
            pair_squares=total(sums.pairs[..., 1]),
            freedom=total(sums.freedom - spent),
            field_m2=self._sizes["field_m"][0] ** 2 * total(explained),
        )
        return KeptSizes.of(told, self._sizes["field_m"][0])

    def speed_noise(self) -> Float64[Array, "D"]:
        """Return what noise of the path seems to say of each drive's clock offset, and does not."""
        weight = np.zeros(len(self._drive_slot))
        for field in self._fields:
            cones = field.evidence.cones
            field_m = self._sizes["field_m"][self._zone[cones]]
            weight += field.weight_by_drive(self._weight[cones], field_m, len(weight))
        return np.asarray(weight * self._speed_noise_mps**2)

    def _without_noise_of_speed(self, data: Float64[Array, "Z S S"]) -> Float64[Array, "Z S S"]:
        """Return what readings say of all that is shared, less what noise of the path seems to say.

        A clock offset shows where the speed changes, and noise of the path looks like changes.
        """
        column = RADIOS + DRIVE * self._drive_slot
        less = data.copy()
        less[self._drive_zone, column, column] -= self.speed_noise()
        # What is left must not be less than nothing in any direction, such as all clocks together.
        unit = np.sqrt(np.diagonal(np.linalg.inv(self._prior.precision), axis1=1, axis2=2))
        value, vector = np.linalg.eigh(unit[:, :, None] * less * unit[:, None])
        kept = (vector * np.maximum(value, 0.0)[:, None]) @ np.swapaxes(vector, 1, 2)
        return np.asarray(kept / unit[:, :, None] / unit[:, None])

    def _step_length(
        self, inverse: Array, gradient: Array, through: Array, change: Array
    ) -> tuple[Float64[Array, "N 2 5"], Float64[Array, "Z S"]]:
        """Return a step that is nowhere so long that the linearisation means nothing.

        A step in what is shared takes the cones along, so it is shortened as a whole. How a cone
        moves besides is its own affair.
        """
        zone = self._zone
        along = -(through @ change[zone][:, None, :, None])[..., 0]
        clocks_s = np.abs(change[:, RADIOS::DRIVE]).max(axis=1)
        longest_m = np.zeros(len(change))
        likely = self._weight >= 0.5
        np.maximum.at(
            longest_m, zone, (likely * np.hypot(along[..., 0], along[..., 1])).max(axis=1)
        )
        part = np.minimum(1.0, _LONGEST_STEP_M / np.maximum(longest_m, 1e-9))
        part = np.minimum(part, _LONGEST_STEP_S / np.maximum(clocks_s, 1e-9))
        alone = (inverse @ gradient[..., None])[..., 0]
        length_m = np.hypot(alone[..., 0], alone[..., 1])
        away_m = np.full(length_m.shape, np.inf)
        for field in self._fields:
            cones = field.evidence.cones
            off_m = self._own[cones, :, :2] - field.nearest_m
            away_m[cones] = np.hypot(off_m[..., 0], off_m[..., 1])
        most_m = np.minimum(_LONGEST_STEP_M, _LONGEST_SHARE * away_m + _SHORT_M)
        alone *= np.minimum(1.0, most_m / np.maximum(length_m, 1e-9))[..., None]
        return alone + part[zone][:, None, None] * along, part[:, None] * change

    def _stay_on_both_sides(self, own_change: Float64[Array, "N 2 5"]) -> None:
        """Take out of a step what would lead a place over the path to the cone's other place.

        Near the path a wrong bias leaves one minimum of two, and what has crossed the path does not
        come back when the bias is right.
        """
        for field in self._fields:
            cones = field.evidence.cones
            across = field.across
            own_m = self._own[cones, :, :2]
            here_m = ((own_m - field.nearest_m) * across).sum(axis=-1)
            other_m = ((own_m[:, ::-1] - field.nearest_m) * across).sum(axis=-1)
            step_m = (own_change[cones, :, :2] * across).sum(axis=-1)
            crosses = (here_m * other_m < 0.0) & (here_m * (here_m + step_m) <= 0.0)
            own_change[cones, :, :2] -= (crosses * step_m)[..., None] * across

    def _move(self, own_change: Array, change: Array) -> None:
        """Take a step."""
        self._own = self._own + own_change
        self._shared = self._shared + change

    def _update_sizes(
        self, sums: Sums, inverse: Float64[Array, "N 2 5 5"], noise_m: Float64[Array, "Z"]
    ) -> None:
        """Estimate the sizes of the errors anew from what this step left of them."""
        zone, weight, open_ = self._zone, self._weight, ~self._settled

        def by_zone(values: Float64[Array, "N 2"]) -> Float64[Array, "Z"]:
            return np.bincount(zone, (weight * values).sum(axis=1), minlength=len(open_))

        sizes = self._sizes
        left = np.zeros_like(sums.freedom)
        for field in self._fields:
            field.add_freedom(sums)
            left[field.evidence.cones] += field.explained()
        spent = np.einsum("nsij,nslji->nsl", inverse, sums.spent)
        explained = np.stack([by_zone(x) for x in np.moveaxis(left, -1, 0)], axis=1)
        used = np.stack([by_zone(x) for x in np.moveaxis(sums.freedom - spent, -1, 0)], axis=1)
        products, squares = (by_zone(x) for x in np.moveaxis(sums.pairs, -1, 0))
        told = SizeSums(
            count=by_zone(sums.count),
            inliers=by_zone(sums.count - sums.outliers),
            outliers=by_zone(sums.outliers),
            squares_m2=by_zone(sums.squares) * noise_m**2,
            products=products,
            pair_squares=squares,
            freedom=used,
            field_m2=sizes["field_m"] ** 2 * explained,
        )
        if self._kept is not None:
            told = told + self._kept.sizes.now(sizes["field_m"][0])
        spread = self._own**2 + np.diagonal(inverse, axis1=-2, axis2=-1)
        n_cones = np.bincount(zone, minlength=len(open_))
        found = {
            **sizes_of_errors(told, self._least_noise_m),
            **sizes_of_cones(by_zone(spread[..., 2]), by_zone(spread[..., 3:].sum(-1)), n_cones),
        }
        for name, value in found.items():
            sizes[name][open_] = value[open_]


def _of_others(
    sums: Sums, precision: Float64[Array, "N S S"], pull: Float64[Array, "N S"]
) -> Float64[Array, "N 2"]:
    """Return what each side costs in addition once what is shared is integrated out.

    The other cones and the prior say of it ``precision`` and ``pull``. What a cone says of it
    itself must not decide on the cone's side: a pattern of the tag that was fitted to one side of
    the path would speak for that side.
    """
    both = precision[:, None] + sums.shared
    towards = pull[:, None] + sums.shared_gradient
    gain = (towards * np.linalg.solve(both, towards[..., None])[..., 0]).sum(axis=-1)
    return np.asarray(0.5 * (np.linalg.slogdet(both)[1] - gain))


def _softmax(values: Float64[Array, "N 2"]) -> Float64[Array, "N 2"]:
    weight = np.exp(values - values.max(axis=1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def _standardised(
    change_m: Float64[Array, "N 2 2"], covariance_m2: Float64[Array, "N 2 2 2"]
) -> Float64[Array, "N 2"]:
    solved = np.linalg.solve(covariance_m2, change_m[..., None])[..., 0]
    return np.asarray(np.sqrt((change_m * solved).sum(axis=-1)))
