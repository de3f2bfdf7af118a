"""Scripts of bricks: `place`, `stack` and `reassemble`.

`place` takes a brick, puts it on a pedestal, and takes the hand away. `stack` and `reassemble` take brick after brick,
and click it onto the one below; they take off what is in the way.
"""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import Box, Capsule, Scene, Sphere
from jacokin.mujoco_bridge import robots
from jacokin.tasks.experts import grasps
from jacokin.tasks.experts.driver import BRICK, CLOSED, OPEN, SPEED, SQUEEZE, ArmDriver, Script, in_base, shift, up
from jacokin.tasks.gym.controls import FRAME

CLEAR = 0.07  # [m] of the brick's middle above the pedestal on its way
ON_BRICK, IN_CRADLE = 0.04, 0.032  # [m] of the brick's middle above the pedestal when it is released
YAWS = np.arange(12) * np.pi / 6.0  # [rad] that a brick may be turned by above the pedestal
DRAG_TILTS = (0.25, 0.4, 0.1)  # [rad] away from the pedestal, the first is preferred
LOW = 0.04  # [m] of the closed fingers above a brick, where nothing is in their way
FREE = 0.155  # [m] between the axis of the pedestal and a brick that can be grasped from above
ABOVE = 0.08  # [m] of the hand above the pedestal while it goes somewhere
_SPHERE, _OFFSET = 0.049, 0.0343  # [m] radius of the spheres of its cradle, and how far out and down they are
_ORIGIN = np.array((0.0, 0.0, -0.0119))  # [m] of a brick from its middle


def place(arm: ArmDriver, rest: float) -> Script:
    """Put a brick on the pedestal, again if it falls; it is released at some height above it [m]."""
    target = arm.get("pedestal/position", 3)
    scene = pillar(target)
    has_failed = False
    while True:
        brick = arm.prop(BRICK)
        if np.linalg.norm(brick.act(_ORIGIN) - target) < 0.05:  # [m]
            yield from _leave(arm, target)
            q = arm.q.copy()
            yield arm.towards(q, 0.0)
            continue
        ways = _ways(brick.translation, target)
        grasp = grasps.plan(arm, brick, ways, scene, target[2] + ABOVE) or grasps.plan(arm, brick)
        beside = np.linalg.norm((brick.translation - target)[:2])
        is_near = has_failed and beside < FREE
        if grasp is None or grasp.room < 0.0 or is_near:
            yield from _drag(arm, brick.translation, target, scene)
            brick = arm.prop(BRICK)
            ways = _ways(brick.translation, target)
            grasp = grasps.plan(arm, brick, ways, scene, target[2] + ABOVE) or grasps.plan(arm, brick)
        if grasp is None:
            yield arm.towards(arm.robot.home, arm.fingers_to(OPEN))
            continue
        yield from grasps.take(arm, grasp)
        start = arm.pose
        for way in ways:
            yield from arm.move(shift(start, way), SQUEEZE, tolerance=0.02)
            if not grasps.holds(arm, arm.prop(BRICK)):
                break
        else:
            yield from _put(arm, target, rest)
        if not grasps.holds(arm, arm.prop(BRICK)):
            has_failed = True
            yield from arm.move(shift(arm.pose, up(0.05)), grasps.WIDE, tolerance=0.02)


def _drag(arm: ArmDriver, brick: Array, target: Array, scene: Scene) -> Script:
    """Press on a brick with the closed fingers and drag it away from the pedestal."""
    outwards = (brick - target) * (1.0, 1.0, 0.0)
    beside = max(float(np.linalg.norm(outwards)), 1e-6)
    outwards /= beside
    tangent = np.array((-outwards[1], outwards[0], 0.0))
    on = brick * (1.0, 1.0, 0.0) + up(0.024) + 0.008 * outwards  # 8 mm outwards from its middle, 24 mm high
    way = max(0.0, FREE - beside) * outwards
    best, cost = None, 2.5  # [s] at most
    for yaw, tilt in itertools.product(YAWS, DRAG_TILTS):
        tool = pin.exp3(tilt * tangent) @ grasps.point_down(np.array((np.cos(yaw), np.sin(yaw), 0.0)))
        at = pin.SE3(tool, on - tool @ grasps.CENTRE)
        for height in (LOW, target[2] + ABOVE - at.translation[2]):
            for q in arm.configurations(shift(at, up(height)))[:4]:
                value = arm.duration(arm.q, q) + height / SPEED + abs(tilt - DRAG_TILTS[0])
                if value > cost or arm.chain([at, shift(at, way)], q, grasps.LONGEST_STEP) is None:
                    continue
                if height > LOW or arm.room(arm.way(arm.q, q), scene) > grasps.ROOM:
                    best, cost = (q, at), value
    if best is None:
        return
    yield from arm.go(best[0], CLOSED, tolerance=0.08)
    yield from arm.move(best[1], CLOSED, settle=5)
    yield from arm.move(shift(best[1], way), CLOSED, speed=0.15, settle=3)
    yield from arm.move(shift(best[1], way + up(0.06)), CLOSED, tolerance=0.03)


def _ways(brick: Array, target: Array) -> list[Array]:
    """Where a brick is carried: away from the pedestal, and up."""
    outwards = (brick - target) * (1.0, 1.0, 0.0)
    beside = float(np.linalg.norm(outwards))
    # A brick is lifted 12.5 cm from the axis of the pedestal, at least.
    aside = max(0.0, 0.125 - beside) * outwards / max(beside, 1e-6)
    return [aside + up(0.03), aside + up(target[2] + CLEAR - brick[2])]  # first up by 3 cm, while it goes away


def _put(arm: ArmDriver, target: Array, rest: float) -> Script:
    """Carry the brick over the pedestal, level it, lower it and let it go."""
    brick = arm.prop(BRICK)
    T_brick_tool = brick.inverse() * arm.pose
    level = grasps.turn_upright(brick.rotation)
    best, cost = None, np.inf
    for yaw in YAWS:
        above = pin.SE3(pin.utils.rotate("z", yaw) @ level, target + up(CLEAR)) * T_brick_tool
        for q in arm.configurations(above)[:4]:
            below = arm.chain([shift(above, up(rest - CLEAR))], q, grasps.LONGEST_STEP)
            if below is not None and arm.durations(q[None], arm.q)[0] < cost:
                best, cost = (q, shift(above, up(rest - CLEAR))), float(arm.durations(q[None], arm.q)[0])
    if best is None:
        return
    yield from arm.go(best[0], SQUEEZE, tolerance=0.02)
    T_tool_brick = arm.pose.inverse() * arm.prop(BRICK)
    # The joints accelerate differently, and the brick would leave its way.
    for action in arm.move(best[1], SQUEEZE, speed=0.12, ramp=0.2, settle=5):
        yield action
        T_tool_brick_now = arm.pose.inverse() * arm.prop(BRICK)
        if np.linalg.norm(T_tool_brick_now.translation - T_tool_brick.translation) > 0.002:  # [m]
            # What presses on something jumps when it is let go.
            height = arm.pose.translation[2] + 0.006 - best[1].translation[2]
            yield from arm.move(shift(best[1], up(height)), SQUEEZE, settle=8)
            break
    yield from arm.release(6)


def _leave(arm: ArmDriver, target: Array) -> Script:
    """Take the hand away upwards."""
    missing = target[2] + 0.23 - arm.pose.translation[2]  # [m] above the pedestal
    if missing > 0.01:
        above = arm.chain([shift(arm.pose, up(missing))], arm.q, np.inf)
        if above is not None:
            yield from arm.go(above[0], OPEN)


def pillar(top: Array) -> Scene:
    """The pedestal as an obstacle, in the frame of the arm's base."""
    radius, length = 0.07, 0.2  # [m]
    centre = top - robots.ARM_OFFSET
    column = Capsule("pillar", radius, length, centre - (0.0, 0.0, radius + length / 2.0))
    around = np.arange(3) * 2.0 * np.pi / 3.0
    spheres = [
        Sphere(f"sphere_{number}", _SPHERE, centre + _OFFSET * np.array((np.sin(angle), np.cos(angle), -1.0)))
        for number, angle in enumerate(around)
    ]
    return Scene([column, *spheres], finger_angle=grasps.WIDE)


HEIGHT = 0.0192  # [m] from a brick to the one that clicks onto it
HOVER = 0.02  # [m] above that, where a brick is aligned
DEEPER = 0.006  # [m] below the place where it clicks, where the hand goes to press
OVER = 0.1  # [m] of the hand while it goes somewhere
HIGH = 0.045  # [m] of a brick on its way
CLICK = 0.0008  # [m] sum of distances of two holes from their places, below which a brick has clicked
HOLE = np.array((0.008, 0.024, -0.0073))  # [m] one of the outermost holes, from the middle of a brick
BESIDE = 0.02  # [m] the same sum, above which a brick cannot be pressed into its place
HIGHER = 0.01  # [m] that a brick is held higher when it is pulled off another
LIES = 0.012  # [m] the middle of a brick that lies on the table
ASIDE = np.linspace(-0.2, 0.2, 9)  # [m] where bricks are put aside
RELEASE_STEPS = 6


def stack(arm: ArmDriver) -> Script:
    """Stack the bricks in the wanted order, which is that of their names unless it is observed."""
    names = bricks(arm)
    order = list(range(len(names)))
    if arm.find("desired_order"):
        order = [int(k) for k in arm.whole("desired_order")]
    while True:
        for below, above in itertools.pairwise([names[k] for k in order]):
            if not has_clicked(arm, below, above):
                yield from _click(arm, below, above, hurried=len(order) > 2)
                break
        else:
            yield arm.towards(arm.q, arm.fingers_to(OPEN))


def reassemble(arm: ArmDriver) -> Script:
    """Take a stack apart as far as it is in the way, and build the wanted one: its reverse unless it is observed."""
    names = bricks(arm)
    order = [0, *range(len(names) - 1, 0, -1)]
    if arm.find("desired_order"):
        order = [int(k) for k in arm.whole("desired_order")]
    wanted = [names[k] for k in order]
    while True:
        for below, above in itertools.pairwise(wanted):
            if has_clicked(arm, below, above):
                continue
            burden = _top(arm, above) if _top(arm, above) != above else _top(arm, below)
            yield from _click(arm, below, above, hurried=True) if burden == below else _put_aside(arm, burden)
            break
        else:
            yield arm.towards(arm.q, arm.fingers_to(OPEN))


def _top(arm: ArmDriver, brick: str) -> str:
    """The uppermost of the bricks that stand on a brick, or that brick itself."""
    for other in bricks(arm):
        way = arm.prop(other).translation - arm.prop(brick).translation
        if other != brick and 0.5 * HEIGHT < way[2] < 1.5 * HEIGHT and np.linalg.norm(way[:2]) < 0.012:
            return _top(arm, other)
    return brick


def _put_aside(arm: ArmDriver, name: str) -> Script:
    """Pull a brick off the one below it, and put it on the table where there is room around it."""
    brick = arm.prop(name)
    rise = up(HIGH)
    grasp = grasps.plan(arm, shift(brick, up(HIGHER)), [rise], _others(arm, name), OVER)
    grasp = grasp or grasps.plan(arm, shift(brick, up(HIGHER)))
    if grasp is None:
        yield arm.towards(arm.robot.home, arm.fingers_to(OPEN))
        return
    yield from grasps.take(arm, grasp)
    yield from arm.move(shift(arm.pose, rise), SQUEEZE, tolerance=0.03)
    brick = arm.prop(name)
    held = grasps.holds(arm, brick)
    spot = _free_spot(arm, name) if held else None
    if spot is not None:
        over = pin.SE3(arm.pose.rotation, arm.pose.translation + np.append((spot - brick.translation)[:2], 0.0))
        yield from arm.move(over, SQUEEZE, tolerance=0.01, settle=4)
        yield from arm.move(
            shift(arm.pose, up(LIES - arm.prop(name).translation[2])), SQUEEZE, tolerance=0.005, settle=6
        )
    yield from arm.release(RELEASE_STEPS)
    yield from arm.move(shift(arm.pose, up(HIGH)), OPEN, tolerance=0.03)


def _free_spot(arm: ArmDriver, name: str) -> Array | None:
    """A place on the table (3,), the nearest to a held brick of those with room around them, within reach."""
    others = [arm.prop(other).translation for other in bricks(arm) if other != name]
    here = arm.prop(name).translation
    spots = [np.array((x, y, LIES)) for x in ASIDE for y in ASIDE]
    for spot in sorted(spots, key=lambda spot: float(np.linalg.norm((spot - here)[:2]))):
        if min(float(np.linalg.norm((spot - other)[:2])) for other in others) < 0.09:
            continue
        over = shift(arm.pose, np.append((spot - here)[:2], 0.0))
        if arm.chain([over, shift(over, up(spot[2] - here[2]))], arm.q, grasps.LONGEST_STEP) is not None:
            return spot
    return None


def bricks(arm: ArmDriver) -> list[str]:
    """The prefixes of what is observed of the bricks, in the order of their roles."""
    arm.get(f"{BRICK}position", 3)  # refuses a task without bricks
    return [name.removesuffix("position") for name in arm.find("/position") if name.startswith("duplo2x4")]


def has_clicked(arm: ArmDriver, below: str, above: str) -> bool:
    """Whether a brick is in its place on another: two opposite studs in two opposite holes."""
    return _missing(arm, below, above) < CLICK


def _missing(arm: ArmDriver, below: str, above: str) -> float:
    """The sum of the distances of two opposite holes of a brick from its place on another [m]."""
    brick = arm.prop(above)
    return min(_apart(goal, brick) for goal in _places(arm, below))


def _apart(goal: pin.SE3, brick: pin.SE3) -> float:
    """The sum of the distances of two opposite holes from where they are to be [m]."""
    return float(sum(np.linalg.norm(goal.act(hole) - brick.act(hole)) for hole in (HOLE, HOLE * (-1.0, -1.0, 1.0))))


def _places(arm: ArmDriver, below: str) -> list[pin.SE3]:
    """T_world_brick of a brick in its place on another, which is the same when it is turned by 180 deg."""
    base = arm.prop(below)
    middle = base.translation + HEIGHT * base.rotation[:, 2]
    return [pin.SE3(base.rotation @ pin.utils.rotate("z", turn), middle) for turn in (0.0, np.pi)]


def _others(arm: ArmDriver, brick: str) -> Scene:
    """The other bricks as obstacles, in the frame of the arm's base."""
    names = [name for name in bricks(arm) if name != brick]
    boxes = [Box(f"brick_{k}", 2.0 * grasps.HALF, in_base(arm.prop(name))) for k, name in enumerate(names)]
    return Scene(boxes, finger_angle=grasps.WIDE)


def _hover(arm: ArmDriver, below: str, above: str) -> tuple[Array, pin.SE3] | None:
    """A configuration that holds a brick above its place, and the place: quick to reach, and far from singular ones."""
    T_brick_tool = arm.prop(above).inverse() * arm.pose
    best, cost = None, np.inf
    for goal in _places(arm, below):
        tool = shift(goal, up(HIGH)) * T_brick_tool
        for q in arm.configurations(tool):
            if arm.chain([shift(tool, up(-HIGH))], q, grasps.LONGEST_STEP) is None:
                continue
            low = float(arm.robot.singular_values(q, FRAME)[-1])
            # No penalty from a singular value of 0.08 on, and 30 s for each 1 below.
            value = float(arm.durations(q[None], arm.q)[0]) + 30.0 * max(0.0, 0.08 - low)
            if value < cost:
                best, cost = (q, goal), value
    return best


def _click(arm: ArmDriver, below: str, above: str, *, hurried: bool) -> Script:
    """Take a brick, and press it onto another.

    Hurried, the hand goes on pressing while it turns a brick that tilts, which is quicker and loses more bricks;
    else it lets go and presses with the fist.
    """
    brick = arm.prop(above)
    rise = up(arm.prop(below).translation[2] + HEIGHT + HIGH - brick.translation[2])
    scene = _others(arm, above)
    grasp = grasps.plan(arm, brick, [rise], scene, OVER) or grasps.plan(arm, brick)
    if grasp is None:
        yield arm.towards(arm.robot.home, arm.fingers_to(OPEN))
        return
    yield from grasps.take(arm, grasp)
    yield from arm.move(shift(arm.pose, rise), SQUEEZE, tolerance=0.03)
    if not grasps.holds(arm, arm.prop(above)):
        yield from arm.release(RELEASE_STEPS)
        return
    hover = _hover(arm, below, above)
    if hover is None:
        yield from arm.release(RELEASE_STEPS)
        return
    q, goal = hover
    yield from arm.go(q, SQUEEZE, tolerance=0.02)
    tool = shift(goal, up(HOVER)) * arm.prop(above).inverse() * arm.pose
    yield from arm.move(tool, SQUEEZE, tolerance=0.001, settle=10)
    for _ in range(3):
        wanted = shift(goal, up(HOVER))
        if _apart(wanted, arm.prop(above)) < 0.0005:  # [m], as of `CLICK`
            break
        tool = wanted * arm.prop(above).inverse() * tool
        yield from arm.move(tool, SQUEEZE, tolerance=0.0, settle=6)
    tool = shift(tool, up(-HOVER - DEEPER))
    for left in reversed(range(4 if hurried else 1)):  # pushes
        yield from arm.move(tool, SQUEEZE, speed=0.08, settle=2 if hurried else 6)
        brick = arm.prop(above)
        if _is_in(goal, brick) or not left or _apart(goal, brick) > BESIDE:
            break
        tilt = pin.log3(goal.rotation @ brick.rotation.T)
        # The hand turns back by more than the tilt: the grip gives way.
        tool = shift(_turn_about(tool, brick.translation, pin.exp3(1.3 * tilt)), up(-DEEPER))
    if has_clicked(arm, below, above):
        yield from arm.release(RELEASE_STEPS)
        yield from arm.move(shift(arm.pose, up(HIGH)), OPEN, tolerance=0.03)
        return
    # What presses on something jumps when it is let go.
    yield from arm.move(shift(arm.pose, up(0.003)), SQUEEZE, settle=3)
    yield from arm.release(RELEASE_STEPS)
    if has_clicked(arm, below, above):
        yield from arm.move(shift(arm.pose, up(HIGH)), OPEN, tolerance=0.03)
        return
    yield from _press(arm, below, above)


def _is_in(goal: pin.SE3, brick: pin.SE3) -> bool:
    """Whether a brick that is pressed on is as deep as it goes, at both ends."""
    holes = [HOLE * (x, y, 1.0) for x in (1.0, -1.0) for y in (1.0, -1.0)]
    return all((goal.act(hole) - brick.act(hole))[2] > -0.0002 for hole in holes)


def _turn_about(pose: pin.SE3, centre: Array, rotation: Array) -> pin.SE3:
    """A pose turned about a point in the world."""
    return pin.SE3(rotation @ pose.rotation, centre + rotation @ (pose.translation - centre))


def _press(arm: ArmDriver, below: str, above: str) -> Script:
    """Press on a brick with the closed fingers, where it is highest, until it has clicked."""
    yield from arm.move(shift(arm.pose, up(0.04)), 0.75, tolerance=0.01, settle=4)  # fingers off the brick
    if _missing(arm, below, above) > BESIDE:
        return
    yield from arm.close(9)
    for left in reversed(range(4)):
        brick = arm.prop(above)
        spots = [brick.act(np.array((0.0, y, 0.0))) for y in (0.0, 0.016, -0.016)]
        on = max(spots, key=lambda spot: float(spot[2]))
        if on[2] - spots[0][2] < 0.0003:  # [m]
            on = spots[0]
        tool = pin.SE3(arm.pose.rotation, on + up(0.012) - arm.pose.rotation @ grasps.CENTRE)
        yield from arm.move(shift(tool, up(0.015)), CLOSED, tolerance=0.003, settle=6)
        missing = _missing(arm, below, above)  # not before: a brick that is pressed on is too low
        if missing < CLICK or missing > BESIDE or not left:
            break
        yield from arm.move(shift(tool, up(-0.025)), CLOSED, speed=0.15, settle=8)  # deeper, for the force
    yield from arm.move(shift(tool, up(HIGH)), CLOSED, tolerance=0.03)
