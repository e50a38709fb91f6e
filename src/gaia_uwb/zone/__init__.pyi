from .boundary import make_boundary as make_boundary
from .decision import Combinations as Combinations, Decision as Decision
from .known_facts import KnownFacts as KnownFacts
from .network_prior import dispose as dispose
from .network_sides import decide_zone as decide_zone, widened as widened
from .path_sides import PathSides as PathSides
from .polygons import (
    convex_hull as convex_hull,
    cross as cross,
    hausdorff as hausdorff,
    polygon_area as polygon_area,
    polygon_iou as polygon_iou,
)
from .scene_samples import Scenes as Scenes, sample_scenes as sample_scenes
from .sides import decide_sides as decide_sides, resolve_sides as resolve_sides
from .statement import said_words as said_words
from .uncertainty import (
    PROBABILITY as PROBABILITY,
    BoundaryUncertainty as BoundaryUncertainty,
    Levels as Levels,
    Region as Region,
    boundary_uncertainty as boundary_uncertainty,
)
