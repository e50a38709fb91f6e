from .calibration import calibrate as calibrate
from .clock import estimate_clock_offset as estimate_clock_offset
from .implausible import log_notes as log_notes, log_problems as log_problems
from .readings import (
    Pose as Pose,
    Readings as Readings,
    anchor_heights as anchor_heights,
    fit_anchors as fit_anchors,
    gather_readings as gather_readings,
    pose_at as pose_at,
    slant_m as slant_m,
    usual_interval_s as usual_interval_s,
)
from .spikes import gate_spikes as gate_spikes
from .timeline import align as align
