from .gpx import read_gpx as read_gpx
from .guess import guess_format as guess_format
from .nmea import read_nmea as read_nmea
from .poses import read_euroc as read_euroc, read_kitti as read_kitti, read_tum as read_tum
from .rtklib import read_rtklib as read_rtklib
from .ubx import read_ubx as read_ubx
