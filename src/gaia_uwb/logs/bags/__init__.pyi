from .container import (
    Bag as Bag,
    Channel as Channel,
    is_packed as is_packed,
    unpack_message as unpack_message,
)
from .ends import (
    EndsError as EndsError,
    check_one_tag as check_one_tag,
    choose_anchor as choose_anchor,
    choose_tag as choose_tag,
    values_of as values_of,
)
from .fields import (
    BY_TOPIC as BY_TOPIC,
    FieldError as FieldError,
    FieldMap as FieldMap,
    RangeFields as RangeFields,
    Reading as Reading,
    find_field as find_field,
    getter as getter,
    resolve_ranges as resolve_ranges,
)
from .guess import guess_ranges as guess_ranges, hint_ranges as hint_ranges
from .log import (
    is_killed_recording as is_killed_recording,
    is_ros2_folder as is_ros2_folder,
    is_ros_file as is_ros_file,
    open_log as open_log,
    scan as scan,
    walk as walk,
)
from .names import is_role as is_role, plain as plain
from .transforms import Link as Link, Transforms as Transforms
from .types import Fields as Fields, Types as Types
