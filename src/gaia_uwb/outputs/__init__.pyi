from .antimeridian import cut_at_antimeridian as cut_at_antimeridian
from .geojson import (
    Json as Json,
    boundary_geojson as boundary_geojson,
    confidence_ellipse as confidence_ellipse,
    lon_lat as lon_lat,
)
from .interactive_map import map_page as map_page
from .picture import plot_reconstruction as plot_reconstruction
from .report import RESULT_FILES as RESULT_FILES, make_report as make_report, write_all as write_all
from .road_words import (
    edge_words as edge_words,
    hull_leads as hull_leads,
    summary_words as summary_words,
)
