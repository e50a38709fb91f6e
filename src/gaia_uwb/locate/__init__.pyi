from .common_prior import (
    PATTERN_M as PATTERN_M,
    TAG_BIAS_M as TAG_BIAS_M,
    heading_sigma_m as heading_sigma_m,
    known_clock as known_clock,
    shared_prior as shared_prior,
)
from .error_sizes import (
    KeptSizes as KeptSizes,
    SizeSums as SizeSums,
    sizes_of_cones as sizes_of_cones,
    sizes_of_errors as sizes_of_errors,
)
from .folding import (
    DriveBlock as DriveBlock,
    DriveReadings as DriveReadings,
    KnownBefore as KnownBefore,
    Point as Point,
    own_prior as own_prior,
)
from .fusion import (
    Disagreement as Disagreement,
    Fused as Fused,
    Scatter as Scatter,
    error_scale2 as error_scale2,
    fuse as fuse,
    mark_moved as mark_moved,
    with_scatter as with_scatter,
)
from .honest_errors import Curves as Curves, square_root as square_root
from .hypotheses import Hypotheses as Hypotheses
from .known_values import (
    Said as Said,
    contradicted_values as contradicted_values,
    said_of as said_of,
)
from .lasting_errors import (
    DrivePrior as DrivePrior,
    drive_prior as drive_prior,
    lasting_prior as lasting_prior,
    vehicle_of as vehicle_of,
)
from .paper_solver import locate as locate
from .passes import (
    end_to_end as end_to_end,
    in_frame as in_frame,
    in_one_frame as in_one_frame,
    join_windows as join_windows,
    same_drive as same_drive,
    starts_s as starts_s,
    with_anchor_ranges as with_anchor_ranges,
    with_anchors as with_anchors,
)
from .path_noise import smooth_path as smooth_path
from .slow_errors import (
    DRIVE as DRIVE,
    OWN as OWN,
    RADIOS as RADIOS,
    SCALES_M as SCALES_M,
)
from .zone_fit import ALIKE as ALIKE
from .zone_places import (
    CLOCK_KNOWN as CLOCK_KNOWN,
    ZonePlaces as ZonePlaces,
    find_places as find_places,
    fits as fits,
    with_clock as with_clock,
    with_run_errors as with_run_errors,
)
