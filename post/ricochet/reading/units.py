"""Names of units in the labels of axes.

The numbers in an input file have no units; naming units changes labels but no numbers.
"""

from typing import NamedTuple

from .files import did_you_mean

#: Exponents of length, time and mass in the unit of each quantity, in two dimensions.
POWERS = {
    "number": (0, 0, 0),  # dimensionless
    "length": (1, 0, 0),
    "time": (0, 1, 0),
    "mass": (0, 0, 1),
    "rate": (0, -1, 0),
    "speed": (1, -1, 0),
    "squared speed": (2, -2, 0),
    "energy": (2, -2, 1),
    "number density": (-2, 0, 0),
    "stress": (0, -2, 1),
    "viscosity": (0, -1, 1),
    "heat flux": (1, -3, 1),
}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Units(NamedTuple):
    """Names of the units of length, time, mass and energy; empty if unknown."""

    length: str = ""
    time: str = ""
    mass: str = ""
    energy: str = ""  # composed of the other three units if empty

    def label(self, words: str, quantity: str = "") -> str:
        """Return the label of an axis, for example 'time (s)' or 'time (reduced units)'.

        The unit is that of `quantity`, by default `words`, in `POWERS`. A probability density has
        the reciprocal unit, given as '1/speed', for example.
        """
        unit = self.name(quantity or words)
        return f"{words} ({unit})" if unit else words

    def coordinate(self, name: str) -> str:
        """Return the short label of an axis of the box: 'x (m)', or 'x' if the unit is unknown."""
        return f"{name} ({self.length})" if self.length else name

    def name(self, quantity: str) -> str:
        """Return the unit of a quantity, or 'reduced units' if the name of a unit is unknown."""
        if quantity == "energy" and self.energy:
            return self.energy
        whole = quantity.removeprefix("1/")
        sign = 1 if whole == quantity else -1
        powers = zip(POWERS[whole][::-1], self[2::-1], strict=True)  # mass is written first
        parts = [(sign * power, name) for power, name in powers if power]
        return product(parts) if all(name for _, name in parts) else "reduced units"


UNNAMED = Units()


def product(parts: list[tuple[int, str]]) -> str:
    """Return a product of powers of units as text, such as 'cm/s', 'kg m²/s²' or '1/cm²'."""

    def factors(sign: int) -> str:
        own = [(abs(power), name) for power, name in parts if sign * power > 0]
        return " ".join(
            name + str(power).translate(SUPERSCRIPTS) * (power > 1) for power, name in own
        )

    above, below = factors(1), factors(-1)
    if not below:
        return above
    return f"{above or 1}/({below})" if " " in below else f"{above or 1}/{below}"


def units_of(text: str) -> Units:
    """Convert a text such as 'length=cm,time=s' to names of units, or raise ValueError."""
    found: dict[str, str] = {}
    for part in text.split(","):
        quantity, equals, name = (word.strip() for word in part.partition("="))
        if quantity not in Units._fields:
            hint = did_you_mean(quantity, Units._fields)
            raise ValueError(f"'{quantity}' is not one of {', '.join(Units._fields)}{hint}")
        if not equals or not name:
            raise ValueError(f"'{part}' has no name of a unit, as length=cm has")
        if quantity in found:
            raise ValueError(f"{quantity} is given twice")
        found[quantity] = name
    return Units(**found)
