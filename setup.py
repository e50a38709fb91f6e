"""Build the one compiled part: the solver's inner loop (see src/gaia_uwb/_solver.c)."""

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
            "gaia_uwb._solver",
            sources=["src/gaia_uwb/_solver.c"],
            extra_compile_args=[] if sys.platform == "win32" else FLAGS,
        )
    ]
)
