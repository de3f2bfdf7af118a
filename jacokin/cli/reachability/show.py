"""`jacokin map show`: a map as a picture or a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from jacokin.cli.arguments.declared import Argument, Option
from jacokin.cli.display import tables
from jacokin.cli.reachability.maps import load


def show(
    folder: Annotated[str, Argument(metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")],
    output: Annotated[
        Path,
        Option(
            "--output",
            metavar="FILE",
            help="A picture (.png, .svg, .pdf), one that turns (.apng, .gif), or an .html page to turn it.",
        ),
    ] = Path("map.png"),
) -> None:
    """Draw a map: slices and a view in space.

    Examples:
      jacokin map show j2n6s300
      jacokin map show out/jaco --output out/jaco.html
      jacokin map show out/jaco --output out/jaco.apng
    """
    load(folder).plot(output)
    tables.say(f"written to {output}")
