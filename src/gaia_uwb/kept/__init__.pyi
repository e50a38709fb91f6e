from .changes import ConeState as ConeState, Stay as Stay
from .state import FULL as FULL, Counts as Counts
from .zone import SHOWN as SHOWN, KeptCone as KeptCone, KeptDrive as KeptDrive, Zone as Zone
