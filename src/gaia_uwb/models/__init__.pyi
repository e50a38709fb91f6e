from .card import model_card as model_card
from .checkpoint import (
    CARD as CARD,
    DESCRIPTION as DESCRIPTION,
    ONNX as ONNX,
    WEIGHTS as WEIGHTS,
    find_model as find_model,
    pack as pack,
    read_description as read_description,
    read_file as read_file,
    read_weights as read_weights,
    seal as seal,
    unpack as unpack,
)
from .description import (
    ZONE_FARTHEST_M as ZONE_FARTHEST_M,
    ZONE_LONGEST_STEPS as ZONE_LONGEST_STEPS,
    ZONE_MOST_ANCHORS as ZONE_MOST_ANCHORS,
    GaiaArchitecture as GaiaArchitecture,
    GaiaSetArchitecture as GaiaSetArchitecture,
    MlpArchitecture as MlpArchitecture,
    Model as Model,
    PoseMlpArchitecture as PoseMlpArchitecture,
    WindowArchitecture as WindowArchitecture,
    WindowModel as WindowModel,
    ZoneModel as ZoneModel,
)
from .domain import Domain as Domain, Normalisation as Normalisation
from .path_frame import PathFrame as PathFrame
from .plausible_correction import (
    largest_median_correction_m as largest_median_correction_m,
    needed_corrections_m as needed_corrections_m,
    plausible_correction_m as plausible_correction_m,
)
from .training_options import (
    WindowTrainingOptions as WindowTrainingOptions,
    ZoneTrainingOptions as ZoneTrainingOptions,
    base_training as base_training,
)
from .window_inputs import (
    WindowInputs as WindowInputs,
    blend as blend,
    make_window_inputs as make_window_inputs,
    window_starts as window_starts,
    window_targets as window_targets,
)
from .zone_inputs import (
    ZoneInputs as ZoneInputs,
    ZoneReadings as ZoneReadings,
    make_zone_inputs as make_zone_inputs,
    zone_readings as zone_readings,
)
