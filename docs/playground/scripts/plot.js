import { degrees, wrapped } from "./matrices.js";

/** The set of solutions: a joint's angle over the parameter, as SVG; where the joint may not be is shaded. */

const SVG = "http://www.w3.org/2000/svg";
const SPACE = { left: 46, right: 10, top: 10, bottom: 34, outside: 15 }; // [pixel]; [degree] beyond a limit
const HEIGHT = 230; // [pixel]
const REACH = 24; // [pixel]

export class Plot {
  #points = []; // { x, y, curve, point }

  /** @param {HTMLElement} figure where it goes  @param {(q: number[]) => void} choose what a click on a curve does */
  constructor(figure, choose) {
    this.svg = make("svg", { role: "img", height: HEIGHT });
    figure.append(this.svg);
    this.svg.addEventListener("pointerdown", (event) => {
      const box = this.svg.getBoundingClientRect();
      const near = this.#nearest(event.clientX - box.left, event.clientY - box.top);
      if (near) choose(near.q);
    });
  }

  /** @param {{ robot: object, joint: number, curves: object[], q: number[], parameter: number | null, name: string }} */
  draw({ robot, joint, curves, q, parameter, name }) {
    const width = Math.max(this.svg.parentElement.clientWidth, 240);
    const limited = Number.isFinite(robot.lower[joint]);
    const [low, high] = limited
      ? [degrees(robot.lower[joint]) - SPACE.outside, degrees(robot.upper[joint]) + SPACE.outside]
      : [-180, 180];
    const [left, right] = range(curves);
    const x = (angle) => SPACE.left + ((angle - left) / (right - left)) * (width - SPACE.left - SPACE.right);
    const y = (angle) => SPACE.top + ((high - angle) / (high - low)) * (HEIGHT - SPACE.top - SPACE.bottom);
    const shown = (angle) => degrees(limited ? angle : wrapped(angle));
    const parts = [];
    if (limited) {
      for (const [upper, lower] of [[high, degrees(robot.upper[joint])], [degrees(robot.lower[joint]), low]]) {
        const size = { width: x(right) - x(left), height: y(lower) - y(upper) };
        parts.push(make("rect", { class: "pg-shaded", x: x(left), y: y(upper), ...size }));
      }
    }
    for (const tick of ticks(left, right, width < 420 ? 90 : 45)) {
      parts.push(make("line", { class: "pg-rule", x1: x(tick), x2: x(tick), y1: y(high), y2: y(low) }));
      parts.push(label(`${tick}°`, x(tick), HEIGHT - SPACE.bottom + 14, "middle"));
    }
    for (const tick of ticks(low, high, high - low > 250 ? 90 : 45)) {
      parts.push(make("line", { class: "pg-rule", x1: x(left), x2: x(right), y1: y(tick), y2: y(tick) }));
      parts.push(label(`${tick}°`, SPACE.left - 6, y(tick) + 4, "end"));
    }
    parts.push(label(name, (x(left) + x(right)) / 2, HEIGHT - 4, "middle"));
    this.#points = [];
    curves.forEach((curve) => {
      let path = "";
      let before = null;
      curve.parameters.forEach((at, i) => {
        const point = curve.q[i];
        const angle = point && shown(point[joint]);
        if (point) this.#points.push({ x: x(degrees(at)), y: y(angle), q: point });
        const joined = point && before !== null && Math.abs(angle - before) < 180;
        if (point) path += `${joined ? "L" : "M"}${x(degrees(at)).toFixed(1)} ${y(angle).toFixed(1)}`;
        before = point ? angle : null;
      });
      parts.push(make("path", { class: "pg-curve", d: path }));
    });
    if (parameter !== null) {
      const at = [-360, 0, 360].map((turn) => degrees(parameter) + turn).find((each) => each >= left && each <= right);
      parts.push(make("circle", { class: "pg-here", cx: x(at ?? left), cy: y(shown(q[joint])), r: 6 }));
    }
    this.svg.setAttribute("width", width);
    this.svg.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    const count = curves.length === 1 ? "1 interval" : `${curves.length} intervals`;
    this.svg.setAttribute("aria-label", `${robot.joints[joint]} over ${name}: ${count} within the limits`);
    this.svg.replaceChildren(...parts);
  }

  #nearest(x, y) {
    const distance = (point) => Math.hypot(point.x - x, point.y - y);
    const best = this.#points.reduce((a, b) => (a && distance(a) <= distance(b) ? a : b), null);
    return best && distance(best) < REACH ? best : null;
  }
}

/** What is shown of the parameter [degree]: a turn that holds all curves, or as much more as they need. */
function range(curves) {
  const least = degrees(Math.min(...curves.map(({ start }) => start), Infinity));
  const most = degrees(Math.max(...curves.map(({ stop }) => stop), -Infinity));
  if (!curves.length || (least >= -180 && most <= 180)) return [-180, 180];
  return [least, Math.max(most, least + 360)];
}

function ticks(low, high, step) {
  const found = [];
  for (let at = Math.ceil(low / step) * step; at <= high; at += step) found.push(at);
  return found;
}

function label(text, x, y, anchor) {
  const made = make("text", { x, y, "text-anchor": anchor });
  made.textContent = text;
  return made;
}

function make(tag, attributes) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}
