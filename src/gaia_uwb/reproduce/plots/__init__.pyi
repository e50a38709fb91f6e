from .distributions import plot_boxes as plot_boxes, plot_cdfs as plot_cdfs
from .errors import (
    plot_autocorrelation as plot_autocorrelation,
    plot_error_over_distance as plot_error_over_distance,
    plot_quantiles as plot_quantiles,
)
from .gates import GateRecord as GateRecord, plot_gate as plot_gate
from .layouts import DrawnZone as DrawnZone, plot_layouts as plot_layouts
from .robustness import plot_robustness as plot_robustness
