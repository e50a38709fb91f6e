from ._shared import (
    ConfigError as ConfigError,
    DownloadError as DownloadError,
    GaiaError as GaiaError,
    InputError as InputError,
    SourceError as SourceError,
)
from .alignment import align as align, calibrate as calibrate
from .api import load_scenes as load_scenes, read as read, reconstruct as reconstruct
from .config import PipelineConfig as PipelineConfig, load_config as load_config
from .denoised import DenoisedRanges as DenoisedRanges
from .denoisers import make_denoiser as make_denoiser
from .episode import Episode as Episode
from .estimate import (
    AnchorFix as AnchorFix,
    AnchorStatus as AnchorStatus,
    Boundary as Boundary,
    BoundaryStatus as BoundaryStatus,
    Reason as Reason,
    ReasonKind as ReasonKind,
    SideSource as SideSource,
)
from .evaluate import CheckReport as CheckReport, check_scene as check_scene
from .kept import Zone as Zone
from .logs import read_native as read_native, write_native as write_native
from .outputs import write_all as write_all
from .pipeline import prepare as prepare
from .reconstruction import (
    Reconstruction as Reconstruction,
    ReconstructionStatus as ReconstructionStatus,
)
from .scene import (
    ConeRanges as ConeRanges,
    LocalFrame as LocalFrame,
    RangeLog as RangeLog,
    Scene as Scene,
    Tag as Tag,
    Trajectory as Trajectory,
    Truth as Truth,
    tag_scenes as tag_scenes,
)
from .zone import make_boundary as make_boundary, resolve_sides as resolve_sides

__version__: str
