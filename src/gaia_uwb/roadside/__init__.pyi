from .along_road import find_zones as find_zones, road_edge as road_edge
from .road_boundary import (
    ClosedArea as ClosedArea,
    DroveThrough as DroveThrough,
    Edge as Edge,
    EdgeBand as EdgeBand,
    FreeWidth as FreeWidth,
    Gap as Gap,
    RoadBoundary as RoadBoundary,
    RoadSide as RoadSide,
    Taper as Taper,
    WidthSource as WidthSource,
    WorkZone as WorkZone,
    ZoneEnd as ZoneEnd,
    ZoneForm as ZoneForm,
)
from .road_line import DrivenPath as DrivenPath, RoadLine as RoadLine
from .runs import Drive as Drive
