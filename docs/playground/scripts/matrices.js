/** Poses as 4x4 matrices, row by row, and vectors of three numbers. Metres and radians. */

export const IDENTITY = Object.freeze([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

export function multiply(a, b) {
  const product = new Array(16);
  for (let row = 0; row < 16; row += 4) {
    for (let column = 0; column < 4; column++) {
      product[row + column] =
        a[row] * b[column] + a[row + 1] * b[4 + column] + a[row + 2] * b[8 + column] + a[row + 3] * b[12 + column];
    }
  }
  return product;
}

/** The pose of the other one's frame in this one's. */
export function inverse(pose) {
  const [x, y, z] = [0, 1, 2].map((axis) => -dot(column(pose, axis), position(pose)));
  return [pose[0], pose[4], pose[8], x, pose[1], pose[5], pose[9], y, pose[2], pose[6], pose[10], z, 0, 0, 0, 1];
}

/** A pose turned about z of its own frame. */
export function turnedAboutZ(pose, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const turned = [...pose];
  for (let row = 0; row < 12; row += 4) {
    turned[row] = pose[row] * c + pose[row + 1] * s;
    turned[row + 1] = pose[row + 1] * c - pose[row] * s;
  }
  return turned;
}

export const position = (pose) => [pose[3], pose[7], pose[11]];

/** A column of the rotation: axis 0, 1 or 2 of the pose's frame. */
export const column = (pose, axis) => [pose[axis], pose[4 + axis], pose[8 + axis]];

export function movedTo(pose, [x, y, z]) {
  const moved = [...pose];
  [moved[3], moved[7], moved[11]] = [x, y, z];
  return moved;
}

/** A pose turned about its own origin, by the right hand about an axis of the base; orthonormal again. */
export function turned(pose, axis, angle) {
  const [x, y, z] = scaled(axis, 1 / length(axis));
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const v = 1 - c;
  const rotation = [
    c + x * x * v, x * y * v - z * s, x * z * v + y * s, 0,
    y * x * v + z * s, c + y * y * v, y * z * v - x * s, 0,
    z * x * v - y * s, z * y * v + x * s, c + z * z * v, 0,
    0, 0, 0, 1,
  ];
  return movedTo(orthonormal(multiply(rotation, pose)), position(pose));
}

function orthonormal(pose) {
  const x = scaled(column(pose, 0), 1 / length(column(pose, 0)));
  const across = cross(x, column(pose, 1));
  const z = scaled(across, 1 / length(across));
  const y = cross(z, x);
  const clean = [...pose];
  for (let row = 0; row < 3; row++) [clean[4 * row], clean[4 * row + 1], clean[4 * row + 2]] = [x[row], y[row], z[row]];
  return clean;
}

/** A pose of position and roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll). */
export function fromRpy([x, y, z], [roll, pitch, yaw]) {
  const [cr, sr, cp, sp] = [Math.cos(roll), Math.sin(roll), Math.cos(pitch), Math.sin(pitch)];
  const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)];
  return [
    cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x,
    sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y,
    -sp, cp * sr, cp * cr, z,
    0, 0, 0, 1,
  ];
}

/** Roll, pitch, yaw; where the pitch is a right angle, the roll is 0. */
export function toRpy(pose) {
  const pitch = Math.atan2(-pose[8], Math.hypot(pose[0], pose[4]));
  if (Math.hypot(pose[0], pose[4]) < 1e-9) return [0, pitch, Math.atan2(-pose[1], pose[5])];
  return [Math.atan2(pose[9], pose[10]), pitch, Math.atan2(pose[4], pose[0])];
}

export const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** An angle in (-pi, pi]. */
export const wrapped = (angle) => angle - 2 * Math.PI * Math.ceil(angle / (2 * Math.PI) - 0.5);

export const degrees = (angle) => (angle * 180) / Math.PI;
export const radians = (angle) => (angle * Math.PI) / 180;
