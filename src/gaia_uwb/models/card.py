"""The card of a model: its purpose, training data, scores and limits, as Markdown."""

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

{words.ability}

Trained with gaia {version}. This command{words.given} trains it again:

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
- It has one channel per anchor, in the order of the log. It handles at most {n} anchors; its
  training data had {seen}. A channel has a meaning: in the simulator, the first four are the
  corners of the zone.
- Its training data had ranges from {range} m.
- It is tied to the coordinates of its training data. If a path leaves east {east} m, north
  {north} m, a reconstruction is marked `unreliable`. Work zones of another kind are unknown to it.
- Its standard deviation is one number, the root mean square error on validation data
  ({sigma:.3f} m). Its errors within a window are correlated.
"""
_PLAUSIBLE = """\
- If it would move an anchor's ranges in a window by {limit:.2f} m or more, it has mistaken the
  layout, and the window gets a running median instead. (98 % of the training windows need less
  than four fifths of that.)
"""

_ZONE_LIMITS = f"""\
- It was trained on simulation only, without any real range.
- Ranges along a straight path cannot determine the sides. It then gives probabilities near 1/2.
- If a group of anchors resembles nothing in its training, what it has learned about work zones
  pulls the positions the wrong way. The ranges win in the end, but not within 6 seconds.
- It handles any number of anchors in any position, direction and order. Its training covers paths
  of 0.5 to 35 m/s, 5 to 20 readings per second and ranges up to 300 m. No training scene is longer
  than 256 steps.
- A scene with more than {ZONE_LONGEST_STEPS:,} steps or {ZONE_MOST_ANCHORS} anchors, or one that
  extends more than {ZONE_FARTHEST_M:g} m from the middle of the drive, is located in pieces. The
  sides are decided together unless two pieces are certain of opposite sides.
- It does not estimate the antenna delay of a single anchor, which shifts that anchor's position.
"""

_REMARK = """
Variances of positions are multiplied by {scales}, so that 90 % of the 90 %
ellipses of validation scenes contain their anchor. Lengths in between are interpolated.
"""


class _Words(NamedTuple):
    """The parts of the card that differ between the two families."""

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
        Everything known about it.
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
        ability=f"Denoises UWB ranges in windows of {description.window_steps} steps. Sizes: "
        f"{', '.join(f'{name} {value}' for name, value in sizes.items())}.",
        given=", with the settings below,",
        command=" ".join([*command, "--seed", str(description.training.seed)]),
        scores="best epoch; losses in m² unless stated otherwise",
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
        purpose="for unseen work zones",
        ability="Denoises UWB ranges and locates the anchors of any zone, with a probability for "
        "each side.",
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
