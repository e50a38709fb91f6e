from .augmentation import varied as varied
from .export import export_window as export_window, export_zone as export_zone
from .gaia import Gaia as Gaia
from .gaia_set import GaiaSet as GaiaSet
from .make import make_network as make_network
from .mlp import Mlp as Mlp
from .pose_mlp import PoseMlp as PoseMlp
from .window_losses import WindowBatch as WindowBatch, window_loss_terms as window_loss_terms
from .zone_losses import (
    ZoneTargets as ZoneTargets,
    place_log_density as place_log_density,
    wrong_side_share as wrong_side_share,
    zone_loss_terms as zone_loss_terms,
)
