"""Write a file of randomly placed circles, the obstacles of a random Lorentz gas.

    python post/scatterers.py 100000 0.01 --radius 0.9 --seed 1 -o scatterers.txt

An input with periodic sides can name the file in `obstacle.file`.  The arguments are the number of
circles and their number per area, the density.  The centres are independent and distributed
uniformly in a square, so that circles can overlap.  Set both components of `box.upper` to the side
of the square, sqrt(number / density), which the script prints.  The reduced density of the theory
is n R^2, where R is the sum of the radii of tracer and circle.

see also
  lorentz.py, docs/guides/billiards.md
"""

import argparse
from pathlib import Path

import numpy as np


def scatterers(number: int, density: float, radius: float, seed: int) -> np.ndarray:
    """Return x, y and radius (number, 3) of each circle."""
    side = np.sqrt(number / density)
    centres = np.random.default_rng(seed).uniform(0, side, (number, 2))
    return np.column_stack([centres, np.full(number, radius)])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("number", type=int, help="number of circles")
    parser.add_argument("density", type=float, help="number of circles per unit of area")
    parser.add_argument("--radius", type=float, default=0.9, help="radius of each circle [0.9]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random numbers [1]")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="name of the text file to be written"
    )
    args = parser.parse_args()
    if args.number < 1 or not args.density > 0 or not args.radius > 0:
        parser.error("number, density and radius must be positive")
    rows = scatterers(args.number, args.density, args.radius, args.seed)
    np.savetxt(args.output, rows, fmt="%.12g", header="x y radius", comments="")
    print(f"{args.output}: {args.number} circles, L = {np.sqrt(args.number / args.density):.17g}")


if __name__ == "__main__":
    main()
