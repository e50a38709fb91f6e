"""A model's card: what it is, what it was trained on, its scores and its limits, as Markdown."""

from __future__ import annotations

from gaia_uwb.model import ModelDescription

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
- A window in which it would move an anchor's ranges by {limit:.2f} m or more (99 % of the training
  windows need less) was taken for one of another layout, and gets a running median.
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


def _command(description: ModelDescription) -> str:
    """Return the command that trains a model like this one."""
    data = description.data
    words = ["gaia train", description.network.kind, "--data", str(data.get("source", "SOURCE"))]
    if "preparation" in data:
        words += ["--split", str(data["split"]), "--preparation", str(data["preparation"])]
    return " ".join([*words, "--seed", str(description.training.seed), "--out", "my-model/"])
