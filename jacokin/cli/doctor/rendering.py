"""Which of MuJoCo's rendering back ends work?"""

from __future__ import annotations

import os

from jacokin.cli.doctor import probes
from jacokin.cli.doctor.finding import MISSING, OK, Finding

# Back end of MuJoCo's renderer -> what installs it on Debian and Ubuntu.
RENDERERS = {
    "egl": "apt install libegl1 libgl1-mesa-dri",
    "osmesa": "apt install libosmesa6",
    "glfw": "a display and libglfw3",
}

RENDER_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 2'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
"""


def renderers() -> list[Finding]:
    """Which back ends of MuJoCo can draw a picture here; none is needed for kinematics."""
    findings = []
    for backend, remedy in RENDERERS.items():
        if backend == "glfw" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            findings.append(Finding("rendering", backend, MISSING, "no display"))
            continue
        _, error = probes.run(RENDER_PROBE, MUJOCO_GL=backend)
        detail = f"works with MUJOCO_GL={backend}" if error is None else f"{remedy} ({error})"
        findings.append(Finding("rendering", backend, OK if error is None else MISSING, detail))
    return findings
