"""``gaia``: the paper's network of six modules ("Architecture of GAIA"), in the order of its pass.

=====================  ===================================================================
module of the paper    here
=====================  ===================================================================
PoseMLP Base           :class:`gaia_uwb.learn.networks.PoseMlp`, pretrained and frozen
Temporal Refinement    :class:`TemporalRefinement`
Layout Head            :class:`LayoutHead`
GeoDist                :func:`geometric_distance`, without parameters
Prediction Head        :class:`PredictionHead`
Gated Fusion           :func:`gated_fusion`, without parameters
=====================  ===================================================================

Axes: B episodes, T steps, N anchors (padded, with a mask), H the GRU's width. Lengths are in units
of the normalisation's scale. The paper's ablations are options, and so is ``causal``, its future
work: then every output at step t depends on nothing after step ``t + look_ahead_steps``.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from gaia_uwb.learn.networks.layers import WindowPrediction, three_layers
from gaia_uwb.learn.networks.pose_mlp import PoseMlp
from gaia_uwb.models import GaiaArchitecture, PoseMlpArchitecture

_LEAST_SCALE = 1e-6  # of outputs that never vary
_LEAST_SQUARE = 1e-8  # under a root, so that its gradient stays finite on top of an anchor


class Gaia(nn.Module):
    """The six modules, one after another.

    Parameters
    ----------
    n_anchors
        Number of anchors N that the network has channels for.
    architecture
        Its sizes and variants.
    """

    def __init__(self, n_anchors: int, architecture: GaiaArchitecture) -> None:
        super().__init__()
        self.architecture = architecture
        self.base = PoseMlp(n_anchors, PoseMlpArchitecture(hidden=architecture.base_hidden))
        self.base.requires_grad_(architecture.train_base)
        self.temporal = TemporalRefinement(n_anchors, architecture)
        self.layout_head = (
            LayoutHead(self.temporal.width, n_anchors, architecture)
            if architecture.layout_head
            else None
        )
        self.prediction_head = PredictionHead(
            self.temporal.width,
            n_anchors,
            architecture.head_hidden,
            with_geometry=architecture.layout_head and architecture.geo_dist,
        )

    @torch.no_grad()
    def standardise(
        self,
        position: Tensor,
        distance: Tensor,
        mask: Tensor,
        true_distance: Tensor,
        anchor: Tensor,
    ) -> None:
        """Scale both heads' outputs to about 1 on the training data, so that they learn evenly.

        Parameters
        ----------
        position, distance, mask
            Inputs, like those of :meth:`forward`.
        true_distance
            (B, T, N): true ranges.
        anchor
            (B, N, 2): true places; NaN where unknown.
        """
        base = self.base(position, distance, mask, torch.zeros_like(mask)).distance
        square = ((true_distance - base) * mask).square()
        scale = torch.sqrt(square.sum() / mask.sum().clamp_min(1))
        self.prediction_head.residual_scale.copy_(scale.clamp_min(_LEAST_SCALE))
        if self.layout_head is not None:
            counts = mask.amax(dim=1) * torch.isfinite(anchor).all(dim=-1)  # (B, N)
            self.layout_head.standardise(torch.nan_to_num(anchor), counts.unsqueeze(-1))

    def forward(
        self, position: Tensor, distance: Tensor, mask: Tensor, height_gap: Tensor
    ) -> WindowPrediction:
        """Denoise a batch.

        Parameters
        ----------
        position
            (B, T, 2): where the tag's antenna is, ``p_seq``.
        distance
            (B, T, N): measured ranges, 0 where the mask is 0, ``d_use``.
        mask
            (B, T, N): 1 where there is a range, else 0, ``m_seq``.
        height_gap
            (B, T, N): tag's height minus the anchor's; 0 where unknown.
        """
        base = self.base(position, distance, mask, height_gap).distance  # b_val (B, T, N)
        h = self.temporal(distance, base, mask, position)  # (B, T, 2H)
        layout = final = None
        if self.layout_head is not None:
            layout = self.layout_head(h, mask)  # l (B, N, 2), or (B, T, N, 2) if causal
            final = layout[:, -1] if layout.dim() == 4 else layout
        if layout is None or not self.architecture.geo_dist:
            delta, _ = self.prediction_head(h, base, distance, None)
            return WindowPrediction(functional.relu(base + delta) * mask, final)
        l_d = geometric_distance(position, layout, height_gap)  # (B, T, N)
        delta, gate_logit = self.prediction_head(h, base, distance, l_d)
        refined = functional.relu(base + delta)  # d_refined: a distance is never negative
        pred, gate = gated_fusion(refined, l_d, gate_logit, mask)
        return WindowPrediction(pred, final, l_d, gate)


class TemporalRefinement(nn.Module):
    """A GRU over the steps and a LayerNorm ("Temporal Refinement module").

    Parameters
    ----------
    n_anchors
        Number of anchors N.
    architecture
        ``gru_hidden`` is H. Causal: one direction of width 2H, and a look-ahead.
    """

    def __init__(self, n_anchors: int, architecture: GaiaArchitecture) -> None:
        super().__init__()
        self.causal = architecture.causal
        self.look_ahead = architecture.look_ahead_steps
        self.width = 2 * architecture.gru_hidden
        self.gru = nn.GRU(
            3 * n_anchors + 2,
            self.width if self.causal else architecture.gru_hidden,
            batch_first=True,
            bidirectional=not self.causal,
        )
        self.norm = nn.LayerNorm(self.width)

    def forward(self, distance: Tensor, base: Tensor, mask: Tensor, position: Tensor) -> Tensor:
        """Return h (B, T, 2H) of x (B, T, 3N + 2)."""
        x = torch.cat([distance, base, mask, position], dim=-1)
        h, _ = self.gru(x)
        if self.causal:
            h = _ahead(h, self.look_ahead)
        normed: Tensor = self.norm(h)
        return normed


def _ahead(values: Tensor, steps: int) -> Tensor:
    """Return (B, T, C) values with those of ``steps`` steps later at each; the last have less."""
    if steps == 0:
        return values
    last = values[:, -1:].expand(-1, steps, -1)
    return torch.cat([values, last], dim=1)[:, steps:]


class LayoutHead(nn.Module):
    """Where all anchors stand, from the mean over time ("Layout Head module").

    Parameters
    ----------
    width
        Width 2H of the temporal features.
    n_anchors
        Number of anchors N.
    architecture
        ``layout_hidden``; causal: the mean runs from the first step to the present one.
    """

    def __init__(self, width: int, n_anchors: int, architecture: GaiaArchitecture) -> None:
        super().__init__()
        self.causal = architecture.causal
        self.look_ahead = architecture.look_ahead_steps
        self.layers = three_layers(width, architecture.layout_hidden, 2 * n_anchors)
        self.dropout = nn.Dropout(architecture.dropout)
        self.mean: Tensor
        self.spread: Tensor
        self.register_buffer("mean", torch.zeros(n_anchors, 2))
        self.register_buffer("spread", torch.ones(()))

    def forward(self, h: Tensor, mask: Tensor) -> Tensor:
        """Return the layout (B, N, 2) of h (B, T, 2H), or that of every step if causal."""
        if not self.causal:
            h_mean = h.mean(dim=1)  # (B, 2H)
            layout = self._place(self.layers(self.dropout(h_mean)))  # l_init (B, N, 2)
            m_anchor = mask.amax(dim=1)  # (B, N): observed at least once
            masked: Tensor = layout * m_anchor.unsqueeze(-1)
            return masked
        count = torch.ones_like(h[:, :, :1]).cumsum(dim=1)
        h_mean = h.cumsum(dim=1) / count  # (B, T, 2H)
        layouts = self._place(self.layers(self.dropout(h_mean)))  # (B, T, N, 2)
        seen = _ahead(mask.cumsum(dim=1), self.look_ahead) > 0.5  # (B, T, N): observed so far
        so_far: Tensor = layouts * seen.to(layouts.dtype).unsqueeze(-1)
        return so_far

    def standardise(self, anchor: Tensor, counts: Tensor) -> None:
        """Let outputs of 0 be the mean layout (B, N, 2), and 1 the spread; ``counts`` (B, N, 1)."""
        mean = (anchor * counts).sum(dim=0) / counts.sum(dim=0).clamp_min(1)
        square = ((anchor - mean) * counts).square().sum() / (2 * counts.sum()).clamp_min(1)
        self.mean.copy_(mean)
        self.spread.copy_(torch.sqrt(square).clamp_min(_LEAST_SCALE))

    def _place(self, output: Tensor) -> Tensor:
        """Return places (..., N, 2) from the perceptron's outputs (..., 2N)."""
        placed: Tensor = self.mean + self.spread * output.unflatten(-1, (-1, 2))  # type: ignore[no-untyped-call]
        return placed


def geometric_distance(position: Tensor, layout: Tensor, height_gap: Tensor) -> Tensor:
    """Return how far the tag is from each anchor of a layout ("GeoDist module").

    Parameters
    ----------
    position
        (B, T, 2): path of the tag's antenna.
    layout
        (B, N, 2), or (B, T, N, 2) for a layout that changes from step to step.
    height_gap
        (B, T, N): with 0 it is the paper's formula, otherwise the slant distance.

    Returns
    -------
    (B, T, N)
        The distances ``l_d``.
    """
    if layout.dim() == 3:
        layout = layout.unsqueeze(1)  # the same at every step
    gap = position.unsqueeze(2) - layout  # (B, T, N, 2)
    square = gap.square().sum(dim=-1) + height_gap.square()
    return torch.sqrt(square + _LEAST_SQUARE)


class PredictionHead(nn.Module):
    """A correction and a gate for every range ("Prediction Head module").

    Parameters
    ----------
    width
        Width 2H of the temporal features.
    n_anchors
        Number of anchors N.
    hidden
        Width of its hidden layers.
    with_geometry
        Whether ``l_d`` is among its inputs; without, they are 2H + 2N.
    """

    def __init__(self, width: int, n_anchors: int, hidden: int, *, with_geometry: bool) -> None:
        super().__init__()
        parts = 3 if with_geometry else 2
        self.layers = three_layers(width + parts * n_anchors, hidden, 2 * n_anchors)
        self.residual_scale: Tensor
        self.register_buffer("residual_scale", torch.ones(()))

    def forward(
        self, h: Tensor, base: Tensor, distance: Tensor, layout_distance: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Return the residual and the gate's logit, each (B, T, N), of z (B, T, 2H + 3N)."""
        parts = [h, base, distance]
        if layout_distance is not None:
            parts.append(layout_distance)
        delta, gate_logit = self.layers(torch.cat(parts, dim=-1)).chunk(2, dim=-1)
        return delta * self.residual_scale, gate_logit


def gated_fusion(
    refined: Tensor, layout_distance: Tensor, gate_logit: Tensor, mask: Tensor
) -> tuple[Tensor, Tensor]:
    """Blend corrected ranges with those of the layout ("Gated Fusion module").

    Parameters
    ----------
    refined, layout_distance, gate_logit, mask
        All (B, T, N).

    Returns
    -------
    pred : (B, T, N)
        ``(g * refined + (1 - g) * layout_distance) * mask``.
    gate : (B, T, N)
        g, between 0 and 1.
    """
    gate = torch.sigmoid(gate_logit)
    return (gate * refined + (1 - gate) * layout_distance) * mask, gate
