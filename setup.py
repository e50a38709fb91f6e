"""Build the compiled parts: the inner loops of the solver, of the estimator and of outlines."""

import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

# Sums may be reordered so that they vectorise; NaN and infinity keep their meaning. Without debug
# information a library is smaller and names no folder of the machine that built it.
FLAGS = [
    "-O3",
    "-std=c11",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
    "-ffp-contract=fast",
    "-Wall",
    "-g0",
]


class BuildWithoutPaths(build_ext):
    """Leave out the folder of the building Python's libraries, which is nowhere else."""

    def build_extensions(self) -> None:
        """Compile and link."""
        linker = getattr(self.compiler, "linker_so", None)
        if linker is not None:
            self.compiler.linker_so = [word for word in linker if "-rpath" not in word]
        super().build_extensions()


setup(
    cmdclass={"build_ext": BuildWithoutPaths},
    ext_modules=[
        Extension(
            f"gaia_uwb.{name}",
            sources=[f"src/gaia_uwb/{name.replace('.', '/')}.c"],
            extra_compile_args=[] if sys.platform == "win32" else FLAGS,
        )
        for name in ("locate._covariances", "locate._readings", "solver._solver", "zone._tour")
    ],
)
