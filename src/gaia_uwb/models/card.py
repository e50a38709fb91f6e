"""A model's card: what it is, what it was trained on, its scores and its limits, as Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from gaia_uwb.models.description import (
    ZONE_FARTHEST_M,
    ZONE_LONGEST_STEPS,
    ZONE_MOST_ANCHORS,
    WindowModel,
    ZoneModel,
)
from gaia_uwb.models.training_options import ZoneTrainingOptions

_CARD = """\
# {kind}, {words.purpose}

{words.ability} Written by
gaia {version}; this command{words.given} trains it again:

```
{words.command} --out my-model/
```

## Data

{data}

## Scores on the validation data ({words.scores})

| metric | value |
|---|---|
{metrics}
{words.remark}
## Limits

{words.limits}
## {words.heading}

{settings}
"""

_WINDOW_LIMITS = """\
- One channel per anchor, in the order of the log: it takes at most {n} anchors and has seen {seen}.
  A channel has a meaning: in the simulator the first four are the corners of the zone.
- It has seen ranges from {range} m.
- It knows the coordinates of its training data: a path outside east {east} m, north {north} m, or
  work zones of another kind, are strange to it, and a reconstruction says so (`unreliable`).
- Its standard deviation is one number, the root mean square error on validation data
  ({sigma:.3f} m); its errors within a window are alike.
"""
_PLAUSIBLE = """\
- A window in which it would move an anchor's ranges by {limit:.2f} m or more (98 % of the training
  windows need less than four fifths of that) was taken for one of another layout, and gets a
  running median.
"""

_ZONE_LIMITS = f"""\
- Trained on simulation only: no real range is in it.
- Ranges along a straight path cannot tell the sides; then it says so with probabilities near 1/2.
- A group of anchors that looks like none of its training is located by its ranges, with what it
  has learned of work zones pulling the wrong way; the ranges win in the end, but not in 6 seconds.
- Any number of anchors, any place, direction and order; paths of 0.5 to 35 m/s, 5 to 20 readings a
  second, ranges up to 300 m. No scene of the training is longer than 256 steps.
- What has more than {ZONE_LONGEST_STEPS:,} steps or {ZONE_MOST_ANCHORS} anchors, or reaches farther
  than {ZONE_FARTHEST_M:g} m from the middle of the drive, is located in pieces; the sides of their
  anchors are decided together as long as no two pieces are sure of opposite ones.
- An antenna delay of one anchor alone goes into its place: it is not estimated.
"""

_REMARK = """
Variances of places are multiplied by {scales}, so that 90 % of the 90 %
ellipses of validation scenes hold their anchor; in proportion for scenes of lengths in between.
"""


class _Words(NamedTuple):
    """What the card of one family says otherwise than that of the other."""

    purpose: str
    ability: str
    given: str
    command: str
    scores: str
    remark: str
    limits: str
    heading: str
    settings: Mapping[str, Any]


def model_card(description: WindowModel | ZoneModel) -> str:
    """Return the card of a model.

    Parameters
    ----------
    description
        All that is known of it.
    """
    words = (
        _window_words(description)
        if isinstance(description, WindowModel)
        else _zone_words(description)
    )
    metrics = (f"| {name} | {value:.4g} |" for name, value in description.metrics.items())
    return _CARD.format(
        kind=description.network.kind,
        version=description.version,
        words=words,
        data=_listed(description.data),
        metrics="\n".join(metrics),
        settings=_listed(words.settings),
    )


def _window_words(description: WindowModel) -> _Words:
    sizes = description.network.model_dump(exclude={"kind"})
    domain, data = description.domain, description.data
    limits = _WINDOW_LIMITS.format(
        n=description.n_anchors,
        east="{:.0f} to {:.0f}".format(*domain.east_m),
        north="{:.0f} to {:.0f}".format(*domain.north_m),
        range="{:.1f} to {:.1f}".format(*domain.range_m),
        seen="{} to {}".format(*domain.n_anchors),
        sigma=description.sigma_m,
    )
    if description.plausible_correction_m is not None:
        limits += _PLAUSIBLE.format(limit=description.plausible_correction_m)
    command = ["gaia train", description.network.kind, "--data", str(data.get("source", "SOURCE"))]
    if "preparation" in data:
        command += ["--split", str(data["split"]), "--preparation", str(data["preparation"])]
    return _Words(
        purpose=f"trained on {data.get('source', 'unknown data')}",
        ability=f"Denoises UWB ranges of windows of {description.window_steps} steps. Sizes: "
        f"{', '.join(f'{name} {value}' for name, value in sizes.items())}.",
        given=", with the settings below,",
        command=" ".join([*command, "--seed", str(description.training.seed)]),
        scores="best epoch; losses in m^2 unless named otherwise",
        remark="",
        limits=limits,
        heading="Training settings",
        settings=description.training.model_dump(),
    )


def _zone_words(description: ZoneModel) -> _Words:
    network, training = description.network, description.training
    scales = ", ".join(f"{scale:.3f} ({n} steps)" for n, scale in description.variance_scales)
    as_usual = training.portions == ZoneTrainingOptions().portions
    return _Words(
        purpose="for work zones that it has never seen",
        ability="Denoises UWB ranges and locates the anchors of any zone, with probabilities of "
        "the sides.",
        given="",
        command=f"gaia train gaia-set --data sim:mixed --seed {training.seed}"
        + ("" if as_usual else f" --portions {training.portions}"),
        scores="last portion; `scene` is a negative log likelihood per anchor",
        remark=_REMARK.format(scales=scales),
        limits=_ZONE_LIMITS,
        heading="Settings",
        settings=network.model_dump() | training.model_dump(),
    )


def _listed(values: Mapping[str, Any]) -> str:
    return "\n".join(f"- {name}: {value}" for name, value in values.items())
