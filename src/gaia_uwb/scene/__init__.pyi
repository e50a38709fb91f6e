from .antennas import (
    antenna_path as antenna_path,
    course as course,
    heading as heading,
    tag_scenes as tag_scenes,
)
from .readings import ConeRanges as ConeRanges, RangeLog as RangeLog
from .scenes import LocalFrame as LocalFrame, Scene as Scene, Truth as Truth
from .vehicle import Tag as Tag, Trajectory as Trajectory
