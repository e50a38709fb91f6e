from .dates import parse_date as parse_date
from .feeds import Feeds as Feeds, make_feeds as make_feeds, write_feeds as write_feeds
from .parts import FeedPart as FeedPart, RoadZone as RoadZone
from .problems import Problem as Problem
from .schemas import OfficialSchemas as OfficialSchemas
from .settings import (
    DataSourceConfig as DataSourceConfig,
    FeedConfig as FeedConfig,
    LaneConfig as LaneConfig,
    load_feed_config as load_feed_config,
    make_feed_config as make_feed_config,
)
from .validate import (
    MOST_PROBLEMS as MOST_PROBLEMS,
    validate_document as validate_document,
    validate_files as validate_files,
)
from .zone import FeedZone as FeedZone, read_zone as read_zone, zone_of as zone_of
