import { AXES } from "./handles.js";
import { fromRpy, position, toRpy } from "./matrices.js";

/** What the address says after `#`: `robot=gen3&q=0,0.26,...`, and where the arm is not at its target, `pose=`. */

const DIGITS = 6; // [m], [rad]

const listed = (values) => Array.from(values, (value) => String(Number(value.toFixed(DIGITS)))).join(",");

/** @param {{ robot: string, q: number[], pose: number[] | null, free: string | null }} state */
export function toHash({ robot, q, pose, free }) {
  const parts = [`robot=${robot}`, `q=${listed(q)}`];
  if (free) parts.push(`free=${free}`);
  if (pose) parts.push(`pose=${listed([...position(pose), ...toRpy(pose)])}`);
  return `#${parts.join("&")}`;
}

/** The state of an address; what it does not say, or says wrongly, is null. */
export function fromHash(hash, names) {
  const said = new URLSearchParams(hash.replace(/^#/, ""));
  const numbers = (name, counts) => {
    const values = said.get(name)?.split(",").map(Number) ?? [];
    return counts.includes(values.length) && values.every(Number.isFinite) ? values : null;
  };
  const robot = names.includes(said.get("robot")) ? said.get("robot") : null;
  const place = numbers("pose", [6]);
  return {
    robot,
    q: robot && numbers("q", [6, 7]),
    pose: robot && place && fromRpy(place.slice(0, 3), place.slice(3)),
    free: AXES.includes(said.get("free")) ? said.get("free") : null,
  };
}
