"""Work-zone feeds: made of a reconstruction, and checked (WZDx 4.2 and CWZ 1.0)."""

from gaia_uwb.wzdx.feeds import Feeds, make_feeds, write_feeds
from gaia_uwb.wzdx.problems import Problem
from gaia_uwb.wzdx.schemas import OfficialSchemas
from gaia_uwb.wzdx.settings import (
    DataSourceConfig,
    FeedConfig,
    load_feed_config,
    make_feed_config,
)
from gaia_uwb.wzdx.validate import validate_document, validate_files
from gaia_uwb.wzdx.zone import Zone, read_zone, zone_of

__all__ = [
    "DataSourceConfig",
    "FeedConfig",
    "Feeds",
    "OfficialSchemas",
    "Problem",
    "Zone",
    "load_feed_config",
    "make_feed_config",
    "make_feeds",
    "read_zone",
    "validate_document",
    "validate_files",
    "write_feeds",
    "zone_of",
]
