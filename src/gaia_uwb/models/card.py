"""A model's card: what it is, what it was trained on, its scores and its limits, as Markdown."""

from __future__ import annotations

from gaia_uwb.models.description import (
    SET_FARTHEST_M,
    SET_LONGEST_STEPS,
    SET_MOST_ANCHORS,
    ModelDescription,
    SetModelDescription,
    SetTrainingOptions,
)

_LIMITS = """\
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


def model_card(description: ModelDescription) -> str:
    """Return the card of a model.

    Parameters
    ----------
    description
        All that is known of it.
    """
    domain = description.domain
    sizes = ", ".join(
        f"{name} {value}"
        for name, value in description.network.model_dump(exclude={"kind"}).items()
    )
    data = "\n".join(f"- {name}: {value}" for name, value in description.data.items())
    metrics = "\n".join(f"| {name} | {value:.4g} |" for name, value in description.metrics.items())
    settings = "\n".join(
        f"- {name}: {value}" for name, value in description.training.model_dump().items()
    )
    limits = _LIMITS.format(
        n=description.n_anchors,
        east="{:.0f} to {:.0f}".format(*domain.east_m),
        north="{:.0f} to {:.0f}".format(*domain.north_m),
        range="{:.1f} to {:.1f}".format(*domain.range_m),
        seen="{} to {}".format(*domain.n_anchors),
        sigma=description.sigma_m,
    )
    if description.plausible_correction_m is not None:
        limits += _PLAUSIBLE.format(limit=description.plausible_correction_m)
    return f"""\
# {description.network.kind}, trained on {description.data.get("source", "unknown data")}

Denoises UWB ranges of windows of {description.window_steps} steps. Sizes: {sizes}. Written by
gaia {description.version}; this command, with the settings below, trains it again:

```
{_command(description)}
```

## Data

{data}

## Scores on the validation data (best epoch; losses in m^2 unless named otherwise)

| metric | value |
|---|---|
{metrics}

## Limits

{limits}
## Training settings

{settings}
"""


_SET_LIMITS = f"""\
- Trained on simulation only: no real range is in it.
- Ranges along a straight path cannot tell the sides; then it says so with probabilities near 1/2.
- A group of anchors that looks like none of its training is located by its ranges, with what it
  has learned of work zones pulling the wrong way; the ranges win in the end, but not in 6 seconds.
- Any number of anchors, any place, direction and order; paths of 0.5 to 35 m/s, 5 to 20 readings a
  second, ranges up to 300 m. No scene of the training is longer than 256 steps.
- What has more than {SET_LONGEST_STEPS:,} steps or {SET_MOST_ANCHORS} anchors, or reaches farther
  than {SET_FARTHEST_M:g} m from the middle of the drive, is located in pieces; the sides of their
  anchors are decided together as long as no two pieces are sure of opposite ones.
- An antenna delay of one anchor alone goes into its place: it is not estimated.
"""


def set_model_card(description: SetModelDescription) -> str:
    """Return the card of a ``gaia-set`` model.

    Parameters
    ----------
    description
        All that is known of it.
    """
    data = "\n".join(f"- {name}: {value}" for name, value in description.data.items())
    metrics = "\n".join(f"| {name} | {value:.4g} |" for name, value in description.metrics.items())
    settings = "\n".join(
        f"- {name}: {value}"
        for part in (description.network, description.training)
        for name, value in part.model_dump().items()
    )
    scales = ", ".join(
        f"{scale:.3f} ({steps} steps)" for steps, scale in description.variance_scales
    )
    portions = description.training.portions
    more = "" if portions == SetTrainingOptions().portions else f" --portions {portions}"
    return f"""\
# {description.network.kind}, for work zones that it has never seen

Denoises UWB ranges and locates the anchors of any zone, with probabilities of the sides. Written by
gaia {description.version}; this command trains it again:

```
gaia train gaia-set --data sim:mixed --seed {description.training.seed}{more} --out my-model/
```

## Data

{data}

## Scores on the validation data (last portion; `scene` is a negative log likelihood per anchor)

| metric | value |
|---|---|
{metrics}

Variances of places are multiplied by {scales}, so that 90 % of the 90 %
ellipses of validation scenes hold their anchor; in proportion for scenes of lengths in between.

## Limits

{_SET_LIMITS}
## Settings

{settings}
"""


def _command(description: ModelDescription) -> str:
    """Return the command that trains a model like this one."""
    data = description.data
    words = ["gaia train", description.network.kind, "--data", str(data.get("source", "SOURCE"))]
    if "preparation" in data:
        words += ["--split", str(data["split"]), "--preparation", str(data["preparation"])]
    return " ".join([*words, "--seed", str(description.training.seed), "--out", "my-model/"])
