from xml.etree import ElementTree as ET

import numpy as np

from factories import SQUARE_M, make_fix, make_reconstruction
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.kml import kml

SPACE = {"k": "http://www.opengis.net/kml/2.2"}


def test_every_feature_is_a_placemark_in_its_place():
    fix = make_fix("<b>&A</b>", SQUARE_M[0])
    collection = boundary_geojson(make_reconstruction(changed={0: fix}, name="A & B <x>"))
    document = ET.fromstring(kml(collection))
    assert document.find("k:Document/k:name", SPACE).text == "A & B <x>"
    placemarks = document.findall(".//k:Placemark", SPACE)
    assert len(placemarks) == len(collection["features"])
    for placemark, feature in zip(placemarks, collection["features"], strict=True):
        texts = [each.text for each in placemark.iterfind(".//k:coordinates", SPACE)]
        places = [[float(n) for n in pair.split(",")] for text in texts for pair in text.split()]
        told = np.array(feature["geometry"]["coordinates"]).reshape(-1, 2)
        assert np.array_equal(places, told)
    names = [each.find("k:name", SPACE).text for each in placemarks]
    assert "<b>&A</b>" in names


def test_styles_that_are_named_exist():
    document = ET.fromstring(kml(boundary_geojson(make_reconstruction())))
    styles = {f"#{each.get('id')}" for each in document.iterfind(".//k:Style", SPACE)}
    used = {each.text for each in document.iterfind(".//k:styleUrl", SPACE)}
    assert used and used <= styles
