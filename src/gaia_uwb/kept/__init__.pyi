from .folds import FULL as FULL, Counts as Counts
from .zone import SHOWN as SHOWN, KeptDrive as KeptDrive, Zone as Zone
