"""Copies what lies outside of the package into a wheel; the rest of the build is in setup.cfg."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithWeights(build_py):
    """Builds the package, with the files of `weights/` in `keras_pendulum/shipped_weights/`.

    `examples/my_dqn.py` is copied to `keras_pendulum/exercise/`. An editable install needs no
    copies: the package finds both folders beside it. With `package_dir` in
    setup.cfg instead, setuptools would install an import finder in place of a path.
    """

    def run(self) -> None:
        """Builds the package."""
        super().run()
        if not self.editable_mode:
            folder = Path(self.build_lib, "keras_pendulum", "shipped_weights")
            folder.mkdir(parents=True, exist_ok=True)
            for file in (*Path("weights").glob("*.h5"), Path("weights", "returns.json")):
                self.copy_file(str(file), str(folder / file.name))
            self.copy_file("examples/my_dqn.py", str(folder.parent / "exercise" / "my_dqn.py"))


setup(cmdclass={"build_py": BuildWithWeights})
