"""How each kind of network is trained on each kind of data, unless told otherwise.

The numbers were chosen on validation data (``docs/training.md`` says how), never on a test set.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from gaia_uwb._shared import ConfigError, read_yaml, shown
from gaia_uwb.config import Settings, settings_problems
from gaia_uwb.learn.window_sets import WindowSetOptions
from gaia_uwb.models import (
    GaiaArchitecture,
    MlpArchitecture,
    PoseMlpArchitecture,
    WindowArchitecture,
    WindowTrainingOptions,
    base_training,
)

KINDS: dict[str, WindowArchitecture] = {
    "mlp": MlpArchitecture(),
    "pose-mlp": PoseMlpArchitecture(),
    "gaia": GaiaArchitecture(),
}
"""Networks that can be trained, with their sizes."""

ABLATIONS: dict[str, WindowArchitecture] = {
    "gaia": GaiaArchitecture(),
    "without-layout-head": GaiaArchitecture(layout_head=False, geo_dist=False),
    "without-geo-dist": GaiaArchitecture(geo_dist=False),
    "unfrozen-base": GaiaArchitecture(train_base=True),
}
"""The paper's ablations, beside the whole network."""


class Recipe(Settings):
    """All that a training depends on besides its data's source."""

    network: Annotated[WindowArchitecture, Field(discriminator="kind")]
    training: WindowTrainingOptions
    sets: WindowSetOptions

    def with_seed(self, seed: int) -> Recipe:
        """Return the recipe with another seed.

        Parameters
        ----------
        seed
            At least 0.
        """
        training = self.training.model_copy(update={"seed": seed})
        return self.model_copy(update={"training": training})


def make_recipe(network: WindowArchitecture, *, simulated: bool) -> Recipe:
    """Return how a network is trained.

    Parameters
    ----------
    network
        Kind, sizes and variants.
    simulated
        Whether on the simulator's episodes, or on the few windows of logs.
    """
    if simulated:
        training = WindowTrainingOptions(epochs=20)
    else:
        # Few windows, and layouts that can be learned by heart.
        training = WindowTrainingOptions(
            epochs=45,
            patience=90,
            batch_size=32,
            layout_weight=0.3,
            consistency_weight=0.3,
            anchor_weight=0.1,
            outlier_share=0.03,
        )
    if not isinstance(network, GaiaArchitecture):
        training = base_training(training)
    return Recipe(network=network, training=training, sets=WindowSetOptions())


def load_recipe(path: Path, default: Recipe) -> Recipe:
    """Read changes to a recipe from a YAML file.

    Parameters
    ----------
    path
        A file with any of the sections ``network``, ``training`` and ``sets``.
    default
        What it leaves out.

    Raises
    ------
    ConfigError
        If the file cannot be read, or holds a key twice, an unknown key or an impossible value.
    """
    try:
        content = read_yaml(path) or {}
        sections = default.model_dump()
        if not isinstance(content, dict) or set(content) - set(sections):
            raise ConfigError(f"{path}: expected only the sections {', '.join(sections)}")
        for name, changes in content.items():
            if not isinstance(changes, dict):
                raise ConfigError(f"{path}: {name}: expected settings, got {shown(changes)}")
            sections[name] |= changes
        return Recipe.model_validate(sections)
    except ValidationError as error:
        raise ConfigError(f"{path}: {settings_problems(error)}") from error
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot read a recipe: {error}") from error
