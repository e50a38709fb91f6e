from ._shared import (
    ConfigError as ConfigError,
)
from ._shared import (
    DownloadError as DownloadError,
)
from ._shared import (
    GaiaError as GaiaError,
)
from ._shared import (
    InputError as InputError,
)
from ._shared import (
    SourceError as SourceError,
)
from .alignment import align as align
from .alignment import calibrate as calibrate
from .api import load_scenes as load_scenes
from .api import read as read
from .api import reconstruct as reconstruct
from .config import PipelineConfig as PipelineConfig
from .config import load_config as load_config
from .denoised import DenoisedRanges as DenoisedRanges
from .denoisers import make_denoiser as make_denoiser
from .episode import Episode as Episode
from .estimate import (
    AnchorFix as AnchorFix,
)
from .estimate import (
    AnchorStatus as AnchorStatus,
)
from .estimate import (
    Boundary as Boundary,
)
from .estimate import (
    BoundaryStatus as BoundaryStatus,
)
from .estimate import (
    Reason as Reason,
)
from .estimate import (
    ReasonKind as ReasonKind,
)
from .evaluate import CheckReport as CheckReport
from .evaluate import check_scene as check_scene
from .logs import read_native as read_native
from .logs import write_native as write_native
from .outputs import write_all as write_all
from .pipeline import prepare as prepare
from .reconstruction import (
    Reconstruction as Reconstruction,
)
from .reconstruction import (
    ReconstructionStatus as ReconstructionStatus,
)
from .scene import (
    LocalFrame as LocalFrame,
)
from .scene import (
    RangeLog as RangeLog,
)
from .scene import (
    Scene as Scene,
)
from .scene import (
    Trajectory as Trajectory,
)
from .scene import (
    Truth as Truth,
)
from .zone import make_boundary as make_boundary
from .zone import resolve_sides as resolve_sides

__version__: str
