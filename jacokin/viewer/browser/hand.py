"""What a hand that leads the arm uses of the page: its keys and gamepad, the clutch, and buttons."""

from __future__ import annotations

import html
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

# A page may run a script where an image that does not exist fails to load. Keys that lead do nothing else: viser's own
# listeners, which move the camera by w, a, s and d, come later.
SCRIPT = """(() => {
  if (window.jacokinHand) return;
  window.jacokinHand = true;
  const names = new Set(%(keys)s), held = new Set();
  const name = event => event.key === ' ' ? 'space' : event.key.toLowerCase();
  const typing = event => event.target.closest?.('input:not([type=checkbox]), textarea') != null;
  const hear = (event, change) => {
    if (!names.has(name(event)) || typing(event) || event.ctrlKey || event.altKey || event.metaKey) return;
    change(name(event));
    event.preventDefault();
    event.stopImmediatePropagation();
  };
  window.addEventListener('keydown', event => hear(event, key => held.add(key)), true);
  window.addEventListener('keyup', event => { held.delete(name(event)); hear(event, () => {}); }, true);
  window.addEventListener('blur', () => held.clear());
  const numbers = values => values.map(value => value.toFixed(3)).join(' ');
  const report = async () => {
    if (document.hasFocus()) {
      const pad = [...navigator.getGamepads()].find(each => each && each.connected);
      const said = new URLSearchParams({
        keys: [...held].join(' '),
        axes: pad ? numbers([...pad.axes]) : '',
        buttons: pad ? numbers([...pad.buttons].map(button => button.value)) : '',
      });
      await fetch('%(path)s?' + said, {cache: 'no-store', headers: {'%(header)s': 'hand'}}).catch(() => {});
    }
    setTimeout(report, %(period)d);
  };
  report();
})()"""


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
            gui.add_html(f'<img src="data:," alt="" style="display:none" onerror="{_attribute(SCRIPT)}">')
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


def _attribute(script: str) -> str:
    """The script as the value of an attribute of HTML."""
    keys = str(sorted({*KEYS, *FINGER_KEYS, *COMMAND_KEYS, CLUTCH_KEY}))
    text = script % {"keys": keys, "path": PATH, "header": OWN_HEADER, "period": PERIOD}
    return text.replace("&", "&amp;").replace('"', "&quot;")
