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

Its parts are in ``zone_blocks.py`` and ``zone_heads.py``, from the smallest up. Axes: B episodes, T
steps, N anchors, M = 2 N tokens (all left ones first), C channels of the encoder, D width of a
token. Lengths are metres.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from gaia_uwb.learn.networks.zone_blocks import PAIR_WIDTH, Attention, TemporalEncoder, two_layers
from gaia_uwb.learn.networks.zone_heads import (
    PlaceHead,
    RangeHead,
    SideHead,
    gauss_newton,
    side_probability,
)
from gaia_uwb.learn.networks.zone_tokens import (
    PAIR_FEATURES,
    TOKEN_FEATURES,
    TokenScene,
    by_side,
    flip,
    make_token_scene,
    pair_features,
    slant_m,
    to_tokens,
    token_features,
)
from gaia_uwb.models import GaiaSetArchitecture, ZoneInputs

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
    architecture
        Its sizes.
    """

    def __init__(self, architecture: GaiaSetArchitecture) -> None:
        super().__init__()
        self.rounds = nn.ModuleList(
            Round(architecture, first=k == 0) for k in range(architecture.rounds)
        )
        self.side_head = SideHead(architecture.width)

    def forward(self, *inputs: Tensor) -> ZonePrediction:
        """Denoise and locate a batch; inputs in the order of ``ZoneInputs``."""
        return self.predictions(*inputs)[-1]

    def predictions(self, *inputs: Tensor) -> list[ZonePrediction]:
        """Return what each round would predict, with the last one's sides; losses look at all."""
        given = ZoneInputs(*inputs)
        scene = make_token_scene(given)
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
    architecture
        Sizes of the network.
    first
        Whether there is no token from a round before.
    """

    def __init__(self, architecture: GaiaSetArchitecture, *, first: bool) -> None:
        super().__init__()
        channels, width = architecture.channels, architecture.width
        self.encoder = TemporalEncoder(channels)
        n_features = 2 * channels + TOKEN_FEATURES + (0 if first else width)
        self.embed = two_layers(n_features, width, width)
        self.pair = nn.Sequential(*two_layers(PAIR_FEATURES, PAIR_WIDTH, PAIR_WIDTH), nn.GELU())
        self.attention = nn.ModuleList(Attention(width) for _ in range(architecture.layers))
        self.range_head = RangeHead(channels, width)
        self.place_head = PlaceHead(width)

    def forward(
        self, scene: TokenScene, place: Tensor, before: Tensor | None, evidence: Tensor
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


def _prediction(
    scene: TokenScene, out: RoundOutput, scene_logit: Tensor, side_logit: Tensor
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
