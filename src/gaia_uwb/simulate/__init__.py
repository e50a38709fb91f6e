"""Simulated passes of a vehicle along a work zone, with the truth of everything.

One seed gives one batch of passes, on every machine and with any number of processes; pass k made
alone is pass k of the batch.

>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> scene = simulate_pass(PRESETS["lane-closure"], seed=0)
>>> scene.n_anchors, len(scene.trajectory), scene.truth.clock_offset_s
(8, 481, 0.2)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
