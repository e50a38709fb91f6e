from .batches import simulate as simulate, simulate_episodes as simulate_episodes
from .blocks import EpisodeBlock as EpisodeBlock, simulate_blocks as simulate_blocks
from .days import (
    LATE_VEHICLE as LATE_VEHICLE,
    LYING_VEHICLE as LYING_VEHICLE,
    Change as Change,
    Day as Day,
    simulate_day as simulate_day,
)
from .layouts import road_to_local as road_to_local
from .passes import (
    Setting as Setting,
    set_up as set_up,
    simulate_episode as simulate_episode,
    simulate_pass as simulate_pass,
    simulate_zone as simulate_zone,
)
from .presets import PRESETS as PRESETS, find_preset as find_preset
from .reality.check import (
    PAPER_ROWS as PAPER_ROWS,
    VIEWS as VIEWS,
    Row as Row,
    SimulatorCheck as SimulatorCheck,
    check_simulator as check_simulator,
)
from .reality.fit import fit_ranging as fit_ranging, preset_text as preset_text
from .reality.statistics import ErrorSummary as ErrorSummary, autocorrelation as autocorrelation
from .roaming import simulate_roaming as simulate_roaming
from .settings import (
    ClosureConfig as ClosureConfig,
    DriveConfig as DriveConfig,
    PassConfig as PassConfig,
    RangingConfig as RangingConfig,
    RoadConfig as RoadConfig,
    TagConfig as TagConfig,
    ZoneKind as ZoneKind,
)
from .source import load as load
