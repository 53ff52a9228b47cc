# What pyproject.toml cannot say: configs/ and the samples in data/raw/ go into the wheel.
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

SHIPPED = ("configs", "data/raw/archive", "data/raw/hazard", "data/raw/records")


class Build(build_py):
    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            for name in SHIPPED:
                into = Path(self.build_lib, "pipeline", "shipped", name)
                shutil.rmtree(into, ignore_errors=True)  # of an earlier build
                shutil.copytree(name, into)


setup(cmdclass={"build_py": Build})
