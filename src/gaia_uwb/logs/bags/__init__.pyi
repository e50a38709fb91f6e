from .container import Bag as Bag, Channel as Channel, unpack_message as unpack_message
from .fields import (
    BY_TOPIC as BY_TOPIC,
    FieldError as FieldError,
    FieldMap as FieldMap,
    Reading as Reading,
    find_field as find_field,
    getter as getter,
    guess_ranges as guess_ranges,
    resolve_ranges as resolve_ranges,
)
from .log import is_ros2_folder as is_ros2_folder, open_log as open_log, scan as scan, walk as walk
from .types import Fields as Fields, Types as Types
