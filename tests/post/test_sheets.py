"""Figures of all analyses: sizes of text, stacked and single panels, meaning of error bars."""

import pytest
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.container import ErrorbarContainer

import ricochet
from ricochet.figures.drawing import plt
from ricochet.figures.sheet import Panel, Sheet, columns_that_fit, legend_above, smallest_text
from sampling import mostly
from synthetic_gases import cooled, falling, gas

TIMED = "&output frames_every_time = {0} observables_every_time = {0} {1} /\n"
PERIODIC = "&box boundary = 'periodic', 'periodic' /\n"
BULK = PERIODIC + "&species name = 'gas' count = 64 packing_fraction = 0.3 temperature = 1 /\n"
LONG = (
    BULK + "&stop collisions_per_disk = 100 /\n" + TIMED.format(0.02, "event_log = T helfand = T")
)
MOVING = "count = 8 radius = 0.05 velocities = 'uniform' speed = 3 /\n"
FALLING = (
    "&box upper = 4, 4 gravity = 0, -9.81 /\n"
    f"&species name = 'A' mass = 1 {MOVING}&species name = 'B' mass = 2 {MOVING}"
    "&stop time = 12 /\n" + TIMED.format(0.05, "")
)
STEPS = "&run dynamics = 'steps' dt = 4e-3 /\n"
ROUGH = "&contact restitution = 0.9 tangential_restitution = 0.5 /\n"
CRATER = """&species name = 'bed' count = 40 radius = 0.04 region = 0, 1, 0, 0.5 /
&species name = 'projectile' mass = 25 radius = 0.1 position = 0.5, 0.75 velocity = 0, -5 /
&contact restitution = 0.5 contact_time = 1e-5 / &stop energy_fraction = 0.1 /
""" + TIMED.format(0.01, "")
TARGET = """&species name = 'heavy' mass = 1e6 radius = 0.1 position = 0.5, 0.5 /
&species name = 'light' mass = 1 radius = 0.001 position = 0.2, 0.55 velocity = 1, 0 /
&stop collisions = 1 time = 0.7 /
"""
ALONE = (
    "&species count = 1 radius = 0.1 position = {}, 0.3 velocity = 0.6, 0.8 /\n&stop time = {} /\n"
)
CHAOTIC = "&obstacle centre = 0.5, 0.7 radius = 0.2 /\n" + ALONE + TIMED.format(0.2, "")
LORENTZ = PERIODIC + "&obstacle centre = 0.5, 0.5 radius = 0.35 /\n" + TIMED.format(0.2, "")
HOPPER = """&box gravity = 0, -1 / &wall from = 0, 0.6 to = {0}, 0.4 /
&wall from = 1, 0.6 to = {1}, 0.4 / &species count = 30 radius = 0.02 region = 0, 1, 0.7, 1 /
&drive kind = 'recycle' interval = 0.05 velocity = 0, -0.5 from_region = 0, 1, 0, 0.3
to_region = 0, 1, 0.7, 1 / &contact restitution = 0.9 contact_time = 1e-4 /
&stop time = 8 /
""" + TIMED.format(0.05, "")
SEEDS = ("run.seed=1", "run.seed=2")
#: Inputs with settings of their runs, and options of the analyses of these runs.
SIMULATED = {
    "contacts": ([LONG], SEEDS[:1], {}),
    "correlations": ([LONG], SEEDS, {}),
    "cost": ([LONG], ("species.gas.count=32", "species.gas.count=64"), {}),
    "coverage": ([LONG], [f"run.seed={k}" for k in range(10)], {"equilibration": 10}),
    "crater": ([CRATER], SEEDS[:1], {}),
    "crater_scan": ([CRATER], [f"species.projectile.mass={m}" for m in (10, 16, 25)], {}),
    "discharge": (
        [HOPPER.format(0.5 - x, 0.5 + x) for x in (0.09, 0.11, 0.13)],
        SEEDS[:1],
        {"after": 1},
    ),
    "driven": ([FALLING], SEEDS, {"show": "height"}),
    "equation_of_state": ([LONG], SEEDS, {}),
    "equipartition": ([FALLING], SEEDS, {}),
    "fields": ([LONG], SEEDS, {}),
    "haff": ([BULK + "&contact restitution = 0.9 /\n" + LONG[len(BULK) :]], SEEDS, {}),
    "lorentz": ([LORENTZ + ALONE.format(0, 400)], SEEDS, {"lags": [1, 3]}),
    "lyapunov": ([CHAOTIC.format(x, 40) for x in (0.3, 0.3 + 1e-9)], SEEDS[:1], {}),
    "melting": ([LONG], SEEDS, {}),
    "missed": ([FALLING, STEPS + FALLING], SEEDS, {"equilibration": 1}),
    "mixture": ([FALLING.replace("gravity = 0, -9.81", "")], SEEDS, {}),
    "rates": ([LONG], SEEDS, {}),
    "rough": ([BULK + ROUGH + LONG[len(BULK) :]], SEEDS, {}),
    "scaling": ([LONG], ("run.threads=1", "run.threads=2"), {}),
    "scattering": ([TARGET], [f"species.light.position=0.2,{y}" for y in (0.52, 0.55)], {}),
    "transport": ([LONG], SEEDS, {}),
}
SYNTHETIC = {
    "cooling": lambda path, rng: [cooled(path / f"{k}.h5", 0.9, 0.1, seed=k) for k in (1, 2)],
    "energy": lambda path, rng: [falling(path / "fall.h5", rng)],
    "gravity": lambda path, rng: [falling(path / "fall.h5", rng)],
    "speeds": lambda path, rng: [gas(path / "gas.h5", rng), gas(path / "b.h5", rng, count=300)],
}


@pytest.mark.parametrize(
    ("limits", "shown"),
    [
        ((1e-7, 1e-4), {"1e-6", "1e-5", "0.0001"}),
        ((0.01, 100), {"0.01", "0.1", "1", "10", "100"}),
        ((2.1, 4.9), {"3", "4"}),
        ((1e5, 1e7), {"100000", "1e6", "1e7"}),
    ],
)
def test_ticks_of_logarithmic_axes_have_no_superscripts(limits, shown):
    def draw(axes):
        axes.set(xscale="log", xlim=limits)

    figure = Sheet([[Panel("only", draw)]]).figure()
    figure.draw_without_rendering()
    axis = figure.axes[0].xaxis
    found = {text.get_text() for text in axis.get_ticklabels() + axis.get_ticklabels(minor=True)}
    assert shown <= found and not any("$" in text for text in found)
    plt.close(figure)


def test_scripts_are_as_large_as_the_smallest_text():
    """Only texts that contain subscripts, superscripts or fractions are enlarged."""

    def draw(axes):
        for name in ("plain", "$x$", "$x^2$", r"$\frac{1}{2}$ of it"):
            axes.plot([0, 1], label=name)
        axes.set(xlabel="$x$", ylabel="$y_1$", title="title")
        legend_above(axes)

    figure = Sheet([[Panel("only", draw)]]).figure()
    assert 7.999 < smallest_text(figure) < 8.001
    (axes,) = figure.axes
    assert axes.xaxis.label.get_size() == 9 and axes.yaxis.label.get_size() > 11
    sizes = [text.get_size() for text in axes.get_legend().get_texts()]
    assert sizes == pytest.approx([8, 8, 8 / 0.7, 8 / 0.7])
    plt.close(figure)


@pytest.fixture
def analysed(simulated, tmp_path, rng):
    """Return a function that runs an analysis on small runs suited to it."""

    def result_of(name):
        if name in SYNTHETIC:
            return ricochet.analyse(name, SYNTHETIC[name](tmp_path, rng))
        texts, settings, options = SIMULATED[name]
        both = [(text, own) for text in texts for own in settings]
        runs = [simulated(text, own, name=f"{name}_{k}") for k, (text, own) in enumerate(both)]
        return ricochet.analyse(name, runs, **options)

    return result_of


def columns_of(figure):
    """Return the left ends of the panels, except colour bars."""
    spots = [axes.get_subplotspec() for axes in figure.axes]
    return {round(spot.get_position(figure).x0, 3) for spot in spots if spot is not None}


@pytest.mark.parametrize("name", mostly(ricochet.analyses, {"cooling", "scattering"}))
def test_a_figure_fits_paper_and_screen(name, analysed):
    """Letters and scripts have 8 points; narrow panels are stacked, and can be drawn alone."""
    result = analysed(name)
    sheet = result.draw(result)
    for width in ("16cm", "8.5cm", "slide"):
        figure = result.figure(width=width)
        assert smallest_text(figure) >= 7.999
        words = [text.get_text() for text in figure.texts]
        height = 2.54 * figure.get_figheight()
        if width == "8.5cm":
            assert height < 25.01 or any("--panel" in line for line in words)
        else:
            assert height < 22.01
        if width == "8.5cm":
            assert len(columns_of(figure)) == 1
        marks = " ".join([*sheet.notes, *result.notes]).lower()
        shown = [one for axes in figure.axes for one in (*axes.containers, *axes.collections)]
        if any(isinstance(one, ErrorbarContainer) and one.has_yerr for one in shown):
            assert "bar" in marks
        if any(isinstance(one, FillBetweenPolyCollection) for one in shown):
            assert "band" in marks
        plt.close(figure)
    for row in sheet.rows:
        for panel in row:
            alone = result.figure(panel.name)
            assert len(columns_of(alone)) == 1
            plt.close(alone)


def test_legends_have_as_many_columns_as_fit_with_their_own_widths():
    """A long entry does not widen the columns of short ones."""
    assert columns_that_fit([33, 1, 1], 50) == 3
    assert columns_that_fit([33, 1, 1], 45) == 2
    assert columns_that_fit([33, 33], 45) == columns_that_fit([], 45) == 1
