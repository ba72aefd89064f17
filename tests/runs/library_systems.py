"""Systems simulated by the tests of the library."""

#: Dissipative gas of rough disks of two species under gravity.
GAS = """&box boundary = 'periodic', 'wall' gravity = 0, -1 /
&species name = 'a' count = 60 radius = 0.02 velocities = 'maxwell' temperature = 1 /
&species name = 'b' count = 20 radius = 0.04 mass = 3 velocities = 'rest' /
&contact restitution = 0.9 tangential_restitution = 0.5 contact_time = 1e-4 /
&output event_log = .true. /
&stop collisions = 400 /
"""

#: Settings with which this gas is elastic.
ENDLESS = {"contact.restitution": 1, "contact.tangential_restitution": 1}
