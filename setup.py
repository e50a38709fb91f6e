"""Build the compiled parts: inner loops of the solver (_solver.c) and of outlines (_tour.c)."""

import sys

from setuptools import Extension, setup

# Sums may be reordered so that they vectorise; NaN and infinity keep their meaning.
FLAGS = [
    "-O3",
    "-std=c11",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
    "-ffp-contract=fast",
    "-Wall",
]

setup(
    ext_modules=[
        Extension(
            f"gaia_uwb.{name}",
            sources=[f"src/gaia_uwb/{name}.c"],
            extra_compile_args=[] if sys.platform == "win32" else FLAGS,
        )
        for name in ("_solver", "_tour")
    ]
)
