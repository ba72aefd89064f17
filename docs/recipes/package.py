# Package recipe for Spack, which has not been tested. To install Ricochet with Spack, copy this
# file into the folder packages/ricochet/ of your Spack repository, and set `git` to the address of
# this project.
from spack.package import *
from spack_repo.builtin.build_systems.makefile import MakefilePackage


class Ricochet(MakefilePackage):
    """Event-driven simulation of hard disks."""

    git = "ADDRESS OF THE PROJECT"
    license("MIT")
    version("main", branch="main")

    variant("python", default=True, description="scripts and the package ricochet")

    depends_on("c", type="build")
    depends_on("fortran", type="build")
    depends_on("gmake", type="build")
    depends_on("hdf5@1.10: +fortran ~mpi")
    depends_on("python@3.11:", type=("build", "run"))
    for package in ("numpy", "scipy", "h5py", "matplotlib@3.9:", "tqdm", "aiohttp"):
        depends_on(f"py-{package}", type="run", when="+python")

    requires("%fortran=gcc@12:", msg="built and tested with gfortran")

    def build(self, spec, prefix):
        # The compiler wrapper of Spack adds optimisation flags for the target processor. Those of
        # the Makefile would optimise for the processor of the compiling computer.
        make("ARCH=x86-64", "all", "library")

    def install(self, spec, prefix):
        make(f"PREFIX={prefix}", "install")
