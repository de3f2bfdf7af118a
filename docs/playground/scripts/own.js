import {
  IDENTITY, column, cross, dot, inverse, length, minus, movedTo, multiply, plus, position, scaled,
} from "./matrices.js";

/** An arm of the reader's own: a file of `jacokin export-c` has its kinematics, but no shapes. It is drawn as sticks. */

const SIDES = 24;
const THICK = { stick: 0.014, drum: 0.032, height: 0.036 }; // parts of the reach
const COLOURS = { stick: [205, 211, 219], drum: [70, 110, 165] };
const RANGE = 30000; // of a corner's whole numbers

/**
 * What the page needs of a robot.
 *
 * @param {string} name
 * @param {object} said by its solver: `joints`, `base`, `frame`, `lower`, `upper`, `home`, and `poses` of the tool where
 *   all joints are 0, and then where one of them is a quarter of a turn.
 */
export function describeOwn(name, { poses, ...said }) {
  const [atZero, ...turned] = poses.map((pose) => Array.from(pose));
  const axes = [IDENTITY];
  for (const pose of turned) axes.push(axisFrame(multiply(pose, inverse(atZero)), position(axes.at(-1))));
  axes.push(atZero);
  const [, ...placements] = axes.map((frame, i) => multiply(inverse(axes[Math.max(i - 1, 0)]), frame));
  const tool = placements.pop();
  const reach = [...placements, tool].reduce((sum, place) => sum + length(position(place)), 0);
  const step = reach / RANGE;
  const parts = [...placements, tool].map((next, i) => drawn(position(next), i > 0, reach, step));
  const lists = Object.fromEntries(["lower", "upper", "home"].map((key) => [key, Array.from(said[key])]));
  return { ...said, ...lists, name, own: true, placements, tool, reach, step, parts };
}

/** A frame whose z is the axis of a quarter of a turn, by the right hand; its origin is the point nearest to another. */
function axisFrame(turn, near) {
  const axis = [turn[9] - turn[6], turn[2] - turn[8], turn[4] - turn[1]].map((each) => each / 2);
  const moved = position(turn);
  const point = scaled(plus(moved, cross(axis, moved)), 0.5);
  return movedTo(frameAlong(axis), plus(point, scaled(axis, dot(minus(near, point), axis))));
}

/** A frame at the origin whose z is along a direction. */
function frameAlong(direction) {
  const z = scaled(direction, 1 / length(direction));
  const least = z.map(Math.abs).indexOf(Math.min(...z.map(Math.abs)));
  const across = cross(column(IDENTITY, least), z);
  const x = scaled(across, 1 / length(across));
  const y = cross(z, x);
  return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, 0, 0, 0, 1];
}

/** What a joint moves: a drum about its axis, and a stick to what follows. */
function drawn(next, isJoint, reach, step) {
  const { stick, drum, height } = THICK;
  const pieces = [];
  if (isJoint) pieces.push(cylinder(drum * reach, -height * reach, height * reach, IDENTITY, step, COLOURS.drum));
  const far = length(next);
  if (far > stick * reach) pieces.push(cylinder(stick * reach, 0, far, frameAlong(next), step, COLOURS.stick));
  return { pieces: null, light: pieces, plain: null };
}

/** Along z of a frame. */
function cylinder(radius, low, high, frame, step, colour) {
  const at = (x, y, z) => position(multiply(frame, movedTo(IDENTITY, [x, y, z]))).map((each) => Math.round(each / step));
  const ends = [low, high];
  const vertices = ends.flatMap((z) => at(0, 0, z));
  const faces = [];
  for (let side = 0; side < SIDES; side++) {
    const angle = (2 * Math.PI * side) / SIDES;
    for (const z of ends) vertices.push(...at(radius * Math.cos(angle), radius * Math.sin(angle), z));
    const [a, b] = [2 + 2 * side, 2 + 2 * ((side + 1) % SIDES)];
    faces.push(0, b, a, 1, a + 1, b + 1, a, b, b + 1, a, b + 1, a + 1);
  }
  return { colour, vertices, faces };
}
