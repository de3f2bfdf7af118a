import { IDENTITY, degrees, length, multiply, position, turnedAboutZ, wrapped } from "./matrices.js";
import { unpack } from "./unpack.js";

const described = new Map(); // promises of robots, by name

/** What the site knows of a robot: joints, limits, shapes. Its file is loaded once. */
export function describe(name) {
  if (!described.has(name)) described.set(name, read(name));
  return described.get(name);
}

/** From now on `describe` knows a robot of this name. */
export const remember = (robot) => described.set(robot.name, Promise.resolve(robot));

async function read(name) {
  await new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = new URL(`${name}.js`, HOME);
    script.onload = resolve;
    script.onerror = () => reject(new Error(`${script.src} cannot be loaded`));
    document.head.append(script);
  });
  const robot = JSON.parse(new TextDecoder().decode(await unpack(globalThis.jacokinRobots[name])));
  robot.lower = robot.lower.map((limit) => limit ?? -Infinity);
  robot.upper = robot.upper.map((limit) => limit ?? Infinity);
  robot.reach = [...robot.placements, robot.tool].reduce((sum, place) => sum + length(position(place)), 0);
  return robot;
}

/** Where the scripts of the site are. */
const HOME = document.currentScript.src;

/** Poses in the base of what each joint moves; the base is the first, the tool the last. */
export function frames(robot, q) {
  const found = [IDENTITY];
  robot.placements.forEach((placement, joint) => {
    found.push(turnedAboutZ(multiply(found[joint], placement), q[joint]));
  });
  found.push(multiply(found[found.length - 1], robot.tool));
  return found;
}

export const toolPose = (robot, q) => frames(robot, q).at(-1);

/** By how much each joint is within its limits [rad]: negative outside, infinite without limits. */
export const margins = ({ lower, upper }, q) => Array.from(q, (angle, i) => Math.min(angle - lower[i], upper[i] - angle));

/** Sentence fragments: which joints are outside by how much, or which is nearest to its limit. */
export function limitsInWords(robot, q) {
  const found = margins(robot, q);
  const side = (joint) => (q[joint] - robot.lower[joint] < robot.upper[joint] - q[joint] ? "lower" : "upper");
  const outside = found.flatMap((margin, joint) =>
    margin < 0 ? [`${robot.joints[joint]} is ${angleText(-margin)} past its ${side(joint)} limit`] : [],
  );
  if (outside.length) return outside.join(", ");
  const least = found.indexOf(Math.min(...found));
  if (found[least] === Infinity) return "no joint has a limit";
  return `${angleText(found[least])} to the ${side(least)} limit of ${robot.joints[least]}`;
}

/** Of several configurations the one that is farthest from the limits; null for none. */
export function roomiest(robot, several) {
  const room = (q) => (q ? Math.min(...margins(robot, q)) : -Infinity);
  return several.reduce((a, b) => (room(b) > room(a) ? b : a), null);
}

/** [degree] with one digit, and 0 without a sign. */
export const angleText = (angle) => `${(Math.round(10 * degrees(angle)) / 10 + 0).toFixed(1)}°`;

/** A configuration whose joints without limits are in (-pi, pi]. */
export const tidy = (robot, q) => Array.from(q, (angle, i) => (Number.isFinite(robot.lower[i]) ? angle : wrapped(angle)));
