# SPDX-License-Identifier: BSD-2-Clause
"""Builds the extension by CMake; everything else is in pyproject.toml.

CMAKE_ARGS is handed on to CMake, CMAKE_BUILD_PARALLEL_LEVEL says how many jobs run at a time.
"""

import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent


def version():
    """The version from its one place."""
    header = (ROOT / "include/stillpoint/version.hpp").read_text()
    return re.search(r'define STILLPOINT_VERSION "([\d.]+)"', header).group(1)


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        target = pathlib.Path(self.get_ext_fullpath(ext.name)).resolve()
        build = pathlib.Path(self.build_temp).resolve()
        options = [
            "-DCMAKE_BUILD_TYPE=Release",
            f"-DPython_EXECUTABLE={sys.executable}",
            "-DSTILLPOINT_BUILD_PYTHON=ON",
            "-DSTILLPOINT_PYTHON_REQUIRED=ON",
            "-DSTILLPOINT_BUILD_TESTS=OFF",
            "-DSTILLPOINT_BUILD_BENCHMARKS=OFF",
            "-DSTILLPOINT_BUILD_EXAMPLES=OFF",
            "-DSTILLPOINT_INSTALL=OFF",
        ]
        if shutil.which("ninja"):
            options += ["-G", "Ninja"]
        options += shlex.split(os.environ.get("CMAKE_ARGS", ""))
        subprocess.run(["cmake", "-S", ROOT, "-B", build, *options], check=True)
        subprocess.run(
            ["cmake", "--build", build, "--config", "Release", "--target", "stillpoint_python"],
            check=True,
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        (built,) = (build / "python" / "stillpoint").glob("_stillpoint*" + target.suffix)
        shutil.copy(built, target)


setup(
    version=version(),
    ext_modules=[Extension("stillpoint._stillpoint", sources=[])],
    cmdclass={"build_ext": CMakeBuild},
)
