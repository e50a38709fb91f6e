"""``gaia-set``: the ideas of the paper's six modules, for work zones that it has never seen.

Nothing in it knows a coordinate or an anchor's number. All anchors share the same weights, each has
two *tokens*, one for its place on either side of the path, and a token sees the world from its own
side: its frame is the path's (``path_frame.py``), mirrored for places on the right. So permuting
anchors permutes the output, moving and turning a scene moves and turns it, and mirroring a scene
mirrors it, whatever the weights are.

=====================  ===========================================================================
module of the paper    here
=====================  ===========================================================================
PoseMLP Base           the exact solver's two places per anchor (``zone_inputs.py``): no weights
Temporal Refinement    :class:`TemporalEncoder`, convolutions over what a place leaves unexplained
Layout Head            :class:`Attention` across all tokens, and :class:`PlaceHead`: where such an
                       anchor stands beside such a road, and how sure that is
GeoDist                ``zone_tokens.slant_m``, exact, inside :func:`gauss_newton`
Prediction Head        :class:`RangeHead`: correction, standard deviation, P(NLOS), gate of a range
Gated Fusion           :meth:`GaiaSet.forward`: corrected ranges and those of the place, blended
=====================  ===========================================================================

A round goes from places to better places: residuals, encoder, attention, a prior and corrected
ranges, and a few steps of Gauss-Newton that weigh the two. The last module, :class:`SideHead`,
gives the joint probability of the sides: a mixture of two scene hypotheses ("the zone is on the
left", "... on the right"), given each of which the anchors choose their sides independently.

Axes: B episodes, T steps, N anchors, M = 2 N tokens (all left ones first), C channels of the
encoder, D width of a token. Lengths are metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from gaia_uwb.model import GaiaSetOptions
from gaia_uwb.networks.zone_tokens import (
    PAIR_FEATURES,
    STEP_FEATURES,
    TOKEN_FEATURES,
    Scene,
    SetInputs,
    by_side,
    flip,
    make_scene,
    off_road_m,
    pair_features,
    road_left_m,
    slant_m,
    step_features,
    to_tokens,
    token_features,
)

_NOTHING = -1e4  # a logit that is never chosen
_HEADS = 4
_PAIR = 16  # width of what is said about a pair of tokens
_DILATIONS = (1, 3, 9)
_KERNEL = 5
_NEWTON_STEPS = 3
_LONGEST_STEP_M = 30.0
_FARTHEST_PRIOR_M = 600.0
_TAILS = 4.0  # degrees of freedom of the ranges' errors


class ZonePrediction(NamedTuple):
    """What the network makes of a batch; sides are (left, right), places (along, left)."""

    range: Tensor
    """(B, N, T): denoised ranges; means nothing where there was none."""
    corrected: Tensor
    """(B, N, T): measured ranges less what is wrong with them, before the fusion."""
    log_sigma: Tensor
    """(B, N, T): logarithm of the corrected range's standard deviation in metres."""
    nlos_logit: Tensor
    """(B, N, T)."""
    place: Tensor
    """(B, N, 2, 2): anchor, side, (along, left)."""
    information: Tensor
    """(B, N, 2, 3): inverse covariance of each place: (along along, along left, left left)."""
    scene_logit: Tensor
    """(B,): of the scene hypothesis "left"."""
    side_logit: Tensor
    """(B, N, 2): of an anchor's standing on the hypothesis's side, given "left" and "right"."""


class RoundOutput(NamedTuple):
    """What one round makes of the tokens; places in the tokens' own frames."""

    place: Tensor  # (B, M, 2)
    information: Tensor  # (B, M, 3)
    delta: Tensor  # (B, M, T): subtracted from the ranges
    log_sigma: Tensor  # (B, M, T)
    nlos_logit: Tensor  # (B, M, T)
    gate: Tensor  # (B, M, T)
    token: Tensor  # (B, M, D)
    log_likelihood: Tensor  # (B, M): of the corrected ranges, given the place


class GaiaSet(nn.Module):
    """The whole network.

    Parameters
    ----------
    options
        Its sizes.
    """

    def __init__(self, options: GaiaSetOptions) -> None:
        super().__init__()
        self.rounds = nn.ModuleList(Round(options, first=k == 0) for k in range(options.rounds))
        self.side_head = SideHead(options.width)

    def forward(self, *inputs: Tensor) -> ZonePrediction:
        """Denoise and locate a batch; inputs like :class:`gaia_uwb.zone_inputs.ZoneInputs`."""
        return self.predictions(*inputs)[-1]

    def predictions(self, *inputs: Tensor) -> list[ZonePrediction]:
        """Return what each round would predict, with the last one's sides; losses look at all."""
        given = SetInputs(*inputs)
        scene = make_scene(given)
        evidence = _evidence(given.fit[..., 0] / given.fit[..., 3].exp())
        place = to_tokens(given.start) * flip(scene.side)
        token, rounds = None, []
        for module in self.rounds:
            out: RoundOutput = module(scene, place, token, evidence)
            place, token = out.place, out.token
            fits = by_side(out.log_likelihood.unsqueeze(-1)).squeeze(-1)  # (B, N, 2)
            evidence = _evidence(fits - fits.flip(-1))
            rounds.append(out)
        assert token is not None  # there is at least one round  # noqa: S101
        scene_logit, side_logit = self.side_head(token, evidence, scene.observed)
        return [_prediction(scene, out, scene_logit, side_logit) for out in rounds]


class Round(nn.Module):
    """From places to better places.

    Parameters
    ----------
    options
        Sizes of the network.
    first
        Whether there is no token from a round before.
    """

    def __init__(self, options: GaiaSetOptions, *, first: bool) -> None:
        super().__init__()
        channels, width = options.channels, options.width
        self.encoder = TemporalEncoder(channels)
        n_features = 2 * channels + TOKEN_FEATURES + (0 if first else width)
        self.embed = _two_layers(n_features, width, width)
        self.pair = nn.Sequential(*_two_layers(PAIR_FEATURES, _PAIR, _PAIR), nn.GELU())
        self.attention = nn.ModuleList(Attention(width) for _ in range(options.layers))
        self.range_head = RangeHead(channels, width)
        self.place_head = PlaceHead(width)

    def forward(
        self, scene: Scene, place: Tensor, before: Tensor | None, evidence: Tensor
    ) -> RoundOutput:
        """Return better places for tokens (B, M, 2), and all that goes with them."""
        h, pooled = self.encoder(scene, place)  # (B, M, C, T), (B, M, 2C)
        features = [pooled, token_features(scene, place), evidence]
        if before is not None:
            features.append(before)
        token = self.embed(torch.cat(features, dim=-1))  # (B, M, D)
        pair = self.pair(pair_features(scene, place))  # (B, M, M, P)
        for layer in self.attention:
            token = layer(token, pair, scene.observed)
        delta, log_sigma, nlos_logit, gate = self.range_head(h, token)  # each (B, M, T)
        prior, share = self.place_head(scene, place, token)
        weight = scene.mask * torch.exp(-2 * log_sigma) * share
        better, information = gauss_newton(scene, place, scene.range - delta, weight, prior)
        error = (scene.range - delta - slant_m(scene, better)[0]).square()
        tails = 0.5 * (_TAILS + 1) * torch.log1p(error * torch.exp(-2 * log_sigma) / _TAILS)
        log_likelihood = -(scene.mask * (tails + log_sigma)).sum(dim=-1) * share.squeeze(-1)
        return RoundOutput(
            better, information, delta, log_sigma, nlos_logit, gate, token, log_likelihood
        )


class TemporalEncoder(nn.Module):
    """Convolutions over the steps of every token, shared by all anchors and both sides.

    Parameters
    ----------
    channels
        Channels C.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.enter = nn.Conv1d(STEP_FEATURES, channels, 1)
        self.layers = nn.ModuleList(DilatedConvolution(channels, dilation=d) for d in _DILATIONS)

    def forward(self, scene: Scene, place: Tensor) -> tuple[Tensor, Tensor]:
        """Return features of every step (B, M, C, T), and of the whole token (B, M, 2C)."""
        x = step_features(scene, place)  # (B, M, T, F)
        batch, tokens, steps, n_features = x.shape
        h = functional.gelu(
            self.enter(x.reshape(batch * tokens, steps, n_features).transpose(1, 2))
        )
        for layer in self.layers:
            h = h + functional.gelu(layer(h))
        h = h.reshape(batch, tokens, -1, steps)
        mask = scene.mask.unsqueeze(2)
        mean = (h * mask).sum(dim=-1) / mask.sum(dim=-1).clamp_min(1)
        largest = (h * mask + (mask - 1) * 1e3).amax(dim=-1).clamp_min(-10.0)
        return h, torch.cat([mean, largest], dim=-1)


class DilatedConvolution(nn.Module):
    """A convolution over steps, as long after it as before.

    Its weights are a matrix, which is what the training's optimiser takes (``set_training.py``).

    Parameters
    ----------
    channels
        Channels C.
    dilation
        Steps between two of the kernel's taps.
    """

    def __init__(self, channels: int, *, dilation: int) -> None:
        super().__init__()
        self.dilation = dilation
        beginning = nn.Conv1d(channels, channels, _KERNEL)
        self.weight = nn.Parameter(beginning.weight.detach().flatten(1))
        self.bias = beginning.bias

    def forward(self, h: Tensor) -> Tensor:
        """Return (B, C, T) of (B, C, T)."""
        kernel = self.weight.reshape(len(self.weight), -1, _KERNEL)
        padding = _KERNEL // 2 * self.dilation
        return functional.conv1d(h, kernel, self.bias, padding=padding, dilation=self.dilation)


class Attention(nn.Module):
    """Self-attention over the tokens of a scene; what one sees in another depends on the pair.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.query_key_value = nn.Linear(width, 3 * width)
        self.pair_bias = nn.Linear(_PAIR, _HEADS)
        self.pair_value = nn.Linear(_PAIR, width)
        self.out = nn.Linear(width, width)
        self.feed_forward = nn.Sequential(
            nn.LayerNorm(width), *_two_layers(width, 2 * width, width)
        )

    def forward(self, token: Tensor, pair: Tensor, observed: Tensor) -> Tensor:
        """Return new tokens (B, M, D); tokens of anchors that were not observed are not seen."""
        batch, tokens, width = token.shape
        parts = self.query_key_value(self.norm(token))
        parts = parts.reshape(batch, tokens, 3, _HEADS, width // _HEADS).permute(2, 0, 3, 1, 4)
        query, key, value = parts[0], parts[1], parts[2]  # (B, heads, M, D / heads)
        logit = query @ key.transpose(-1, -2) / math.sqrt(width // _HEADS)
        logit = logit + self.pair_bias(pair).permute(0, 3, 1, 2)
        logit = logit + (1 - observed[:, None, None, :]) * _NOTHING
        share = logit.softmax(dim=-1)  # (B, heads, M, M)
        shape = (batch, tokens, tokens, _HEADS, width // _HEADS)
        seen = share @ value + torch.einsum(
            "bhij,bijhd->bhid", share, self.pair_value(pair).reshape(shape)
        )
        token = token + self.out(seen.permute(0, 2, 1, 3).reshape(batch, tokens, width))
        better: Tensor = token + self.feed_forward(token)
        return better


class RangeHead(nn.Module):
    """What is wrong with each range, given the token's place.

    Parameters
    ----------
    channels, width
        C and D.
    """

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        self.from_step = nn.Conv1d(channels, channels, 1)
        self.from_token = nn.Linear(width, channels)
        self.out = nn.Conv1d(channels, 4, 1)
        # No correction, 0.2 m, line of sight, the corrected range itself.
        _begin_with(self.out, 0.0, -1.5, -1.0, 2.0)

    def forward(self, h: Tensor, token: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return correction, log sigma, NLOS logit and gate, each (B, M, T)."""
        batch, tokens, channels, steps = h.shape
        x = self.from_step(h.reshape(batch * tokens, channels, steps))
        x = functional.gelu(x + self.from_token(token).reshape(batch * tokens, channels, 1))
        delta, log_sigma, nlos_logit, gate = self.out(x).reshape(batch, tokens, 4, steps).unbind(2)
        return delta, log_sigma.clamp(-5.0, 3.0), nlos_logit, torch.sigmoid(gate)


class Prior(NamedTuple):
    """Where a token's anchor would stand without its ranges: a Gaussian, in the token's frame."""

    mean: Tensor  # (B, M, 2)
    information: Tensor  # (B, M, 3)


class PlaceHead(nn.Module):
    """Where such an anchor stands beside such a road, and what its ranges are worth.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.LayerNorm(width), *_two_layers(width, width, 7))
        # Hardly any prior, at the solver's place.
        _begin_with(self.layers[-1], 0.0, 0.0, -2.0, -2.0, 0.0, 0.0, 2.0)

    def forward(self, scene: Scene, place: Tensor, token: Tensor) -> tuple[Prior, Tensor]:
        """Return the prior, and which share of the ranges' information counts (B, M, 1)."""
        ahead, across, log_along, log_left, correlation, share, keep = self.layers(token).unbind(-1)
        along = (place[..., 0] + 5 * ahead).clamp(-_FARTHEST_PRIOR_M, _FARTHEST_PRIOR_M)
        # Beside the road: some of the present distance from it, and an absolute one.
        off_road = torch.sigmoid(keep) * off_road_m(scene, place) + 5 * across
        mean = torch.stack([along, road_left_m(scene, along) + off_road], dim=-1)
        aa, ll = torch.exp(log_along.clamp(-9.0, 7.0)), torch.exp(log_left.clamp(-9.0, 7.0))
        al = 0.95 * torch.tanh(correlation) * torch.sqrt(aa * ll)
        information = torch.stack([aa, al, ll], dim=-1)
        return Prior(mean, information), torch.sigmoid(share - 1).unsqueeze(-1)


class SideHead(nn.Module):
    """The joint probability of the sides.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.scene = _two_layers(2 * width, width, 1)
        self.anchor = _two_layers(2 * width + 2, width, 1)
        self.own = _two_layers(3 * width + 2, width, 1)
        nn.init.zeros_(self.scene[-1].weight)  # type: ignore[arg-type]  # a linear layer's
        _begin_with(self.own[-1], 1.5)  # anchors stand on the zone's side

    def forward(self, token: Tensor, evidence: Tensor, observed: Tensor) -> tuple[Tensor, Tensor]:
        """Return the scene's logit (B,) and the anchors' own (B, N, 2)."""
        tokens, ev = by_side(token), by_side(evidence)  # (B, N, 2, D), (B, N, 2, 2)
        live = by_side(observed.unsqueeze(-1))[:, :, 0]  # (B, N, 1)
        mean = (tokens * live.unsqueeze(2)).sum(dim=1) / live.sum(dim=1).clamp_min(1).unsqueeze(1)
        both = torch.cat([tokens, tokens.flip(2)], dim=-1)  # own side, other side
        scene = self.scene(torch.cat([mean, mean.flip(1)], dim=-1)).squeeze(-1)  # (B, 2)
        anchor = self.anchor(torch.cat([both, ev], dim=-1)).squeeze(-1)  # (B, N, 2)
        # What speaks for a side speaks against the other; anchors add up.
        scene_logit = scene[:, 0] - scene[:, 1]
        scene_logit = scene_logit + ((anchor[..., 0] - anchor[..., 1]) * live.squeeze(-1)).sum(
            dim=1
        )
        around = mean.unsqueeze(1).expand(-1, tokens.shape[1], -1, -1)
        own = self.own(torch.cat([both, around, ev], dim=-1)).squeeze(-1)
        return scene_logit, own


def gauss_newton(
    scene: Scene, place: Tensor, range_m: Tensor, weight: Tensor, prior: Prior
) -> tuple[Tensor, Tensor]:
    """Find the places that corrected ranges and priors agree on.

    Parameters
    ----------
    scene
        Paths and heights.
    place : (B, M, 2)
        Where to begin.
    range_m, weight : (B, M, T)
        Corrected ranges, and what each is worth (1 / variance), 0 where there is none.
    prior
        Of the places.

    Returns
    -------
    place : (B, M, 2)
        In the tokens' frames.
    information : (B, M, 3)
        Inverse covariance there.
    """
    p_aa, p_al, p_ll = prior.information.unbind(-1)
    for _ in range(_NEWTON_STEPS):
        distance, off = slant_m(scene, place)
        unit_a, unit_l = (off / distance.unsqueeze(-1)).unbind(-1)
        error = range_m - distance
        pull_a, pull_l = weight * unit_a, weight * unit_l
        aa = (pull_a * unit_a).sum(dim=-1) + p_aa
        al = (pull_a * unit_l).sum(dim=-1) + p_al
        ll = (pull_l * unit_l).sum(dim=-1) + p_ll
        to_prior = prior.mean - place
        force_a = (pull_a * error).sum(dim=-1) + p_aa * to_prior[..., 0] + p_al * to_prior[..., 1]
        force_l = (pull_l * error).sum(dim=-1) + p_al * to_prior[..., 0] + p_ll * to_prior[..., 1]
        determinant = (aa * ll - al * al).clamp_min(1e-9)
        step = torch.stack([ll * force_a - al * force_l, aa * force_l - al * force_a], dim=-1)
        step = step / determinant.unsqueeze(-1)
        length = torch.sqrt(step.square().sum(dim=-1, keepdim=True) + 1e-12)
        place = place + step * (_LONGEST_STEP_M / length.clamp_min(_LONGEST_STEP_M))
    return place, torch.stack([aa, al, ll], dim=-1)


def side_probability(scene_logit: Tensor, side_logit: Tensor) -> Tensor:
    """Return the probability that an anchor stands on the left (B, N)."""
    left = torch.sigmoid(scene_logit).unsqueeze(1)
    own = torch.sigmoid(side_logit)
    return left * own[..., 0] + (1 - left) * (1 - own[..., 1])


def _prediction(
    scene: Scene, out: RoundOutput, scene_logit: Tensor, side_logit: Tensor
) -> ZonePrediction:
    """Bring a round's output into the path's frame; the sides' ranges count by probability."""
    place = by_side(out.place * flip(scene.side))
    information = out.information * torch.stack(
        [torch.ones_like(scene.side), scene.side, torch.ones_like(scene.side)], dim=-1
    )
    left = side_probability(scene_logit, side_logit).detach().unsqueeze(-1)  # (B, N, 1)
    corrected = scene.range - out.delta
    fused = out.gate * corrected + (1 - out.gate) * slant_m(scene, out.place)[0]

    def blend(values: Tensor) -> Tensor:
        n = values.shape[1] // 2
        return left * values[:, :n] + (1 - left) * values[:, n:]

    return ZonePrediction(
        range=blend(fused),
        corrected=blend(corrected),
        log_sigma=blend(out.log_sigma),
        nlos_logit=blend(out.nlos_logit),
        place=place,
        information=by_side(information),
        scene_logit=scene_logit,
        side_logit=side_logit,
    )


def _evidence(better: Tensor) -> Tensor:
    """Return by how much a side fits better (B, N, 2), as features of the tokens (B, M, 2)."""
    return to_tokens(torch.stack([torch.tanh(better / 2), torch.tanh(better / 10)], dim=-1))


def _begin_with(layer: nn.Module, *outputs: float) -> None:
    """Let a layer give these outputs before any training, whatever its inputs."""
    nn.init.zeros_(layer.weight)  # type: ignore[arg-type]  # the layer is linear or a convolution
    layer.bias = nn.Parameter(torch.tensor(outputs))


def _two_layers(n_in: int, hidden: int, n_out: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(n_in, hidden), nn.GELU(), nn.Linear(hidden, n_out))
