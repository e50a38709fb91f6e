"""Pages of the map, and how the tests look at them in a browser.

The pictures of the states are kept where GAIA_SCREENSHOTS names a folder.
"""

from __future__ import annotations

import io
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from browser import Browser
from factories import HOSTILE, SQUARE_M, make_fix, make_reason, make_reconstruction, make_unlocated
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.interactive_map import map_page
from gaia_uwb.outputs.report import make_report
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus

RADII = "[...document.querySelectorAll('.range')].map((c) => c.r.baseVal.value)"
DESKTOP, PHONE = (1400, 860), (360, 740)
OTHER_M = np.array([0.5, -8.2])


def make_page(reconstruction: Reconstruction) -> str:
    features = boundary_geojson(reconstruction, local=True)
    return map_page(reconstruction, features, make_report(reconstruction))


def write_pages(folder: Path) -> dict[str, Path]:
    """Write pages: a good result, a doubtful one with hostile ids, one without any cone."""
    doubtful = {
        0: make_fix(HOSTILE[0], SQUARE_M[0], status=AnchorStatus.AMBIGUOUS,
                    mirror_probability=0.37, mirror_position_m=OTHER_M),
        2: make_fix(HOSTILE[2], SQUARE_M[2], status=AnchorStatus.ILL_CONDITIONED,
                    covariance_m2=np.diag([9.0, 0.04])),
        3: make_unlocated(HOSTILE[3]),
    }  # fmt: skip
    results = {
        "good": make_reconstruction(),
        "doubtful": replace(
            make_reconstruction(anchor_ids=HOSTILE, changed=doubtful, name=HOSTILE[0]),
            status=ReconstructionStatus.UNRELIABLE,
            reasons=(make_reason(f"anchor {HOSTILE[0]}: the other side fits as well"),),
        ),
        "nothing": make_reconstruction(
            changed={k: make_unlocated(f"cone-{k}") for k in range(4)}, frame=None
        ),
    }
    return {name: write_page(result, folder / f"{name}.html") for name, result in results.items()}


def write_page(reconstruction: Reconstruction, path: Path) -> Path:
    path.write_text(make_page(reconstruction), encoding="utf-8")
    return path


def show(
    driver: Browser, page: Path, size: tuple[int, int] = DESKTOP, theme: str = "light"
) -> Browser:
    """Open a page on a screen of some size, and see that it has nothing to complain of."""
    driver.prefer(theme)
    driver.resize(*size, touch=size == PHONE)
    driver.open(page)
    assert driver.complaints() == []
    return driver


def picture(driver: Browser, name: str) -> np.ndarray:
    """Return what is seen as (height, width, 3), and keep it if somebody wants to look."""
    png = driver.screenshot()
    if folder := os.environ.get("GAIA_SCREENSHOTS"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"map-{name}.png").write_bytes(png)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=int)


def colour_share(image: np.ndarray, colour: str) -> float:
    """Return the share of the pixels that have a colour, given as #rrggbb."""
    value = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return float((np.abs(image - value).max(axis=2) <= 6).mean())


def texts(driver: Browser, selector: str) -> list[str]:
    found: list[str] = driver.evaluate(
        f"[...document.querySelectorAll('{selector}')].map((e) => e.textContent.trim())"
    )
    return [text.replace("\u00a0", " ") for text in found]


def place(driver: Browser, role: str, index: int = 0) -> tuple[float, float]:
    x, y = driver.evaluate(
        f"places.filter((p) => p.role === '{role}').map((p) => [p.x, p.y])[{index}]"
    )
    return x, y
