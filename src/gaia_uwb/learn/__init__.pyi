from .loop import Progress as Progress
from .loss_plots import plot_losses as plot_losses
from .networks.gaia import Gaia as Gaia
from .networks.make import make_network as make_network
from .recipes import (
    ABLATIONS as ABLATIONS,
    KINDS as KINDS,
    Recipe as Recipe,
    load_recipe as load_recipe,
    make_recipe as make_recipe,
)
from .training_folder import LOG as LOG, STATE as STATE
from .window_sets import (
    WindowSetOptions as WindowSetOptions,
    WindowSets as WindowSets,
    held_out as held_out,
    logged_sets as logged_sets,
    n_folds as n_folds,
    preparation_config as preparation_config,
    prepare_runs as prepare_runs,
    simulated_sets as simulated_sets,
)
from .window_training import WindowTask as WindowTask, train_window as train_window
from .zone_training import ZoneTask as ZoneTask, train_zone as train_zone
