"""The reconstruction as KML 2.2, for Google Earth and other viewers of the whole globe.

>>> from gaia_uwb.outputs.kml import kml
>>> print(kml({"type": "FeatureCollection", "gaia": {"scene": "A & B"}, "features": []})[:60])
<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://ww
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gaia_uwb._shared import in_html
from gaia_uwb.outputs.geojson import Json

# Colours as KML has them: alpha, blue, green, red; for lines and areas.
_STYLES = {
    "path": ("ff9a9a9a", "00ffffff"),
    "hull-outer": ("ffa34f7a", "00ffffff"),
    "hull": ("ff222222", "6642e4f0"),
    "outline": ("ff222222", "00ffffff"),
    "hull-inner": ("ff739e00", "00ffffff"),
    "closed-area-outer": ("ffa34f7a", "00ffffff"),
    "closed-area": ("ff222222", "6642e4f0"),
    "open-strip": ("0042e4f0", "3342e4f0"),
    "closed-area-inner": ("ff739e00", "00ffffff"),
    "edge-band": ("ff005ed5", "40005ed5"),
    "edge": ("ff005ed5", "00ffffff"),
    "taper": ("ffb27200", "00ffffff"),
    "gap": ("ff739e00", "00ffffff"),
    "ellipse": ("ffb27200", "30b27200"),
}
_WIDE = ("edge", "taper")
_HULL = ("hull-outer", "hull", "hull-inner", "outline")


def kml(collection: Json) -> str:
    """Return a feature collection in WGS84 as the text of a KML file.

    Parameters
    ----------
    collection
        From :func:`gaia_uwb.outputs.boundary_geojson`; its coordinates must be degrees.
    """
    content: Any = collection
    features = content["features"]
    # The hull is another shape than what a driver sees, unless the cones stand around an area.
    others = any(each["properties"].get("form", "area") != "area" for each in features)
    hidden = _HULL if others else ()
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>',
        f"<name>{in_html(str(content['gaia']['scene']))}</name>",
        *(
            f'<Style id="{role}"><LineStyle><color>{line}</color>'
            f"<width>{4 if role in _WIDE else 2}</width></LineStyle>"
            f"<PolyStyle><color>{area}</color></PolyStyle></Style>"
            for role, (line, area) in _STYLES.items()
        ),
        *(line for feature in features for line in _placemark(feature, hidden)),
        "</Document></kml>",
    ]
    return "\n".join(lines) + "\n"


def _placemark(feature: Any, hidden: Sequence[str]) -> Iterator[str]:
    properties = dict(feature["properties"])
    role = properties.pop("role")
    name = properties.get("id", role)
    yield f"<Placemark><name>{in_html(str(name))}</name>"
    if role in hidden:
        yield "<visibility>0</visibility>"
    if role in _STYLES:
        yield f"<styleUrl>#{role}</styleUrl>"
    data = "".join(
        f'<Data name="{in_html(key)}"><value>{in_html(str(value))}</value></Data>'
        for key, value in {"role": role, **properties}.items()
        if value is not None
    )
    yield f"<ExtendedData>{data}</ExtendedData>"
    kind, coordinates = feature["geometry"]["type"], feature["geometry"]["coordinates"]
    if kind == "Point":
        yield f"<Point>{_coordinates([coordinates])}</Point>"
    elif kind == "LineString":
        yield _line(coordinates)
    elif kind == "MultiLineString":
        yield f"<MultiGeometry>{''.join(map(_line, coordinates))}</MultiGeometry>"
    else:
        polygons = [coordinates] if kind == "Polygon" else coordinates
        yield f"<MultiGeometry>{''.join(map(_polygon, polygons))}</MultiGeometry>"
    yield "</Placemark>"


def _line(positions: Any) -> str:
    return f"<LineString><tessellate>1</tessellate>{_coordinates(positions)}</LineString>"


def _polygon(rings: Any) -> str:
    inner = "".join(
        f"<innerBoundaryIs><LinearRing>{_coordinates(ring)}</LinearRing></innerBoundaryIs>"
        for ring in rings[1:]
    )
    return (
        "<Polygon><tessellate>1</tessellate><outerBoundaryIs><LinearRing>"
        f"{_coordinates(rings[0])}</LinearRing></outerBoundaryIs>{inner}</Polygon>"
    )


def _coordinates(points: Any) -> str:
    return f"<coordinates>{' '.join(f'{lon},{lat}' for lon, lat in points)}</coordinates>"
