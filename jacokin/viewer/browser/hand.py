"""What a hand that leads the arm uses of the page: its keys and gamepad, the clutch, and buttons."""

from __future__ import annotations

import html
import json
from pathlib import Path
from urllib.parse import parse_qs

import viser

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.teleop import Controller, TeleopStatus, TeleopStep
from jacokin.teleop.devices import CLUTCH_KEY, COMMAND_KEYS, FINGER_KEYS, KEYS
from jacokin.viewer.browser.server import OWN_HEADER, Server

PATH = "/hand"
PERIOD = 40  # [ms] from one report of the page to the next
LONGEST = 2000  # characters of a report
LINE = '<div style="font-size:0.8em;padding:0 0.75em">'
HELP = f"""{LINE}Click into the scene, then hold keys: w s, a d, r f move along x, y, z; j l, i k, u o turn about them;
g and h close and open the fingers; the space bar works the clutch. Where episodes are recorded, b begins one, e ends
it, y keeps it, x throws it away. A gamepad is read as soon as one of its buttons was
pressed. Only a page in front leads.</div>"""

SCRIPT = "/hand.js"  # beside this file; every page loads it
MARK = {
    "keys": sorted({*KEYS, *FINGER_KEYS, *COMMAND_KEYS, CLUTCH_KEY}),
    "path": PATH,
    "header": OWN_HEADER,
    "period": PERIOD,
}


def read_script() -> str:
    """The script of pages that lead."""
    return Path(__file__).with_name("hand.js").read_text(encoding="utf-8")


class HandControls:
    """The folder "Hand" of the panel, and what its page reports to a controller."""

    def __init__(self, server: Server, controller: Controller) -> None:
        """Add the controls; from now on pages lead."""
        gui, self._controller = server.gui, controller
        self._folder = gui.add_folder("Hand", order=-1.0)
        with self._folder:
            self._line = gui.add_html("")
            gui.add_button("Clutch", hint="Follow the hand, or stay").on_click(lambda _: controller.toggle())
            gui.add_button("End", hint="Brake, and end the session").on_click(self._end)
            gui.add_html(HELP)
            gui.add_html(f'<div data-jacokin-hand="{html.escape(json.dumps(MARK))}"></div>')
        server.listen(PATH, self._hear)

    def show(self, step: TeleopStep) -> None:
        """Say what a tick did."""
        said = step.status.name.replace("_", " ").capitalize()
        if step.status is not TeleopStatus.FOLLOWING:
            said += f": {step.message or step.status.value}"
        self._line.content = f"{LINE}{html.escape(said)}</div>"

    def remove(self) -> None:
        """Take the controls away."""
        self._folder.remove()

    def _end(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        self._controller.ended = True

    def _hear(self, query: str) -> None:
        """Take a report of a page.

        Raises:
            InvalidInputError: it is malformed.
        """
        if len(query) > LONGEST:
            raise InvalidInputError(f"a report of a page must have at most {LONGEST} characters, got {len(query)}")
        given = parse_qs(query)
        keys, axes, buttons = (" ".join(given.get(name, [])).split() for name in ("keys", "axes", "buttons"))
        self._controller.report(keys, _numbers("axes", axes), _numbers("buttons", buttons))


def _numbers(name: str, words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        raise InvalidInputError(f"{name} must be numbers, got {checks.shown(words)}") from None
