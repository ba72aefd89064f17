"""What pip asks when it builds the package: its commands, and what of the project lies in it."""

import os
import subprocess
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).parent
SCRIPTS = sorted((ROOT / "post").glob("*.py"))
#: The shell scripts of sweeps, and their names in the package.
SWEEP_SCRIPTS = {"ensemble.sh": "ricochet-ensemble", "ensemble_folder.sh": "ensemble_folder.sh"}
BUILT = {"ricochet": "bin", "libricochet.so": "lib", "libricochet_files.so": "lib"}


class Commands(MetadataHookInterface):
    """Fills `scripts` in pyproject.toml."""

    def update(self, metadata: dict) -> None:
        names = (f"ricochet-{script.stem.replace('_', '-')}" for script in SCRIPTS)
        commands = ["ricochet", "ricochet-ensemble", *names]
        metadata["scripts"] = dict.fromkeys(commands, "ricochet.commands:main")


class Package(BuildHookInterface):
    """Builds program and library; adds them, `ensemble.sh`, scripts, their page and inputs."""

    def initialize(self, version: str, build_data: dict) -> None:
        if version == "editable":  # a clone has them in its folders
            return
        for path in (*SCRIPTS, ROOT / "post/page", ROOT / "input"):
            build_data["force_include"][str(path)] = f"ricochet/{path.relative_to(ROOT)}"
        folder = ROOT / os.environ.get("BUILD", "build")
        try:
            subprocess.run(["make", "all", "library"], cwd=ROOT, check=True)
        except (OSError, subprocess.CalledProcessError) as problem:
            tools = "make, bash, gfortran and HDF5 with its compiler h5fc (Debian: libhdf5-dev)"
            raise SystemExit(f"cannot build Ricochet ({problem}); it needs {tools}") from None
        for script, place in SWEEP_SCRIPTS.items():
            build_data["force_include"][str(ROOT / "runs" / script)] = f"ricochet/bin/{place}"
        for name, place in BUILT.items():
            build_data["force_include"][str(folder / name)] = f"ricochet/{place}/{name}"
        build_data |= {"pure_python": False, "infer_tag": False, "tag": f"py3-none-{platform()}"}


def platform() -> str:
    """Of this machine, as wheels name it; any Python 3 will do."""
    from sysconfig import get_platform

    return get_platform().replace("-", "_").replace(".", "_")
