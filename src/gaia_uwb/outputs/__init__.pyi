from .geojson import Json as Json
from .geojson import boundary_geojson as boundary_geojson
from .geojson import confidence_ellipse as confidence_ellipse
from .geojson import lon_lat as lon_lat
from .interactive_map import map_page as map_page
from .report import make_report as make_report
from .report import write_all as write_all
