"""Inputs and settings of periodic gases, shared by several test files."""

#: Boundaries of a synthetic run in a periodic box.
PERIODIC = (True, True)

#: Input of a periodic gas, into which the fixture `gas` inserts the settings of `USUAL`.
GAS = """&run seed = {seed} / &box boundary = {sides} /
&species count = {count} packing_fraction = {packing} temperature = 2 mass = 3 /
&contact restitution = {restitution} / &stop collisions_per_disk = {length} /
&output event_log = {log} helfand = {helfand} {cadence} /
"""
USUAL = {
    "seed": 1, "sides": "'periodic', 'periodic'", "count": 64, "packing": 0.1, "restitution": 1,
    "length": 400, "log": ".true.", "helfand": ".true.",
    "cadence": "frames_every_time = 0.05 observables_every_time = 0.02",
}  # fmt: skip

#: Packing fraction in `GAS`, followed by a second species with another mass and number of disks.
UNLIKE = "0.1 mass = {} temperature = 2 / &species name = 'b' packing_fraction = 0.1 count = {}"
