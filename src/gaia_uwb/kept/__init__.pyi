from .changes import ConeState as ConeState, Stay as Stay
from .open_drive import OpenDrive as OpenDrive
from .state import FULL as FULL, Counts as Counts
from .zone import SHOWN as SHOWN, KeptCone as KeptCone, KeptDrive as KeptDrive, Zone as Zone
