from .fusion import fuse as fuse, mark_moved as mark_moved
from .honest_errors import Curves as Curves, square_root as square_root
from .hypotheses import Hypotheses as Hypotheses, locate as locate
from .joint_fit import LocatedPass as LocatedPass
from .passes import (
    end_to_end as end_to_end,
    in_one_frame as in_one_frame,
    join_windows as join_windows,
    same_drive as same_drive,
    starts_s as starts_s,
    with_anchor_ranges as with_anchor_ranges,
    with_anchors as with_anchors,
)
