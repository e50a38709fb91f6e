"""Build the compiled parts: the inner loops of the solver and of outlines."""

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
            sources=[f"src/gaia_uwb/{name.replace('.', '/')}.c"],
            extra_compile_args=[] if sys.platform == "win32" else FLAGS,
        )
        for name in ("solver._solver", "zone._tour")
    ]
)
