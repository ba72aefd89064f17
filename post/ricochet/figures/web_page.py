"""Web pages of films and of the laboratory, assembled from the parts in the folder `page`."""

import base64
import hashlib
import html
import json
import re
from pathlib import Path

from ..commands import SCRIPTS
from ..reading.reader import Run
from .drawing import caption

PAGE = SCRIPTS / "page"  # folder of the parts
INPUTS = SCRIPTS.parent / "input"
MODULES = ("film", "camera", "stage", "panels", "sliders", "controls")
MODULES += ("encounter", "stream", "live")
LAB_MODULES = ("sliders", "values", "lab", "disks", "open_system")


def page(run: Run, film: dict | None) -> str:
    """Return the web page of a film; `film` is None if the server of --live sends the film."""
    title = str(run.parameter("run", "title", "")) or run.path.stem
    commit = run.provenance.get("git_commit", "unknown")
    words = {
        "title": title,
        "caption": caption([run]),
        "warning": run.termination_note if film else "",
        "source": f"{run.path.name} (ricochet {commit})",
    }
    return paged(film, words)


def view() -> str:
    """Return the page of a film that is embedded in the page of the laboratory."""
    return paged(None, dict.fromkeys(("title", "caption", "warning", "source"), ""))


def paged(film: dict | None, words: dict[str, str]) -> str:
    """Return a film page with the given texts; None stands for a film from its server."""
    style = text_of("style.css")
    script = "\n".join(text_of(f"{name}.js") for name in MODULES)
    fillings = {name: html.escape(text) for name, text in words.items()} | {
        "policy": policy(style, script, *["connect-src 'self'"] * (film is None)),
        "style": style,
        "data": enclosed(film),
        "script": script,
    }
    return filled("page.html", fillings)


def lab_page(data: dict) -> str:
    """Return the page of the laboratory; `data` holds the table of variables and the inputs."""
    style = text_of("style.css") + text_of("lab.css")
    script = "".join(text_of(f"{name}.js") for name in LAB_MODULES)
    more = "connect-src 'self'", "img-src data:", "frame-src 'self'"
    fillings = {"policy": policy(style, script, *more), "style": style, "script": script}
    return filled("lab.html", fillings | {"data": enclosed(data)})


def chooser(paths: list[Path]) -> list[dict]:
    """Return title, description, sliders and picture of each input file for the laboratory."""
    known = json.loads((INPUTS / "chooser.json").read_text(encoding="utf-8"))
    found = []
    for path in paths:
        own = known.get(path.stem) if path.resolve().parent == INPUTS else None
        if own is None:
            words = {"title": path.stem, "subject": "Your own", "sentence": ""}
            found.append({"name": path.stem, **words, "sliders": [], "picture": None})
        else:
            found.append({"name": path.stem, **own, "picture": picture_of(path)})
    order = [*known]
    return sorted(found, key=lambda one: order.index(one["name"]) if one["picture"] else -1)


def picture_of(path: Path) -> str:
    """Return the picture of an input file as a data URL."""
    drawn = (INPUTS / "pictures" / f"{path.stem}.png").read_bytes()
    return f"data:image/png;base64,{base64.b64encode(drawn).decode()}"


def filled(name: str, fillings: dict[str, str]) -> str:
    """Return a page after filling in its placeholders."""
    blank = re.compile("{{(" + "|".join(fillings) + ")}}")
    return blank.sub(lambda found: fillings[found[1]], text_of(name))


def text_of(name: str) -> str:
    """Return the text of a style, script or template from which pages are assembled."""
    return (PAGE / name).read_text(encoding="utf-8")


def enclosed(data: object) -> str:
    """Return data as JSON without `<`, which would be unsafe inside an HTML script element."""
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def policy(style: str, script: str, *more: str) -> str:
    """Return a content security policy for a style, a script and the further sources `more`."""
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'", *more]
    for tag, own in (("script", script), ("style", style)):
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        rules.append(f"{tag}-src 'sha256-{digest}'")
    return "; ".join(rules)
