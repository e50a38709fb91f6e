from ._base import (
    ColumnDenoiser as ColumnDenoiser,
    ColumnRanges as ColumnRanges,
    Columns as Columns,
    Denoiser as Denoiser,
    Options as Options,
)
from ._onnx import find_trained as find_trained
from .registry import (
    DENOISERS as DENOISERS,
    denoiser_class as denoiser_class,
    denoiser_identity as denoiser_identity,
    make_denoiser as make_denoiser,
)
from .window_networks import WindowNetwork as WindowNetwork
